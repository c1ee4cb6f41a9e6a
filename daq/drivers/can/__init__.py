"""Devices on a CAN bus, and the bus itself."""
