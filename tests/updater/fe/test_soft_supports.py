"""A freely suspended frame: soft springs replace the suspension, and everything works as on a foot."""

import numpy as np
import pytest

from tests.support.thorough import few_of
from tests.support.updater.frames import Truth, t_frame, t_truth, unmoved
from updater import Body, Structure, learn_reference, locate_mass, stack_tracks
from updater.fe import Modes
from updater.structure import Support

N_RIGID = 6


def _hung(structure: Structure, stiffness: float) -> Structure:
    """Suspend it by both arms and support its foot."""
    arms = (Support(at=(x, 0, 1.48), stiffness=dict.fromkeys(("x", "y", "z"), stiffness)) for x in (-0.3, 0.3))
    foot = Support(at=(0, 0, 0), stiffness={"x": stiffness, "y": stiffness})
    return structure.model_copy(update={"support": (*arms, foot)})


def _elastic(truth: Truth, body: Body | None = None) -> Modes:
    """Return eight modes above those in which it swings as a whole, under 2 Hz."""
    modes = truth.model(body).modes(N_RIGID + 8)
    assert modes.frequency[N_RIGID - 1] < 2 < 50 < modes.frequency[N_RIGID]
    return Modes(frequency=modes.frequency[N_RIGID:], shape=modes.shape[:, N_RIGID:])


@pytest.mark.parametrize("seed", few_of([5, 6]))
def test_mass_on_a_suspended_frame_is_located_with_unknown_springs(seed: int) -> None:
    drawn = t_truth(seed)
    truth = Truth(seed=seed, structure=_hung(drawn.structure, 70.0), gain=drawn.gain)
    rows = truth.model().sensor_rows
    baseline = truth.windows(_elastic(truth), rows, 8, seed)
    reference = learn_reference(_hung(t_frame(), 50.0), baseline, unmoved(8))
    body = Body(at=(0.25, 0, 1.48), mass=0.304)
    event = stack_tracks(truth.windows(_elastic(truth, body), rows, 4, seed + 100), unmoved(4))
    change = locate_mass(reference, reference.mean_of(event))
    assert change.member == "crossbeam"
    # 3 and 10 g are the deviations at this noise on a foot: four of them
    assert change.distance == pytest.approx(0.65, abs=0.02)
    assert change.mass == pytest.approx(0.304, abs=4 * change.mass_std)
    assert change.mass_std < 0.02
    assert np.linalg.norm(reference.frequency[:N_RIGID]) < 5  # the model has the modes that nobody measured
