"""Internal faults of single causes: logged and collected, so that none of them ends a diagnosis."""

import logging
from collections.abc import Callable, Mapping
from typing import TypeVar

T = TypeVar("T")
_log = logging.getLogger(__name__)


class Faults:
    """Faults found so far in one diagnosis, by the cause or the causes in which they occurred."""

    def __init__(self) -> None:
        self._found: dict[str, str] = {}

    @property
    def found(self) -> Mapping[str, str]:
        """Type and message of the first fault of each."""
        return self._found

    def attempt(self, what: str, function: Callable[[], T]) -> T | None:
        """Return what a function returns; note a fault in it and return None.

        Parameters
        ----------
        what : name of the cause, or names of the causes, that the function deals with
        function : computation; a cause may be any distribution's, which may raise anything
        """
        try:
            return function()
        except Exception as error:  # noqa: BLE001 - a fault of any kind costs this cause alone
            text = f"{type(error).__name__}: {' '.join(str(error).split())}"
            if what not in self._found:
                _log.warning("internal error, %s is not considered: %s", what, text)
                _log.debug("", exc_info=True)
            self._found.setdefault(what, text)
            return None
