"""Parameters fitted to structures that bear a body which their file lacks: their deviations, and the body."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from monitor.analysis.explanation import explain, reference_of
from tests.examiner.design import Design
from tests.examiner.designs import DESIGNS, steel_bar, thin_box
from tests.examiner.draws import log_uniform, somewhere, with_lump
from tests.examiner.models.bar import vector
from tests.examiner.models.frame import Ground, Lump, Meeting
from tests.examiner.models.specimen import State, draw_state
from tests.examiner.path import observation, structure_of
from tests.examiner.signals import estimated
from tests.support.thorough import few_of
from updater import parse_structure

SMALLEST, LARGEST = 0.002, 0.05  # of the mass of the structure
RATE, RARELY = 0.954, 1e-3  # of a Gaussian within two deviations; probability of a smaller number
FEET = (1.5e5, 2.2e5), (1.7e5, 2.6e5)  # N m/rad, about x and y: 2.6 and 1.8 times as flexible as the end of a post
_POST, _BEAM = thin_box(0.08, 0.08, 0.004), thin_box(0.06, 0.10, 0.004)
_PLACES = (("left", 1.4, "a", "xy"), ("right", 1.6, "b", "xy"), ("beam", 0.8, "c", "yz"), ("beam", 2.0, "d", "yz"))
SOFT = Design(
    name="soft",
    bars=(
        steel_bar("left", (0.0, 0.0, 0.0), 2, 2.4, _POST, 0.08),
        steel_bar("beam", (0.0, 0.0, 2.4), 0, 3.2, _BEAM, 0.08),
        steel_bar("right", (3.2, 0.0, 0.0), 2, 2.4, _POST, 0.08),
    ),
    grounds=tuple(Ground(bar=bar, s=0.0, about=(np.inf,) * 3) for bar in ("left", "right")),
    meetings=(Meeting(bar="left", s=2.4, other="beam", t=0.0), Meeting(bar="right", s=2.4, other="beam", t=3.2)),
    devices=(*_PLACES, ("right", 2.4, "e", "x")),
    bodies=tuple(Lump(bar=bar, s=s, mass=0.12) for bar, s, *_ in (*_PLACES, ("right", 2.4))),
    band=80.0,
    window=120.0,
    element=0.16,
)


def with_body(state: State, random: np.random.Generator, share: float) -> tuple[State, Lump]:
    """Return a specimen with a body of a share of the mass of its bars, and the body."""
    total = sum(bar.density * bar.area * bar.length for bar in state.frame.bars)
    bar, s = somewhere(state, random, lowest=0.3)
    body = Lump(bar=bar, s=s, mass=share * total, inertia=vector(share * total * np.full(3, 1e-4)))
    return with_lump(state, body), body


@pytest.mark.parametrize(("seed", "draws"), few_of([(71, 1), (71, 4)]))
def test_deviations_of_a_calibration_contain_a_body_that_the_file_lacks(seed: int, draws: int) -> None:
    """Young's modulus at the density of the file: as many draws within two deviations as of Gaussian errors."""
    inside = []
    for number, which in enumerate(draws * ("portal", "mast", "frame")):
        random = np.random.default_rng((seed, number))
        drawn = draw_state(seed + number) if which == "frame" else DESIGNS[which].draw(seed + number)
        state, _ = with_body(drawn, random, log_uniform(random, SMALLEST, LARGEST))
        structure = structure_of(f"built {which}: nothing")
        calibration = reference_of(structure, observation(state, estimated(state, 5, random, noise="law"))).calibration
        (found,) = (change for change in calibration.changes() if change.name == "steel.E")
        bar = state.frame.bars[0]
        true = bar.modulus * structure.material["steel"].density / bar.density
        inside.append(abs(found.after - true) < 2 * found.std)
        print(f"seed {seed + number} {which}: {found.after:.4g} ± {found.std:.2g} Pa, true {true:.4g}")
    assert sum(inside) >= binom.ppf(RARELY, len(inside), RATE)


@pytest.mark.thorough
@pytest.mark.parametrize("seeds", [(81, 82)])
def test_feet_that_the_file_has_rigid_are_within_their_deviations_and_a_box_is_named(seeds: tuple[int, ...]) -> None:
    """A box of 1.4 kg on a portal of 74 kg with soft feet: it is named at its place, or contained in the deviations."""
    named = []
    for seed in seeds:
        drawn, box = SOFT.draw(seed), Lump(bar="beam", s=2.6, mass=1.4, offset=(0.0, 0.03, 0.06))
        grounds = zip(drawn.frame.grounds, FEET, strict=True)
        soft = tuple(replace(ground, about=(*about, 3e5)) for ground, about in grounds)
        state = drawn.of_frame(replace(drawn.frame, grounds=soft, lumps=(*SOFT.bodies, box)))
        windows = estimated(state, 5, np.random.default_rng(seed), noise="law")
        causes = explain(parse_structure(SOFT.toml()), None, observation(state, windows)).diagnosis.causes
        print(
            f"seed {seed}: {[(cause.cause, cause.probability, cause.where, cause.parameters) for cause in causes[1:]]}"
        )
        feet = [cause for cause in causes if cause.cause == "support_stiffness"]
        assert len(feet) == len(FEET)
        for foot in feet:
            assert foot.where is not None
            assert foot.where.position is not None
            for name, true in zip(("stiffness_rx", "stiffness_ry"), FEET[foot.where.position[0] > 0], strict=True):
                found = foot.parameters[name]
                assert abs(1 / found.value - 1 / true) < 3 * found.std / found.value**2
            assert all(change.before is None for change in foot.changes)
        assert {change.name for foot in feet for change in foot.changes}.isdisjoint(causes[0].parameters)
        for body in (cause for cause in causes if cause.cause == "added_mass"):
            mass, where = body.parameters["mass"], body.where
            assert abs(mass.value - box.mass) < 3 * mass.std
            assert where is not None
            assert where.position is not None
            assert where.position_std is not None
            assert np.linalg.norm(np.subtract(where.position, (box.s, 0, 2.4))) < 3 * where.position_std
            named.append(seed)
    assert named
