"""Signatures of the commands, without their imports."""
