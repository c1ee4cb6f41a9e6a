"""A frame of two storeys on flat posts, 40 times as stiff about one axis as about the other, with feet that yield."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from tests.examiner.cases import N_AFTER
from tests.examiner.design import Design, Section
from tests.examiner.designs import steel_bar
from tests.examiner.models.frame import Ground, Lump, Meeting
from tests.examiner.path import observation
from tests.examiner.signals import estimated
from tests.support.thorough import few_of
from updater import parse_structure

_WIDTH, _THICKNESS, _HEIGHT, _SPAN = 0.05, 0.008, 1.0, 0.6  # m
_STRONG, _WEAK = _THICKNESS * _WIDTH**3 / 12, _WIDTH * _THICKNESS**3 / 12
_BEAM = Section(area=5.6e-4, second_moment=(1.4e-7, 2.6e-7), torsion_constant=2.8e-7, shear_factor=0.44)
_POST = Section(
    area=_WIDTH * _THICKNESS,
    second_moment=(_STRONG, _WEAK),  # about x and y: weak in the plane of the frame
    torsion_constant=_WIDTH * _THICKNESS**3 / 3 * (1 - 0.63 * _THICKNESS / _WIDTH),
    shear_factor=5 / 6,
)


def _design() -> Design:
    sides = (("left", 0.0), ("right", _SPAN))
    levels = (("lower", _HEIGHT / 2), ("upper", _HEIGHT))
    return Design(
        name="flat",
        bars=(
            *(steel_bar(side, (x, 0.0, 0.0), 2, _HEIGHT, _POST, 0.05) for side, x in sides),
            *(steel_bar(level, (0.0, 0.0, z), 0, _SPAN, _BEAM, 0.05) for level, z in levels),
        ),
        grounds=tuple(Ground(bar=side, s=0.0, about=(np.inf,) * 3) for side, _ in sides),
        meetings=tuple(Meeting(bar=side, s=z, other=level, t=x) for side, x in sides for level, z in levels),
        devices=(
            *(("left", z, f"left_{level}", "xy") for level, z in levels),
            *(("right", z, f"right_{level}", "y") for level, z in levels),
            ("right", _HEIGHT / 4, "right_low", "x"),
        ),
        bodies=tuple(
            Lump(bar=level, s=s, mass=1.0, offset=(0.0, 0.0, 0.03)) for level, _ in levels for s in (0.15, 0.45)
        ),
        band=150.0,
        window=300.0,
        element=0.05,
    )


@pytest.mark.parametrize(("seed", "only"), few_of([(1, ("model_parameters",)), (1, ()), (2, ())]))
def test_feet_of_flat_posts_are_found_yielding_about_both_axes(seed: int, only: tuple[str, ...]) -> None:
    """Both have the same share of the post's own stiffness: the spring is 8 E I / L about either axis.

    Young's modulus over density is within three deviations of the truth, and so are the flexibilities of four springs.
    """
    print(f"seed {seed}")
    design = _design()
    state = design.draw(seed)
    yielding = {"rx": 8 * 210e9 * _STRONG / _HEIGHT, "ry": 8 * 210e9 * _WEAK / _HEIGHT}
    about = (yielding["rx"], yielding["ry"], np.inf)
    grounds = tuple(replace(ground, about=about) for ground in state.frame.grounds)
    real = state.of_frame(replace(state.frame, grounds=grounds, lumps=design.bodies))  # without masses of sensors
    random = np.random.default_rng((seed, 6))
    windows = [estimated(real, 1, random, first=w, noise="law")[0] for w in range(N_AFTER)]
    found = explain(parse_structure(design.toml()), None, observation(real, windows), None, only=only).diagnosis
    print(found.verdict, {c.name: f"{c.after:.4g} +- {c.std:.2g}" for cause in found.causes for c in cause.changes})
    assert found.verdict == "explained"
    (cause,) = found.causes
    assert cause.cause == "model_parameters"
    post = state.frame.bar("left")
    stiffness = post.modulus / post.density / (210e9 / 7850)
    modulus = cause.parameters.get("steel.E")
    if modulus:
        assert abs(modulus.value / 210e9 - stiffness) < 3 * modulus.std / 210e9
    for axis, truth in yielding.items():
        for foot in (0, 1):
            spring = cause.parameters[f"support {foot}.{axis}"]
            flexibility, std = 1 / spring.value, spring.std / spring.value**2
            assert abs(flexibility - 1 / truth) < 3 * std
