"""A segment is a member cut in three, without the cuts."""

import itertools

import numpy as np
import pytest

from tests.support.updater.reference_frame import t_frame
from updater import Structure, StructureError, build_model, dump_structure, parse_structure
from updater.structure import Material, Member, Segment

STEEL = t_frame().material["steel"]


def with_segments(*segments: Segment) -> Structure:
    return Structure.model_validate(
        t_frame().model_dump(by_alias=True) | {"segment": [s.model_dump() for s in segments]}
    )


def cut_in_three(start: float, end: float, middle: Material) -> Structure:
    """The column as three members, the middle one of its own material."""
    frame = t_frame()
    column, crossbeam = frame.member
    ends = [0.0, start, end, 1.48]
    parts = [
        Member.model_validate(
            column.model_dump(by_alias=True)
            | {"name": f"part {i}", "from": (0, 0, a), "to": (0, 0, b), "elements": 20}
            | ({"material": "other"} if i == 1 else {})
        )
        for i, (a, b) in enumerate(itertools.pairwise(ends))
    ]
    material = {"steel": STEEL, "other": middle}
    return frame.model_copy(update={"member": (*parts, crossbeam), "material": material})


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_segment_equals_a_member_of_another_material(mass: str) -> None:
    """Both have the same nodes, every 20 mm."""
    other = STEEL.model_copy(
        update={
            "youngs_modulus": 0.5 * STEEL.youngs_modulus,
            "shear_modulus": 0.5 * STEEL.shear_modulus,
            "density": 2 * STEEL.density,
        }
    )
    weight = STEEL.density * t_frame().section["tube_40x40x3"].area * 0.2
    segment = Segment(member="column", at=(0, 0, 0.6), extent=0.2, stiffness=0.5, shear_stiffness=0.5, mass=weight)
    one, three = with_segments(segment).with_mesh(0.02), cut_in_three(0.5, 0.7, other).with_mesh(0.02)
    models = [build_model(s, shear_flexible=True, mass=mass) for s in (one, three)]  # type: ignore[arg-type]
    found, expected = (m.modes(12).frequency for m in models)
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    assert models[0].total_mass() == pytest.approx(models[1].total_mass(), rel=1e-12)


def test_segment_with_axis_factors_equals_a_member_of_another_section() -> None:
    """With particles, whose mass has no section; local y of the column is global y."""
    tube = t_frame().section["tube_40x40x3"]
    (y, z), j = tube.second_moment, tube.torsion_constant
    section = tube.model_copy(update={"second_moment": (0.4 * y, 0.9 * z), "torsion_constant": 0.7 * j})
    cut = cut_in_three(0.5, 0.7, STEEL)
    member = tuple(m.model_copy(update={"section": "other"}) if m.name == "part 1" else m for m in cut.member)
    three = cut.model_copy(update={"member": member, "section": {**cut.section, "other": section}})
    segment = Segment(member="column", at=(0, 0, 0.6), extent=0.2, stiffness=0.5, bending=(0.8, 1.8), torsion=1.4)
    found, expected = (
        build_model(s, shear_flexible=True, mass="lumped").modes(12).frequency
        for s in (with_segments(segment).with_mesh(0.02), three.with_mesh(0.02))
    )
    np.testing.assert_allclose(found, expected, rtol=1e-8)


@pytest.mark.parametrize("gyration", [0.0, 0.5, 2.0])
def test_rotary_inertia_of_segment_mass_follows_its_gyration(gyration: float) -> None:
    """A clamped shaft in twist, omega^2 = (pi / 2 L)^2 G J / (rho I_p + g m I_p / (A L)); as a whole it moves alike."""
    section = t_frame().section["tube_40x40x3"]
    shaft = {
        "name": "shaft",
        "from": (0, 0, 0),
        "to": (0, 0, 1),
        "material": "steel",
        "section": "tube",
        "elements": 40,
    }
    structure = Structure.model_validate(
        {
            "name": "shaft",
            "material": {"steel": STEEL},
            "section": {"tube": section},
            "member": [shaft],
            "support": [{"at": (0, 0, 0), "fixed": ["x", "y", "z", "rx", "ry", "rz"]}],
            "segment": [{"member": "shaft", "at": (0, 0, 0.5), "extent": 1.0, "mass": 4.0, "gyration": gyration}],
        }
    )
    model = build_model(parse_structure(dump_structure(structure)), shear_flexible=True, mass="consistent")
    polar = sum(section.second_moment) * (STEEL.density + gyration * 4.0 / section.area)
    twist = np.sqrt(STEEL.shear_modulus * section.torsion_constant / polar) / 4
    found = model.modes(30).frequency
    assert np.abs(found / twist - 1).min() < 1e-4  # of 40 elements, (pi / 80)^2 / 24
    assert model.total_mass() == pytest.approx(STEEL.density * section.area + 4.0)


def test_removed_segment_mass_with_too_large_gyration_is_refused() -> None:
    weight = STEEL.density * t_frame().section["tube_40x40x3"].area * 0.2
    segment = Segment(member="column", at=(0, 0, 0.6), extent=0.2, mass=-0.6 * weight, gyration=2.0)
    with pytest.raises(ValueError, match="gyration: expected less"):
        with_segments(segment)


def test_overlapping_segments_multiply_stiffness_and_add_mass() -> None:
    """Two halves over the same stretch are a quarter; ends need no node of the mesh."""
    half = Segment(member="column", at=(0, 0, 0.613), extent=0.111, stiffness=0.5, mass=0.1)
    quarter = half.model_copy(update={"stiffness": 0.25, "mass": 0.2})
    twice, once = (build_model(with_segments(*s)).modes(8).frequency for s in ((half, half), (quarter,)))
    np.testing.assert_allclose(twice, once, rtol=1e-9)


def test_segment_is_written_and_read_back() -> None:
    text = dump_structure(t_frame())
    cut = Segment(member="crossbeam", at=(0.1, 0, 1.48), extent=0.05, stiffness=0.7, bending=(0.8, 1.0), torsion=0.9)
    frame = with_segments(cut)
    written = dump_structure(frame, text, note="found")
    assert parse_structure(written) == frame
    assert "# found" in written
    assert parse_structure(dump_structure(t_frame(), written)) == t_frame()


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ('member = "mast"\nat = [0, 0, 0.5]\nextent = 0.1', "member 'mast' is not defined"),
        ('member = "column"\nat = [0, 0, 0.02]\nextent = 0.1', r"0.1 m about \[0.0, 0.0, 0.02\] are not all on it"),
        ('member = "column"\nat = [0, 0.01, 0.5]\nextent = 0.1', "not all on it"),
        ('member = "column"\nat = [0, 0, 0.5]\nextent = 0.001', "expected an extent of 0.00148 m or more, found 0.001"),
        ('member = "column"\nat = [0, 0, 0.5]\nextent = 0.1\nmass = -0.4', "no mass is left from 0.45 to 0.55 m"),
        ('member = "column"\nat = [0, 0, 0.5]\nextent = 0.1\nstiffness = 0', "greater than 0, found 0"),
        ('member = "column"\nat = [0, 0, 0.5]\nextent = 0.1\nbending = [0.5]', "segment.0.bending.1: Field required"),
    ],
)
def test_invalid_segment_is_refused_with_the_reason(entry: str, message: str) -> None:
    with pytest.raises(StructureError, match=message):
        parse_structure(f"{dump_structure(t_frame())}\n[[segment]]\n{entry}\n")
