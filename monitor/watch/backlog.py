"""Choice of windows that an analysis leaves out when it has fallen behind: acquisition never waits for it."""

from collections.abc import Callable, Collection

from monitor.settings import Settings

MAX_WINDOWS = 6  #: windows that may wait before any is left out
_MIN_SECONDS = 60.0  # of wall time that these must be: a start, or a diagnosis, may take that on a busy machine
SKIPPED = "left out: the analysis had fallen behind"

Skip = Callable[[int, int], bool]  #: whether a window of that number, with its end [ns UTC], is left out


class Backlog:
    """Decides live: once too many windows wait, all but the newest are left out.

    Parameters
    ----------
    settings : of the site
    newest : returns the time up to which signals have arrived [ns UTC]
    """

    def __init__(self, settings: Settings, newest: Callable[[], int]) -> None:
        speed = settings.clock.speed if settings.clock else 1.0
        self._step, self._newest = settings.step_seconds, newest
        self._most = max(MAX_WINDOWS * self._step, _MIN_SECONDS * speed)
        self._behind = False

    def __call__(self, index: int, end: int) -> bool:
        """Return whether to leave a window out."""
        seconds = (self._newest() - end) * 1e-9
        self._behind = seconds > (self._step if self._behind else self._most)
        return self._behind


def as_logged(indices: Collection[int]) -> Skip:
    """Return the function that leaves out the same windows as in a log."""
    return lambda index, _: index in indices


def none(_: int, __: int) -> bool:
    """Leave no window out."""
    return False
