"""Usual axial forces that a structure file lacks."""

import numpy as np
import pytest

from tests.examiner.designs import DESIGNS
from tests.support.updater.frames import ALL, beam
from updater import build_model, parse_structure
from updater.causes.stiffness.axial_force import usual_forces
from updater.structure import Support

WEIGHT = 9.81 * 2.0  # N, of a beam of 2 m with unit density and area


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
