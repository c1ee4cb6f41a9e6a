"""Devices, ports and buses for tests."""
