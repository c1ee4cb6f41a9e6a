"""Results of one run, with queries for views."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

from daq import Recording
from monitor.results.windows import (
    AcceptedShift,
    AlarmResult,
    MassAnswer,
    ModalChange,
    ModeResult,
    ReferenceResult,
    Spectrum,
    WindowResult,
)

T = TypeVar("T")
_LARGE = 10.0  # kg: from here on masses are given in kg
_NEAR = 0.03  # relative
_MAX_DRAWN = 300  # windows whose spectrum and posterior are kept in the file


@dataclass(frozen=True, eq=False, kw_only=True)
class RunResults:
    """Results that are drawn, in the order of time."""

    name: str
    reference: ReferenceResult | None
    windows: tuple[WindowResult, ...]
    alarms: tuple[AlarmResult, ...]
    signals: Recording | None = None
    device_events: tuple[tuple[int, str], ...] = ()  #: time [ns UTC] and sentence of gaps and of lost devices
    #: times [ns UTC] and readings [degC] of each thermometer
    temperatures: Mapping[str, tuple[list[int], list[float]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a run of which nothing can be drawn."""
        if not self.windows:
            raise ValueError("windows: expected at least one, found none")

    @property
    def start(self) -> int:
        """Start of the first window [ns UTC]."""
        return self.windows[0].start

    @property
    def end(self) -> int:
        """End of the last window [ns UTC]."""
        return self.windows[-1].end

    @property
    def structure(self) -> ReferenceResult | None:
        """Reference with a structure to draw; None before there is one, and at a site without a structure file."""
        return self.reference if self.reference and self.reference.has_model else None

    @property
    def geometry(self) -> ReferenceResult | None:
        """Reference with a structure or with positions of sensors to draw; None without."""
        return self.reference if self.reference and self.reference.has_geometry else None

    @property
    def last_change(self) -> ModalChange | None:
        """Change of the measured modes by the last window that states one."""
        return next((window.change for window in reversed(self.windows) if window.change), None)

    @cached_property
    def watched(self) -> list[WindowResult]:
        """Windows in which the modes are tracked, and so have identities."""
        return [w for w in self.windows if w.phase != "learning"]

    @cached_property
    def learning(self) -> list[WindowResult]:
        """Windows whose modes are only counted, without identities."""
        return [w for w in self.windows if w.phase == "learning"]

    def learned_near(self, number: int) -> list[tuple[WindowResult, ModeResult]]:
        """Return the modes of the learning windows that are nearest to a mode of the reference, within 3 %."""
        modes = self.reference.modes if self.reference else []
        own = next((m.frequency for m in modes if m.id == number), None)
        if own is None:
            return []
        near = []
        for window in self.learning:
            mode = min(window.modes, key=lambda m: abs(m.frequency - own), default=None)
            if mode and abs(mode.frequency / own - 1) < _NEAR:
                nearest = min(modes, key=lambda m: abs(m.frequency - mode.frequency))
                near += [(window, mode)] if nearest.id == number else []
        return near

    @cached_property
    def tracks(self) -> list[int]:
        """Identities of the tracked modes, ascending; none while learning."""
        known = {m.id for m in self.reference.modes} if self.reference else set()
        return sorted(known | {m.id for w in self.watched for m in w.modes})

    @cached_property
    def answers(self) -> list[tuple[WindowResult, MassAnswer]]:
        """Windows that locate a mass, with their answers."""
        return [(w, w.answer) for w in self.windows if w.answer]

    @property
    def accepted(self) -> list[AcceptedShift]:
        """Changes that are part of the reference at the end, in order, those of earlier logs among them."""
        return self.reference.accepted if self.reference else []

    def accepted_at(self, change: AcceptedShift) -> int:
        """Return when a change was accepted [ns UTC]; of one of an earlier log, the end of its last window."""
        after = (a.time for a in self.alarms if a.kind == "accepted" and a.time >= change.time >= self.start)
        return next(after, change.time)

    @property
    def closed_by(self) -> AcceptedShift | None:
        """Acceptance that ended the last alarm; None if it ended by itself, is active, or was undone."""
        stood = [alarm.time for alarm in self.alarms if alarm.state == "alarm"]
        newest = self.accepted[-1] if self.accepted else None
        return newest if newest and stood and self.accepted_at(newest) >= stood[-1] else None

    @cached_property
    def mass_unit(self) -> tuple[float, str]:
        """Number of units per kilogram, and the name of the unit: grams unless the masses are large."""
        largest = max((abs(a.mass) for _, a in self.answers), default=0.0)
        return (1.0, "kg") if largest >= _LARGE else (1000.0, "g")

    @cached_property
    def spectra(self) -> list[tuple[WindowResult, Spectrum]]:
        """Windows whose spectrum is drawn, thinned in a long run."""
        return thin([(w, w.spectrum) for w in self.windows if w.spectrum])


def thin(items: Sequence[T], most: int = _MAX_DRAWN) -> list[T]:
    """Return at most `most` items, evenly spread, the last one among them."""
    step = -(-len(items) // most) if items else 1
    return list(items[::-1][::step])[::-1]


def standing_answer(window: WindowResult, before: WindowResult | None) -> WindowResult | None:
    """Return the window whose answer holds at a window: its own, or while the alarm stands the last one; else None.

    Parameters
    ----------
    before : what this function returned for the window before
    """
    if window.answer:
        return window
    return before if window.phase == "alarm" else None


def find_mode(window: WindowResult, number: int) -> ModeResult | None:
    """Return a tracked mode of a window, None if the window did not show it."""
    return next((m for m in window.modes if m.id == number), None)
