"""Optional analyses whose failure must not suppress the alarm."""

import logging
from collections.abc import Callable, Iterable
from typing import TypeVar

from monitor.errors import MonitorError

T = TypeVar("T")


class OptionalWork:
    """Optional work: diagnosis, self-tests, sensor health. A failure is reported, and monitoring continues.

    Without this, an exception would end the analysis process before the window's result is reported, and again with the
    next window: the alarm would never be reported.
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
        """Return the result, None if it fails."""
        try:
            return find()
        except Exception as error:  # noqa: BLE001 - whatever it is, the alarm comes first
            self._failed.append(f"{what} has failed: {type(error).__name__}: {error}")
            return None

    @property
    def state(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Faults that were noted, in a fixed order, and failures since the last time."""
        return tuple(sorted(self._noted)), tuple(self._failed)

    def restore(self, noted: Iterable[str], failed: Iterable[str]) -> None:
        """Continue from a state."""
        self._noted, self._failed = set(noted), list(failed)

    def failed(self) -> list[str]:
        """Return the failures since the last time, as a text."""
        failed, self._failed = self._failed, []
        return failed


_log = logging.getLogger(__name__)


def run_optional(what: str, make: Callable[[], T]) -> T | None:
    """Return the result of a function; log a fault in it, in one line, and return None.

    Parameters
    ----------
    what : name of the part, for the log
    make : function that makes it; errors of the monitor itself, such as a file that cannot be written, are raised
    """
    try:
        return make()
    except MonitorError:
        raise
    except Exception as error:  # noqa: BLE001 - a fault of any kind costs this part alone
        _log.warning("internal error, %s is left out: %s: %s", what, type(error).__name__, " ".join(str(error).split()))
        _log.debug("", exc_info=True)
        return None
