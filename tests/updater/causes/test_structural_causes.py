"""Mass along a stretch, axial force and a prop, in truths that differ from the reference in kind."""

import numpy as np
import pytest

from tests.examiner.designs import DESIGNS
from tests.support.thorough import few_of
from tests.support.updater.frames import ALL, beam
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, Cause, build_model, diagnose, learn_reference, matched, parse_structure, stack_tracks
from updater.causes.stiffness.axial_force import usual_forces
from updater.structure import Member, Support

TRACK = np.arange(8)
WEIGHT = 9.81 * 2.0  # N, of a beam of 2 m with unit density and area


def found(seed: int, **change: object) -> Cause:
    """The one cause that is found in the true frame with some of its entries changed."""
    print(f"seed {seed}")
    random = np.random.default_rng(seed)
    gain = 1 + 0.005 * random.standard_normal(12)
    bare = true_model(np.random.default_rng((seed, 1)))
    reference = learn_reference(t_frame(), [measure(bare, random, gain) for _ in range(8)], [TRACK] * 8)
    structure = bare.structure.model_copy(update=change)
    if "support" in change:
        structure = structure.model_copy(update={"support": (*bare.structure.support, *structure.support)})
    model = build_model(structure, shear_flexible=True, mass="consistent")
    windows = [measure(model, random, gain) for _ in range(5)]
    event = matched(reference.baseline, reference.mean_of(stack_tracks(windows, [TRACK] * 5)))
    diagnosis = diagnose(reference, event).diagnosis
    assert diagnosis.verdict == "explained"
    (cause,) = diagnosis.causes
    return cause


def off(cause: Cause, place: tuple[float, float, float]) -> float:
    """Distance of a cause's middle from a position in its deviations."""
    assert cause.where is not None
    assert cause.where.position is not None
    assert cause.where.position_std is not None
    return float(np.linalg.norm(np.subtract(cause.where.position, place))) / cause.where.position_std


@pytest.mark.thorough
def test_snow_on_the_crossbeam_is_diagnosed_as_distributed_mass() -> None:
    """0.4 kg in beads a centimetre apart over half of it; 4 deviations."""
    beads = tuple(Body(at=(x, 0, 1.48), mass=0.01) for x in np.linspace(-0.195, 0.195, 40))
    cause = found(191, body=beads)
    assert cause.cause == "distributed_mass"
    assert off(cause, (0, 0, 1.48)) < 4
    mass, extent = cause.parameters["mass"], cause.parameters["extent"]
    assert abs(mass.value - 0.4) < 4 * mass.std
    assert abs(extent.value - 0.4) < 4 * extent.std


@pytest.mark.parametrize(("seed", "force"), few_of([(192, -1500.0), (193, 1000.0)]))
def test_axial_force_of_the_column_is_found(seed: int, force: float) -> None:
    """7 and 5 % of its buckling load, with preload in elements of 1 cm; 4 deviations."""
    members = tuple(m.model_copy(update={"preload": force}) if m.name == "column" else m for m in true_members())
    cause = found(seed, member=members)
    assert cause.cause == "axial_force"
    assert cause.where is not None
    assert cause.where.member == "column"
    assert abs(cause.parameters["force"].value - force) < 4 * cause.parameters["force"].std


def true_members() -> tuple[Member, ...]:
    return true_model(np.random.default_rng(0)).structure.member


@pytest.mark.parametrize(
    ("seed", "at", "axis", "stiffness"), few_of([(194, (0, 0, 0.9), "y", 8e3), (195, (0.3, 0, 1.48), "z", 2e4)])
)
def test_added_prop_is_found_with_its_stiffness(
    seed: int, at: tuple[float, float, float], axis: str, stiffness: float
) -> None:
    """A spring at a node of the truth's mesh; 4 deviations."""
    spring = Support.model_validate({"at": at, "stiffness": {axis: stiffness}})
    cause = found(seed, support=(spring,))
    assert cause.cause == "support_spring"
    assert off(cause, at) < 4
    quantity = cause.parameters[f"stiffness_{axis}"]
    assert abs(quantity.value - stiffness) < 4 * quantity.std


def test_misfit_of_a_clamped_beam_causes_its_whole_force() -> None:
    """A strain e between two abutments is the force e E A; the prior of e is 2e-4."""
    clamped = tuple(Support(at=(x, 0, 0), fixed=ALL) for x in (0.0, 2.0))
    structure = beam(length=2.0, elements=4, support=clamped, modulus=1e6, shear_modulus=4e5)
    assert usual_forces(build_model(structure)) == pytest.approx(np.hypot(WEIGHT, 2e-4 * 1e6), rel=1e-6)


def test_beam_that_is_free_to_slide_has_a_force_of_its_weight_only() -> None:
    supports = (Support(at=(0, 0, 0), fixed=ALL), Support(at=(2, 0, 0), fixed=ALL[1:]))
    structure = beam(length=2.0, elements=4, support=supports, modulus=1e6, shear_modulus=4e5)
    assert usual_forces(build_model(structure)) == pytest.approx(WEIGHT, rel=1e-6)


def test_stated_preload_is_uncertain_by_a_share_of_it() -> None:
    structure = beam(length=2.0, elements=4, support=(Support(at=(0, 0, 0), fixed=ALL),), modulus=1e6)
    (member,) = structure.member
    loaded = structure.model_copy(update={"member": (member.model_copy(update={"preload": 100.0}),)})
    assert usual_forces(build_model(loaded)) == pytest.approx(np.hypot(WEIGHT, 0.3 * 100.0), rel=1e-6)


def test_beam_of_a_portal_is_hardly_restrained_by_its_posts() -> None:
    """Posts that bend hold a thousandth of e E A, 17 kN: less than the weight, 340 N, adds to it."""
    model = build_model(parse_structure(DESIGNS["portal"].toml()))
    print(usual_forces(model), 9.81 * model.total_mass())
    assert usual_forces(model) == pytest.approx(9.81 * model.total_mass(), rel=0.05)
