"""Channels that windows give no shapes of, though the site has them: a sensor that died says so by nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from monitor.left_out import by_reason, left_out_texts
from monitor.results import WindowResult

LASTING = 2  #: windows in a row from which on a channel is told: a gap, or a blow, may cost one


@dataclass(frozen=True)
class Unheard:
    """Channels without data in the last windows, and the reports on them."""

    windows: Mapping[str, int] = field(default_factory=dict)  #: channel -> in how many windows in a row by now
    lasting: Mapping[str, str] = field(default_factory=dict)  #: channel that is told -> why it was not heard at first
    gone: tuple[tuple[tuple[str, ...], str], ...] = ()  #: groups that the last window added, and why
    back: tuple[str, ...] = ()  #: channels that it heard again

    def after(self, window: WindowResult) -> "Unheard":
        """Return the same after one more window; one without modes says nothing of single channels.

        A channel that the site does not have any more is forgotten: nobody has heard it again.
        """
        if window.problem:
            return Unheard(self.windows, self.lasting)
        windows = {channel: self.windows.get(channel, 0) + 1 for channel in window.faults}
        lasting = {c: self.lasting.get(c, why) for c, why in window.faults.items() if windows[c] >= LASTING}
        gone = {c: why for c, why in lasting.items() if c not in self.lasting}
        back = (c for c in self.lasting if c in window.channels)
        return Unheard(windows, lasting, tuple(by_reason(gone)), tuple(back))

    @property
    def texts(self) -> list[str]:
        """Reports while it lasts, one for each reason."""
        return left_out_texts(self.lasting)
