"""Events of the examiner's frames for the location of the one-step update: one body at a random place."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from tests.examiner.designs import DESIGNS
from tests.examiner.draws import log_uniform, somewhere, with_lump
from tests.examiner.models.bar import vector
from tests.examiner.models.frame import Lump
from tests.examiner.models.specimen import State, draw_state
from tests.examiner.path import FRAME, observation
from tests.examiner.signals import estimated
from updater import ModalMean, Reference, Structure, build_model, learn_reference, parse_structure
from updater.reference import matched_surely

FRAMES = ("T-frame", "portal", "mast")
_NOISE = "coarse"  # 0.1 % on frequencies and 2 % on shapes, in one window
_N_BEFORE, _N_AFTER = 8, 4
_HEAVIEST = 0.04  # of the structure's mass


@dataclass(frozen=True, eq=False, kw_only=True)
class Specimen:
    """A frame as it is, and the reference learned from it."""

    state: State
    reference: Reference
    random: np.random.Generator

    def event(self, state: State) -> ModalMean:
        """Return the mean of four windows of a state."""
        now = observation(state, estimated(state, _N_AFTER, self.random, noise=_NOISE))
        return matched_surely(self.reference, self.reference.mean_of(now.modes))

    def bodies(self, n: int, lightest: float = 0.005) -> Iterator[tuple[FloatArray, ModalMean]]:
        """Return positions (3,) of bodies of up to 4 % of the mass, clamped off a bar's axis, and their events."""
        total = build_model(self.reference.structure).total_mass()
        for _ in range(n):
            bar, s = somewhere(self.state, self.random, lowest=0.3)
            mass, length = total * log_uniform(self.random, lightest, _HEAVIEST), self.state.scale.length
            beside = np.arange(3) != self.state.frame.bar(bar).axis
            lump = Lump(
                bar=bar,
                s=s,
                mass=mass,
                offset=vector(length * beside * self.random.uniform(-0.025, 0.025, 3)),
                inertia=vector(mass * (length * self.random.uniform(0.005, 0.02, 3)) ** 2),
            )
            yield np.array(self.state.frame.bar(bar).point(s)), self.event(with_lump(self.state, lump))


def structure_named(frame: str) -> Structure:
    """Return the structure as the user describes it."""
    return FRAME if frame == "T-frame" else parse_structure(DESIGNS[frame].toml())


def specimen(frame: str, seed: int) -> Specimen:
    """Draw a frame and learn its reference."""
    return specimen_of(draw_state(seed) if frame == "T-frame" else DESIGNS[frame].draw(seed), frame, seed)


def specimen_of(state: State, frame: str, seed: int) -> Specimen:
    """Learn the reference of a frame that was drawn."""
    random = np.random.default_rng((seed, 99))
    before = observation(state, estimated(state, _N_BEFORE, random, noise=_NOISE))
    reference = learn_reference(structure_named(frame), before.estimates, before.tracks, before.lateness.delays)
    return Specimen(state=state, reference=reference, random=random)
