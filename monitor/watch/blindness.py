"""Windows without a usable result, and channels without data in successive windows."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from monitor.analysis.excluded_channels import by_reason, left_out_texts
from monitor.results.windows import WindowResult

LASTING = 2  #: consecutive windows after which a channel is reported: a gap, or an impact, may cost one


@dataclass(frozen=True)
class MissingChannels:
    """Channels without data in the last windows, and the reports on them."""

    windows: Mapping[str, int] = field(default_factory=dict)  #: channel -> in how many windows in a row by now
    lasting: Mapping[str, str] = field(default_factory=dict)  #: reported channel -> first reason
    gone: tuple[tuple[tuple[str, ...], str], ...] = ()  #: groups that the last window added, and why
    back: tuple[str, ...] = ()  #: channels with data again

    def after(self, window: WindowResult) -> "MissingChannels":
        """Return the same after one more window; one without modes has no information on single channels.

        A channel that the site does not have any more is discarded.
        """
        if window.problem:
            return MissingChannels(self.windows, self.lasting)
        windows = {channel: self.windows.get(channel, 0) + 1 for channel in window.faults}
        lasting = {c: self.lasting.get(c, why) for c, why in window.faults.items() if windows[c] >= LASTING}
        gone = {c: why for c, why in lasting.items() if c not in self.lasting}
        back = (c for c in self.lasting if c in window.channels)
        return MissingChannels(windows, lasting, tuple(by_reason(gone)), tuple(back))

    @property
    def texts(self) -> list[str]:
        """Reports while it lasts, one for each reason."""
        return left_out_texts(self.lasting)


MAX_BLIND = 3  #: windows in a row from which on it is


@dataclass(frozen=True)
class BlindWindows:
    """Number of consecutive windows without a usable result, and the reason of the last one."""

    dark: int = 0
    why: str = ""

    def after(self, window: WindowResult) -> "BlindWindows":
        """Return the same after one more window."""
        why = _why(window)
        return BlindWindows(self.dark + 1, why) if why else BlindWindows()

    @property
    def blind(self) -> str | None:
        """Text to be reported; None while all is well."""
        return f"no usable result from the last {self.dark} windows: {self.why}" if self.dark >= MAX_BLIND else None


def _why(window: WindowResult) -> str:
    """Return why a window has no usable result, empty if it has."""
    if window.problem:
        return window.problem
    judged = window.phase == "learning" or (window.novelty is not None and math.isfinite(window.novelty.t2))
    return "" if judged else "no watched mode was identified"
