"""Changes hidden in modes of a frame that is no model of ours, and the data for a diagnosis of them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray
from oma import ModalEstimate
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Body,
    Circumstances,
    Diagnosis,
    DiagnosisResult,
    ModalMean,
    Model,
    Reference,
    Structure,
    build_model,
    diagnose,
    learn_reference,
    matched,
    nominal_reference,
    stack_tracks,
)
from updater.modal_data import KnownMass
from updater.structure import Sensor

TRACK = np.arange(8)
CHANNELS = t_frame().channels
COLUMN = tuple(c for c in CHANNELS if c.startswith("col"))
TOP, HALF = 1.48, 0.399  # m: height of the crossbeam, and a bit less than half of its length
_GAIN, _TILT, _PLACE = 0.01, 0.02, 0.003  # std of a further sensor: gain [-], direction [rad], place [m]
_WEIGHED = 0.003  # std of a known mass, relative


@dataclass(frozen=True)
class Change:
    """Changes of the structure, and of the channels' signals."""

    bodies: tuple[Body, ...] = ()
    foot: dict[str, float] | None = None  #: factors on stiffness by axis
    joint: dict[str, float] | None = None
    stiffness: float = 1.0
    density: float = 1.0
    order: tuple[tuple[str, str], ...] = ()  #: channels exchanged
    gain: tuple[tuple[str, float], ...] = ()

    def of(self, model: Model) -> Model:
        structure = model.structure
        steel = structure.material["steel"]
        scaled = {key: getattr(steel, key) * self.stiffness for key in ("youngs_modulus", "shear_modulus")}
        scaled["density"] = steel.density * self.density
        parts: dict[str, object] = {"material": {"steel": steel.model_copy(update=scaled)}}
        for name, factors in (("support", self.foot), ("joint", self.joint)):
            (part,) = getattr(structure, name)
            stiffness = {axis: k * (factors or {}).get(axis, 1.0) for axis, k in part.stiffness.items()}
            parts[name] = (part.model_copy(update={"stiffness": stiffness}),)
        changed = structure.model_copy(update=parts).with_bodies(self.bodies)
        return build_model(changed, shear_flexible=True, mass="consistent")

    def heard(self, estimate: ModalEstimate) -> ModalEstimate:
        shape = estimate.shape.copy()
        for pair in self.order:
            a, b = (CHANNELS.index(name) for name in pair)
            shape[:, [a, b]] = shape[:, [b, a]]
        for name, factor in self.gain:
            shape[:, CHANNELS.index(name)] *= factor
        return replace(estimate, shape=shape / np.linalg.norm(shape, axis=1, keepdims=True))


def learnt(seed: int, already: Change | None = None) -> tuple[Reference, Model, Callable[[Change], ModalMean]]:
    """A reference from eight windows, the truth, and the result of five windows after a change.

    `already` had happened before, unknown to the reference.
    """
    print(f"seed {seed}")
    random = np.random.default_rng(seed)
    gain: FloatArray = 1 + 0.005 * random.standard_normal(12)
    bare = true_model(np.random.default_rng((seed, 1)))
    bare = already.of(bare) if already else bare
    reference = learn_reference(t_frame(), [measure(bare, random, gain) for _ in range(8)], [TRACK] * 8)

    def event(change: Change) -> ModalMean:
        model = change.of(bare)
        windows = [change.heard(measure(model, random, gain)) for _ in range(5)]
        return matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 5)))

    return reference, bare, event


class MeasuredAgain:
    """A frame that is measured before and after a change, then with a further sensor or a known mass.

    Sensors of the column alone move alike for mirror images on the crossbeam. The search may be limited to some causes.
    """

    def __init__(
        self, seed: int, change: Change, channels: tuple[str, ...] = CHANNELS, only: tuple[str, ...] = ()
    ) -> None:
        self._random, self._channels = np.random.default_rng((seed, 1)), channels
        self._bare = true_model(np.random.default_rng((seed, 2)))
        self._gain = 1 + 0.005 * self._random.standard_normal(len(channels))
        self._change, self._only = change, only
        self._before = self._windows(self._with(self._bare.structure), 8)
        self._now = self._windows(change.of(self._bare).structure, 5)

    def _with(self, structure: Structure, *more: Sensor) -> Structure:
        kept = tuple(s for s in structure.sensor if s.channel in self._channels)
        return structure.model_copy(update={"sensor": kept + more})

    def _windows(self, truth: Structure, n: int, *more: Sensor) -> list[ModalEstimate]:
        model = build_model(self._with(truth, *more), shear_flexible=True, mass="consistent")
        gain = np.append(self._gain, 1 + _GAIN * self._random.standard_normal(len(more)))
        return [measure(model, self._random, gain) for _ in range(n)]

    def answer(self) -> DiagnosisResult:
        return self._answer(self._now)

    def with_sensor(self, at: tuple[float, float, float], axis: str) -> DiagnosisResult:
        """Return the answer with a further sensor on the crossbeam, which the reference lacks."""
        x, y, z = np.eye(3)["xyz".index(axis)]
        further = Sensor(channel="further", at=at, direction=(x, y, z))
        tilted = np.array((x, y, z)) + _TILT * self._random.standard_normal(3) * (1 - np.eye(3)["xyz".index(axis)])
        x, y, z = tilted / np.linalg.norm(tilted)
        moved = float(np.clip(at[0] + _PLACE * self._random.standard_normal(), -HALF, HALF))
        true = Sensor(channel="further", at=(moved, 0.0, TOP), direction=(x, y, z))
        return self._answer(self._windows(self._change.of(self._bare).structure, 5, true), sensors=(further,))

    def with_mass(self, at: tuple[float, float, float], mass: float, state: Change | None = None) -> DiagnosisResult:
        """Return the answer with a further record with a known mass, on another state of the frame if one is given."""
        weighed = mass * (1 + _WEIGHED * self._random.standard_normal())
        heavier = (
            (self._change if state is None else state)
            .of(self._bare)
            .structure.with_bodies((Body(at=at, mass=weighed),))
        )
        return self._answer(self._now, mass=(mass, at, self._windows(heavier, 5)))

    def of_file_with_held_out_sensor(self, at: tuple[float, float, float]) -> DiagnosisResult:
        """Return the answer without reference logs; a held-out record has a further sensor."""
        further = Sensor(channel="further", at=at, direction=(0.0, 0.0, 1.0))
        kept = self._windows(self._change.of(self._bare).structure, 5, further)
        logs, held_out = (stack_tracks(windows, [TRACK] * 5) for windows in (self._now, kept))
        reference = nominal_reference(self._with(t_frame(), further), logs)
        events = [matched(reference.baseline, reference.mean_of(modes)) for modes in (logs, held_out)]
        return diagnose(reference, events[0], heldout=events[1], only=self._only)

    def _answer(
        self,
        now: list[ModalEstimate],
        sensors: tuple[Sensor, ...] = (),
        mass: tuple[float, tuple[float, float, float], list[ModalEstimate]] | None = None,
    ) -> DiagnosisResult:
        reference = learn_reference(self._with(t_frame(), *sensors), self._before, [TRACK] * 8)

        def event(windows: list[ModalEstimate]) -> ModalMean:
            return matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * len(windows))))

        known = (KnownMass(mass=mass[0], position=mass[1], modes=event(mass[2])),) if mass else ()
        return diagnose(reference, event(now), circumstances=Circumstances(known_masses=known), only=self._only)


def names(diagnosis: Diagnosis) -> list[str]:
    return sorted(cause.cause for cause in diagnosis.causes)
