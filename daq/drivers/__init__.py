"""Drivers of devices: ports, time-outs, reconnection, and blocks from scans."""
