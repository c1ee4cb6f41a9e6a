"""Commands on a running monitor: health, history, alarms, service."""
