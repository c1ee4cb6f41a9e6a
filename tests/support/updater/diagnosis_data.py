"""Changes hidden in modes of a frame that is no model of ours, and the data for a diagnosis of them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray
from oma import ModalEstimate
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, Diagnosis, ModalMean, Model, Reference, build_model, learn_reference, matched, stack_tracks

TRACK = np.arange(8)
CHANNELS = t_frame().channels


@dataclass(frozen=True)
class Change:
    """Changes of the structure, and of the channels' signals."""

    bodies: tuple[Body, ...] = ()
    foot: dict[str, float] | None = None  #: factors on stiffness by axis
    joint: dict[str, float] | None = None
    stiffness: float = 1.0
    order: tuple[tuple[str, str], ...] = ()  #: channels exchanged
    gain: tuple[tuple[str, float], ...] = ()

    def of(self, model: Model) -> Model:
        structure = model.structure
        steel = structure.material["steel"]
        scaled = {key: getattr(steel, key) * self.stiffness for key in ("youngs_modulus", "shear_modulus")}
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


def names(diagnosis: Diagnosis) -> list[str]:
    return sorted(cause.cause for cause in diagnosis.causes)
