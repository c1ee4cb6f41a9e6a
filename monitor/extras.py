"""Optional analyses whose failure must not suppress the alarm."""

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Extras:
    """Diagnosis, self-tests, health of the sensors: where one fails, that is said, and the watch goes on without it.

    The process of the analysis would end with it before the window's result is told, and again with the next window,
    as long as whatever it is stands: nobody would ever hear of the alarm.
    """

    def __init__(self) -> None:
        self._failed: list[str] = []
        self._noted: set[str] = set()

    def note(self, text: str) -> None:
        """Report a fault that another part has met and survived, once."""
        if text not in self._noted:
            self._noted.add(text)
            self._failed.append(text)

    def found(self, what: str, find: Callable[[], T]) -> T | None:
        """Return what is found, None where that fails."""
        try:
            return find()
        except Exception as error:  # noqa: BLE001 - whatever it is, the alarm comes first
            self._failed.append(f"{what} has failed: {type(error).__name__}: {error}")
            return None

    def failed(self) -> list[str]:
        """Return what has failed since the last time, in words."""
        failed, self._failed = self._failed, []
        return failed
