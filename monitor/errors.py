"""What can stop the monitor before or while it runs.

MonitorError
    SettingsError   SITE.toml cannot be used; names file and key
    ArgumentError   an argument that makes no sense; names it
    ResultsError    a log, folder or file of which nothing can be shown; names it
    StartError      it could not start: a device, a port, a folder
"""

from pathlib import Path


class MonitorError(Exception):
    """Base of all errors of this package."""


class SettingsError(MonitorError):
    """Settings that cannot be used."""

    def __init__(self, path: Path | str, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path = path


class ArgumentError(MonitorError):
    """An argument of a command that makes no sense."""

    def __init__(self, name: str, message: str) -> None:
        super().__init__(f"{name}: {message}")
        self.name = name


class ResultsError(MonitorError):
    """Results that cannot be shown."""

    def __init__(self, path: Path | str, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path = path


class StartError(MonitorError):
    """Something needed to start is not there."""
