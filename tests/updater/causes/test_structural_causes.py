"""Mass along a stretch, axial force and a prop, in truths that differ from the reference in kind."""

import numpy as np
import pytest

from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, Cause, build_model, diagnose, learn_reference, matched, stack_tracks
from updater.structure import Member, Support

TRACK = np.arange(8)


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
