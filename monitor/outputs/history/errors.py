"""Errors of a history."""

from monitor.errors import MonitorError


class HistoryError(MonitorError):
    """A database that cannot be opened, read or written.

    Parameters
    ----------
    url : of the database
    message : the fault
    unusable : whether its file is damaged, or no longer the one that was opened: waiting does not help
    """

    def __init__(self, url: str, message: str, *, unusable: bool = False) -> None:
        super().__init__(f"{url}: {message}")
        self.url, self.unusable = url, unusable
