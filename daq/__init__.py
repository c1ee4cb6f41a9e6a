"""Bytes in, recordings out: drivers, emulators, the MCAP log, and blocks of many devices on one grid."""

from daq.recording import Block, Channel, Flag, FloatArray, Gap, IntArray, Recording

__all__ = ["Block", "Channel", "Flag", "FloatArray", "Gap", "IntArray", "Recording"]
