"""The monitoring service: processes, start and stop, devices, outputs, status."""
