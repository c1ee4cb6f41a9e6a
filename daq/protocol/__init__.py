"""Bytes to samples and back, pure: no port is opened here."""
