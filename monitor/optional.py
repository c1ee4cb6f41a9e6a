"""Optional parts of an answer, such as pictures, whose failure must not cost the answer."""

import logging
from collections.abc import Callable
from typing import TypeVar

from monitor.errors import MonitorError

T = TypeVar("T")
_log = logging.getLogger(__name__)


def run_optional(what: str, make: Callable[[], T]) -> T | None:
    """Return what a function makes; log a fault in it, in one line, and return None.

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
