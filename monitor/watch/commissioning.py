"""Commissioning with a known mass: comparison of the answer with mass and position.

The same mass scales the modes: output-only modes have no scale, the shift that a known mass makes of each frequency
gives it.

References
----------
Parloo, E., Verboven, P., Guillaume, P., Van Overmeire, M. (2002). Sensitivity-based operational mode shape
normalisation. MSSP 16, 757-767: eq. 8, the scale from the shift; here by the shift that the model predicts of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from monitor.analysis.window import Window, synchronized_windows
from monitor.errors import MonitorError
from monitor.settings import Settings
from monitor.text.causes import change_text
from monitor.text.verdicts import is_one_mass
from monitor.watch.baseline.learned_baseline import LearnedBaseline, learn_baseline
from monitor.watch.explanation import conditions_of, explain_windows
from monitor.watch.memory import Memory
from monitor.watch.self_test import with_mass
from updater import (
    Diagnosis,
    MassChange,
    ModalDataError,
    ModalMean,
    PairingError,
    Reference,
    Structure,
    locate_mass_with_forecast,
)

_SIGMAS = 3.0  # that place and mass may be off by
_TELLS = 0.5  # relative to a mode's scale: a less certain one is not stated
_NO_MODEL = "structure: expected a structure file in the settings, found none: a mass is located by its model"
_NEAR = 0.05  # m from a member's axis, at which the mass may be attached


class ProofError(MonitorError):
    """Nothing can be proven yet, or not there."""


@dataclass(frozen=True, kw_only=True)
class Check:
    """One thing that had to be."""

    what: str
    result: str
    passed: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class Scale:
    """Mass-normalised shape of a mode at the sensors."""

    mode: int  #: identity
    frequency: float  #: without the mass [Hz]
    modal_mass: float  #: real over the model's [-]
    modal_mass_std: float  #: [-]
    shape: FloatArray  #: (n_channels,) [kg^-1/2]


@dataclass(frozen=True, eq=False, kw_only=True)
class Proof:
    """Result of the drill."""

    mass: float  #: attached mass [kg]
    place: FloatArray  #: (3,) on a member's axis [m]
    member: str
    found: MassChange
    found_place: FloatArray  #: (3,) [m]
    raised: int | None  #: when the alarm was [ns UTC]
    checks: tuple[Check, ...]
    channels: tuple[str, ...]
    scales: tuple[Scale, ...]  #: none by a mass that is not proven: it is another one, or elsewhere
    n_windows: int
    start: int  #: start of the windows used [ns UTC]
    end: int  #: [ns UTC]

    @property
    def passed(self) -> bool:
        """True if every requirement was met."""
        return all(check.passed for check in self.checks)

    @property
    def modal_mass(self) -> tuple[float, float] | None:
        """Real over the model's modal masses, all modes together, and its standard deviation [-]; None: not known.

        If they scatter by more than their own deviations, the uncertainty is increased (Birge's ratio).
        """
        if not self.scales:
            return None
        found = np.array([scale.modal_mass for scale in self.scales])
        weight = np.array([scale.modal_mass_std**-2 for scale in self.scales])
        mean = float(np.average(found, weights=weight))
        scatter = weight @ (found - mean) ** 2 / max(1, len(found) - 1)
        return mean, float((max(1.0, scatter) / weight.sum()) ** 0.5)


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """Knowledge of a watch about the active change."""

    structure: Structure
    learned: LearnedBaseline
    reference: Reference
    event: ModalMean  #: modes of the windows with the mass
    diagnosis: Diagnosis
    found: MassChange
    raised: int | None  #: when the alarm was [ns UTC]
    n_windows: int
    start: int  #: [ns UTC]
    end: int  #: [ns UTC]

    @property
    def place(self) -> FloatArray:
        """Position at which the mass was found (3,) [m]."""
        return next(m for m in self.structure.member if m.name == self.found.member).point(self.found.distance)


def gather(memory: Memory, structure: Structure | None, settings: Settings) -> Evidence:
    """Return the data of a monitor on the active change.

    Parameters
    ----------
    memory : of the monitor, while the mass is attached
    structure, settings : of the site

    Raises
    ------
    ProofError
        If no baseline is learned, no change is seen, too little is known of it, or there is no structure file.
    """
    learned, changed_windows = _learned(memory, structure, settings)
    if learned.model is None or structure is None:
        raise ProofError(_NO_MODEL)
    reference = learned.model.reference
    event = learned.mean_of(changed_windows)
    late = synchronized_windows(changed_windows, learned.devices)
    try:
        explained, _ = explain_windows(reference, learned.before, conditions_of(changed_windows), late)
        found, _ = locate_mass_with_forecast(reference, event)
    except (ModalDataError, PairingError) as error:
        raise ProofError(f"the change cannot be explained: {error}") from error
    return Evidence(
        structure=structure,
        learned=learned,
        reference=reference,
        event=event,
        diagnosis=explained.diagnosis,
        found=found,
        raised=memory.alarm.raised,
        n_windows=len(changed_windows),
        start=changed_windows[0].start,
        end=changed_windows[-1].end,
    )


def prove(evidence: Evidence, mass: float, at: Sequence[float]) -> Proof:
    """Compare the answer of a monitor with the mass that caused the change.

    Parameters
    ----------
    evidence : of the watch
    mass : attached [kg]
    at : (3,) where, within 5 cm of a member's axis [m]

    Raises
    ------
    ProofError
        If no member is near.
    """
    found, diagnosis = evidence.found, evidence.diagnosis
    member, place = _on_member(evidence.structure, np.asarray(at, float))
    checks = (
        _cause_check(diagnosis),
        _place_check(evidence, member, place),
        _mass_check(found, mass),
    )
    proven = all(check.passed for check in checks)
    return Proof(
        mass=mass,
        place=place,
        member=member,
        found=found,
        found_place=evidence.place,
        raised=evidence.raised,
        checks=checks,
        channels=evidence.reference.baseline.channels,
        scales=tuple(_scales(evidence, place, mass)) if proven else (),
        n_windows=evidence.n_windows,
        start=evidence.start,
        end=evidence.end,
    )


def _learned(memory: Memory, structure: Structure | None, settings: Settings) -> tuple[LearnedBaseline, list[Window]]:
    """Return the learned state, and the windows with the mass; the first may hold both states."""
    if memory.detector is None:
        n, of = len(memory.baseline), memory.target
        raise ProofError(f"the baseline is being learned, {n} of {of} windows: attach the mass once it is")
    minutes = settings.step_seconds * (1 + settings.alarm.hold_windows) / 60
    if not memory.out:
        again = f"attach the mass, and repeat after {minutes:.3g} min; a mass that was attached earlier is not detected"
        raise ProofError(f"no change detected: {again}")
    changed_windows = [w for w in memory.out if w.start >= memory.out[0].end]
    if not changed_windows or memory.alarm.state != "alarm":
        raise ProofError(f"a change is detected, but in too few windows: repeat after {minutes:.3g} min")
    return learn_baseline(structure, memory.baseline, settings, memory.detector, memory.accepted), changed_windows


def _on_member(structure: Structure, at: FloatArray) -> tuple[str, FloatArray]:
    """Return the member nearest to a point, and the nearest point (3,) of its axis."""
    found = []
    for member in structure.member:
        start, way = np.asarray(member.start), np.subtract(member.end, member.start)
        nearest = start + np.clip((at - start) @ way / (way @ way), 0, 1) * way
        found.append((float(np.linalg.norm(at - nearest)), member.name, nearest))
    off, name, nearest = min(found, key=lambda one: one[0])
    if off > _NEAR:
        raise ProofError(
            f"--position: {at.tolist()} is {1000 * off:.0f} mm off the nearest member, {name}: expected within 50"
        )
    return name, nearest


def _cause_check(diagnosis: Diagnosis) -> Check:
    """Return whether the cause is one mass; its size and place are those that are located, as in the alarm."""
    passed = is_one_mass(diagnosis)
    return Check(what="cause", result="one mass" if passed else change_text(diagnosis), passed=passed)


def _place_check(evidence: Evidence, member: str, place: FloatArray) -> Check:
    """Return whether the true place is in the stated region, or within three deviations of the stated place."""
    found = evidence.found
    start = next(m for m in evidence.structure.member if m.name == member).start
    distance, off = float(np.linalg.norm(place - start)), float(np.linalg.norm(evidence.place - place))
    inside = any(s.member == member and s.start <= distance <= s.stop for s in found.region)
    x, y, z = evidence.place
    result = (
        f"on the {found.member} at ({x:.3f}, {y:.3f}, {z:.3f}) m, "
        f"{1000 * off:.0f} mm off, ± {1000 * found.distance_std:.0f} mm stated"
    )
    return Check(what="place", result=result, passed=inside or off <= _SIGMAS * found.distance_std)


def _mass_check(found: MassChange, mass: float) -> Check:
    off = found.mass - mass
    result = f"{1000 * found.mass:.0f} g, {1000 * off:+.0f} g off, ± {1000 * found.mass_std:.0f} g stated"
    return Check(what="mass", result=result, passed=abs(off) <= _SIGMAS * found.mass_std)


def _scales(evidence: Evidence, place: FloatArray, mass: float) -> Iterator[Scale]:
    """Yield the scale of each mode that the mass determines.

    A mass changes 1 / omega^2 by itself times the square of the mode's motion: the ratio of the real to the modelled
    effect is that of the model's modal mass to the real one.
    """
    learned, reference, event = evidence.learned, evidence.reference, evidence.event
    expected = with_mass(reference, place[None], mass)[0] ** -2 - 1
    base = reference.baseline
    ratio = np.exp(2 * (base.log_frequency - event.log_frequency))
    std = 2 * ratio * np.hypot(base.log_frequency_std, event.log_frequency_std)
    length = np.linalg.norm(reference.at_channels(base.channels)[:, reference.paired], axis=0)
    for k in np.flatnonzero(std < _TELLS * np.abs(ratio - 1)):
        modal_mass = float(expected[k] / (ratio[k] - 1))
        if modal_mass > 0:
            yield Scale(
                mode=int(learned.watched[k]) + 1,
                frequency=float(np.exp(base.log_frequency[k])),
                modal_mass=modal_mass,
                modal_mass_std=float(modal_mass * std[k] / abs(ratio[k] - 1)),
                shape=base.shape[k] * length[k] / np.sqrt(modal_mass),
            )
