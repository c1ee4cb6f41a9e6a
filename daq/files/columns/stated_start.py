"""Start time that a file states in its texts."""

from dataclasses import dataclass

from daq.notebook import utc_text


@dataclass(frozen=True, kw_only=True)
class StatedStart:
    """Start time that a text of a file states."""

    time: int  #: [ns UTC]; midnight if there is no time of day
    place: str  #: place of the date in the file, such as "line 3"
    with_clock: bool  #: whether a time of day is stated

    @property
    def remark(self) -> str:
        """Remark for the user of the file."""
        day = "" if self.with_clock else " (no time of day: midnight)"
        return f"start time from {self.place}: {utc_text(self.time)}{day}"


@dataclass(frozen=True, kw_only=True)
class UnclearDate:
    """Start date whose order of day and month is not certain."""

    text: str
    place: str  #: place in the file, such as "line 3"

    @property
    def remark(self) -> str:
        """Remark for the user of the file."""
        return (
            f"start date {self.text!r:.40} in {self.place} not used: it may have the day or the month first; give "
            "--date-order dmy or mdy"
        )
