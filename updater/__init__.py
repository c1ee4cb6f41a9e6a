"""Modes and a structure in; a calibrated reference, mass updates and located changes out."""
