"""One to three masses on a frame of the examiner's, whose number `locate_masses` must find."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray
from monitor.analysis.observation import Observation
from tests.examiner.draws import log_uniform, somewhere, with_lump
from tests.examiner.models.frame import Lump
from tests.examiner.models.specimen import State, draw_state
from tests.examiner.path import FRAME, observation
from tests.examiner.signals import estimated
from updater import ModalMean, Reference, learn_reference, matched

SHARES = (0.01, 0.04)  # of the structure's mass, each body
APART = 0.2  # of the longest member, between bodies
N_BEFORE, N_AFTER = 8, 5  # windows
_FRAME_MASS = 7.5  # kg


@dataclass(frozen=True, eq=False)
class Loaded:
    """A reference without masses, and an event with them."""

    reference: Reference
    event: ModalMean


def frame_with_masses(number: int, noise: str, random: np.random.Generator) -> Loaded:
    """Draw a frame and masses on it; return the measured modes before and after.

    Parameters
    ----------
    number : of masses
    noise : as in `tests.examiner.signals`
    random : draws frame, masses and noise
    """
    bare = draw_state(int(random.integers(1 << 30)))
    loaded, places = bare, list[FloatArray]()
    while len(places) < number:
        bar, s = somewhere(bare, random, lowest=0.3)
        at = np.array(bare.frame.bar(bar).point(s))
        if all(np.linalg.norm(at - other) > APART * bare.scale.length for other in places):
            places.append(at)
            loaded = with_lump(loaded, Lump(bar=bar, s=s, mass=_FRAME_MASS * log_uniform(random, *SHARES)))
    before, after = (_windows(s, n, random, noise) for s, n in ((bare, N_BEFORE), (loaded, N_AFTER)))
    reference = learn_reference(FRAME, before.estimates, before.tracks)
    return Loaded(reference, matched(reference.baseline, reference.mean_of(after.modes)))


def _windows(state: State, n: int, random: np.random.Generator, noise: str) -> Observation:
    return observation(state, estimated(state, n, random, noise=noise))
