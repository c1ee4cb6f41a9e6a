"""Residual forces: a change hidden in another model than the reference's appears at its place, with its sign."""

from collections.abc import Callable

import numpy as np
import pytest

from daq import FloatArray
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Body,
    ModalMean,
    Reference,
    Structure,
    build_model,
    force_balance,
    learn_reference,
    matched,
    stack_tracks,
)

TRACK = np.arange(8)
# the highest of eight modes bends the column in four half waves of 0.37 m: half of one is what can be resolved
RESOLVED = 0.185
SOFTER = 0.4
Event = Callable[[Structure], ModalMean]


def learnt(seed: int) -> tuple[Reference, Structure, Event]:
    """A reference from eight windows, the true structure, and the results of five windows of a changed one."""
    print(f"seed {seed}")
    random = np.random.default_rng(seed)
    gain: FloatArray = 1 + 0.005 * random.standard_normal(12)
    bare = true_model(np.random.default_rng((seed, 1)))
    reference = learn_reference(t_frame(), [measure(bare, random, gain) for _ in range(8)], [TRACK] * 8)

    def event(structure: Structure) -> ModalMean:
        model = build_model(structure, shear_flexible=True, mass="consistent")
        windows = [measure(model, random, gain) for _ in range(5)]
        return matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 5)))

    return reference, bare.structure, event


def softened(structure: Structure, start: float, stop: float) -> Structure:
    """The column cut in three, the middle of softer steel."""
    steel, column = structure.material["steel"], structure.member[0]
    factors = {key: getattr(steel, key) * (1 - SOFTER) for key in ("youngs_modulus", "shear_modulus")}
    cuts = [0.0, start, stop, column.length]
    parts = [
        column.model_copy(
            update={
                "name": f"column {i}",
                "start": tuple(column.point(cuts[i]).tolist()),
                "end": tuple(column.point(cuts[i + 1]).tolist()),
                "material": ("steel", "soft", "steel")[i],
            }
        )
        for i in range(3)
    ]
    material = structure.material | {"soft": steel.model_copy(update=factors)}
    return structure.model_copy(update={"material": material, "member": (*parts, *structure.member[1:])})


@pytest.mark.parametrize("seed", few_of([301, 302]))
def test_stiffness_error_peaks_at_the_softened_stretch(seed: int) -> None:
    reference, structure, event = learnt(seed)
    start = float(np.random.default_rng((seed, 2)).uniform(0.1, 1.2))
    found = force_balance(reference, event(softened(structure, start, start + 0.1)))
    nodes = reference.model.nodes
    peak = int(np.nanargmax(found.loss))
    assert np.linalg.norm(nodes[peak] - (0, 0, start + 0.05)) < RESOLVED
    assert found.loss[peak] > 5 * found.loss_std[peak]
    assert found.log_odds < -5  # 15 to 70 in a dozen of such
    assert found.loss[peak] < SOFTER  # an average over what can be resolved


@pytest.mark.parametrize(("seed", "x"), few_of([(311, 0.06), (312, -0.21)]))
def test_mass_error_peaks_at_the_added_mass(seed: int, x: float) -> None:
    reference, structure, event = learnt(seed)
    found = force_balance(reference, event(structure.with_bodies((Body(at=(x, 0, 1.48), mass=0.2),))))
    nodes = reference.model.nodes
    peak = int(np.nanargmax(found.added))
    assert np.linalg.norm(nodes[peak] - (x, 0, 1.48)) < RESOLVED
    assert found.added[peak] > 5 * found.added_std[peak]
    assert found.log_odds > 5  # 24 to 54 in a dozen of such


def test_unchanged_structure_has_residuals_within_stated_deviations() -> None:
    """Six events of nothing: rms of z is 1 within what the windows of one baseline, common to all six, allow."""
    reference, structure, event = learnt(321)
    found = [force_balance(reference, event(structure)) for _ in range(6)]
    z = np.array([f.loss / f.loss_std for f in found]), np.array([f.added / f.added_std for f in found])
    for values in z:
        assert 0.3 < np.sqrt(np.nanmean(values**2)) < 2.0
    assert max(float(np.nanmax(np.abs(f.loss))) for f in found) < 0.01
