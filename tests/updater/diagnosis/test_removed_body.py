"""Bodies of negative mass, which were taken off: modes, the extended model and all that is made of it."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.optimize import brentq

from daq import FloatArray
from monitor.analysis.explanation import explain
from monitor.results.correlation import discrepancy_result
from monitor.text.sensors import health_result
from tests.examiner.models.frame import Lump
from tests.examiner.models.specimen import FrameBody, draw_state
from tests.examiner.path import FRAME, observation
from tests.examiner.signals import estimated
from tests.support.thorough import few_of
from tests.support.updater.frames import beam, clamped, t_frame
from updater import Body, ModelError, StructureError, build_model, dump_structure, parse_structure, t_structure_toml


def _with_tip_mass(share: float, highest: float) -> FloatArray:
    """Return the roots of a cantilever's frequency equation with a tip mass of that share of the beam's.

    1 + cos x cosh x + share x (cos x sinh x - sin x cosh x) = 0 (Blevins 1979, table 8-8), divided by cosh x.
    """

    def equation(x: float) -> float:
        return float(1 / np.cosh(x) + np.cos(x) + share * x * (np.cos(x) * np.tanh(x) - np.sin(x)))

    grid = np.linspace(0.5, highest, 1000)
    signs = np.sign([equation(x) for x in grid])
    return np.array([brentq(equation, grid[i], grid[i + 1]) for i in np.flatnonzero(signs[:-1] != signs[1:])])


@pytest.mark.parametrize("share", [-0.05, -0.1, -0.2])
def test_cantilever_modes_with_removed_tip_mass_match_closed_form(share: float) -> None:
    """The mass exceeds that of an element by 2 to 8 times: the consistent mass matrix is indefinite."""
    elements = 40
    structure = beam(length=1.0, elements=elements, support=clamped()).with_bodies([Body(at=(1, 0, 0), mass=share)])
    model = build_model(structure, mass="consistent")
    assert np.linalg.eigvalsh(model.mass.toarray())[0] < 0
    roots = _with_tip_mass(share, 10.0)
    exact = np.sort(np.r_[roots**2 * 1e-9**0.5, roots**2 * 4e-9**0.5])[:5] / (2 * np.pi)
    modes = model.modes(5)
    np.testing.assert_allclose(modes.frequency, exact, rtol=(roots[2] / elements) ** 4 / 700)
    np.testing.assert_allclose(modes.shape.T @ (model.mass @ modes.shape), np.eye(5), atol=1e-9)


@pytest.mark.parametrize("elements", [4, 30], ids=["all of the matrix", "its lowest modes"])
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_too_heavy_removed_body_is_refused_with_its_position(
    elements: int, mass: Literal["consistent", "lumped"]
) -> None:
    bodies = [Body(at=(0.5, 0, 0), mass=-0.02), Body(at=(1, 0, 0), mass=-0.5)]
    structure = beam(length=1.0, elements=elements, support=clamped()).with_bodies(bodies)
    with pytest.raises(ModelError, match=r"body at \[1.0, 0.0, 0.0\]: its mass of -0.5 kg"):
        build_model(structure, mass=mass).modes(5)


def test_file_with_bodies_that_leave_no_mass_is_refused() -> None:
    text = f"{t_structure_toml()}\n[[body]]\nat = [-0.2, 0.0, 1.48]\nmass = -1000\n"
    with pytest.raises(StructureError, match=r"t\.toml: .*body at \[-0\.2, 0\.0, 1\.48\]: mass: expected more than -7"):
        parse_structure(text, "t.toml")


@pytest.mark.parametrize(
    ("seed", "s", "mass_on", "only"),
    few_of([(2, 0.05, 0.45, ("added_mass", "joint_stiffness")), (1, 0.2, 0.2, ())], 0),
)
def test_removed_body_is_diagnosed_and_written_to_the_extended_model(
    seed: int, s: float, mass_on: float, only: tuple[str, ...]
) -> None:
    """A body on the crossbeam, whose elements weigh 165 g each, during the reference; then it is removed."""
    bare = draw_state(seed)
    lump = Lump(bar="crossbeam", s=s, mass=mass_on, offset=(0.0, 0.03, 0.04), inertia=(8e-5, 8e-5, 8e-5))
    loaded = bare.of_body(FrameBody(replace(bare.frame, lumps=(*bare.frame.lumps, lump))))
    random = np.random.default_rng(seed)
    print(f"seed {seed}")
    before, now, heldout = (
        observation(state, estimated(state, n, random, noise="law")) for state, n in ((loaded, 8), (bare, 5), (bare, 5))
    )
    found = explain(FRAME, before, now, heldout, only=only)
    (cause,) = found.explained.diagnosis.causes
    print(cause)
    assert cause.cause == "added_mass"
    assert cause.where is not None
    assert cause.where.position is not None
    assert cause.where.position_std is not None
    assert cause.where.position_std < 0.02
    assert abs(cause.where.position[0] - (s - 0.4)) < 3 * cause.where.position_std
    mass = cause.parameters["mass"]
    assert abs(mass.value + mass_on) < 3 * mass.std
    assert found.explained.extended is not None
    health = found.health
    np.testing.assert_allclose(health.gain, 1.0, atol=0.03)
    shown = discrepancy_result(found.reference, found.measured, found.explained, None, (), health_result(health))
    assert sum(m.off_percent_after is not None for m in shown.modes) >= 5
    gain = found.explained.diagnosis.gain
    print(gain)
    assert gain is not None
    assert gain.change_error_percent is not None
    without, by_change, by_file = (
        e or np.inf
        for e in (
            gain.frequency_error_percent.before,
            gain.change_error_percent.after,
            gain.frequency_error_percent.after,
        )
    )
    assert by_change < 0.15  # rms of the changes, which are 0.3 to 3.5 %
    assert by_file < min(without, 0.2)  # what a beam model is taken to be wrong by
    # the file that is written serves as a model: fresh windows with the body on again
    written = parse_structure(dump_structure(found.explained.extended))
    fresh = [observation(state, estimated(state, 6, random, noise="law")) for state in (bare, loaded)]
    again = explain(written, fresh[0], fresh[1], only=only)
    (back,) = again.explained.diagnosis.causes
    print(back)
    assert back.cause == "added_mass"
    assert back.parameters["mass"].value > 0
    np.testing.assert_allclose(again.health.gain, 1.0, atol=0.03)


def test_equal_added_and_removed_bodies_leave_the_modes_unchanged() -> None:
    """A body of +200 g and one of -200 g 1 mm away from it: 1 mm of a couple remains."""
    frame = t_frame()
    pair = [Body(at=(x, 0, 1.48), mass=m, offset=(0, 0.03, 0.04)) for x, m in ((-0.2, 0.2), (-0.199, -0.2))]
    bare, both = (build_model(s, shear_flexible=True, mass="consistent") for s in (frame, frame.with_bodies(pair)))
    np.testing.assert_allclose(both.modes(8).frequency, bare.modes(8).frequency, rtol=5e-4)


@pytest.mark.parametrize(("seed", "mass", "s"), few_of([(705, 0.63, 0.45), (701, 0.63, 0.59), (703, 0.66, 0.23)], n=0))
def test_large_removed_body_is_explained_and_absent_from_extended_file(seed: int, mass: float, s: float) -> None:
    """The calibration had made up for a fourth of a mode's mass by stiffness: nothing fitted before."""
    print(f"seed {seed}")
    bare, random = draw_state(seed), np.random.default_rng((seed, 8))
    lump = Lump(bar="crossbeam", s=s, mass=mass, offset=(0.0, 0.03, 0.04), inertia=(8e-5, 8e-5, 8e-5))
    loaded = bare.of_body(FrameBody(replace(bare.frame, lumps=(*bare.frame.lumps, lump))))
    before, now = (
        observation(state, estimated(state, n, random, noise="law")) for state, n in ((loaded, 8), (bare, 5))
    )
    found = explain(FRAME, before, now, only=("added_mass",)).explained
    (cause,) = found.diagnosis.causes
    print(cause.where, cause.parameters, found.diagnosis.gain)
    assert cause.where is not None
    assert cause.where.position is not None
    assert abs(cause.where.position[0] - (s - 0.4)) < 0.02
    removed = cause.parameters["mass"]
    assert abs(removed.value + mass) < 3 * removed.std
    assert removed.std < 0.1 * mass
    assert found.extended is not None
    assert found.extended.body == FRAME.body
    assert found.diagnosis.gain is not None
    left = found.diagnosis.gain.frequency_error_percent.after
    assert left is not None
    assert left < 0.5
