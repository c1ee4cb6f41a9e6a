"""Ports, time-outs, reconnects: what stands between a protocol and blocks."""
