"""Bodies by which modes of a portal cross and mix: a mode divided between two, of which either may be paired with it.

Modes are of Bernoulli elements of their own (`tests.support.portals.tube_portal`), with noise and gains 0.5 % off.
"""

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from tests.support.portals.measured_modes import N_MODES, observed
from tests.support.portals.tube_portal import DENSITY, LEFT, Load, Portal
from tests.support.thorough import few_of


def drawn(seed: int) -> tuple[Portal, Load]:
    """Return a portal and a body of 3 to 40 % of its mass, 2 cm off the axis."""
    random = np.random.default_rng((seed, 77))
    low, high = np.array([0.012, 0.012, 0.001, 0.6, 0.6]), np.array([0.02, 0.02, 0.0015, 1.0, 1.4])
    portal = Portal(*random.uniform(low, high).tolist())
    whole = (2 * portal.height + portal.width) * portal.section[0] * DENSITY
    member = ("left", "right", "beam")[random.integers(3)]
    share = random.uniform(0.08, 0.92) if member == "beam" else random.uniform(0.3, 0.95)
    mass = whole * np.exp(random.uniform(np.log(0.03), np.log(0.4)))
    x, y, z = (0.02 * random.standard_normal(3)).tolist()
    return portal, Load(member, float(share), float(mass), (x, y, z))


@pytest.mark.parametrize(("seed", "only"), few_of([(3, ("added_mass",)), (3, ()), (57, ()), (76, ())]))
def test_body_is_found_where_a_mode_divides(seed: int, only: tuple[str, ...]) -> None:
    """Mass within three deviations, place within 10 cm.

    Some pairs of measured modes are not of the largest share, here and in seeds 5, 20, 23, 34, 46, 49 and 63. Seeds 23
    and 46 are not right: bodies of 27 and 35 % of the portal. Seed 34 leaves a second place open.
    """
    portal, load = drawn(seed)
    bare, before, _ = portal.modes(LEFT)
    frequency, after, share, place = portal.loaded(load)
    largest = np.sort(share[:N_MODES], axis=1)
    assert (largest[:, -2] > 0.4 * largest[:, -1]).any()  # a mode divides
    random = np.random.default_rng((seed, 78))
    gain = 1 + 0.005 * random.standard_normal(len(before))[:, None]
    baseline, now = (
        observed(portal, f, gain * shape, first, random)
        for f, shape, first in ((bare, before, 0), (frequency, after, 20))
    )
    found = explain(portal.file(), baseline, now, only=only).diagnosis
    print(seed, load, found)
    assert found.verdict == "explained"
    (cause,) = found.causes
    assert cause.cause == "added_mass"
    assert cause.where
    assert cause.where.position
    assert np.linalg.norm(np.subtract(cause.where.position, place)) < 0.1
    mass = cause.parameters["mass"]
    assert abs(mass.value - load.mass) < 3 * mass.std
