"""The device side of each protocol, on a pty: real bytes between real processes."""
