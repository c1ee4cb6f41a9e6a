"""What can be wrong with a history."""

from monitor.errors import MonitorError


class HistoryError(MonitorError):
    """A database that cannot be opened, read or written."""

    def __init__(self, url: str, message: str) -> None:
        super().__init__(f"{url}: {message}")
        self.url = url
