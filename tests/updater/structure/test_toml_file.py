"""The structure file: content that it must not have, and its round trip."""

import re
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

from tests.support.updater.frames import COLUMN_CRACK, t_frame
from updater import (
    Body,
    ModelError,
    Structure,
    StructureError,
    build_model,
    dump_structure,
    load_structure,
    parse_structure,
    t_structure_toml,
)
from updater.structure import Joint, Material, Member, Section, Segment, Sensor, Support

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("old", "new", "entry"),
    [
        ("density = 7850", "density = inf", "material.steel.density"),
        ("density = 7850", "density = nan", "material.steel.density"),
        ("density = 7850", 'density = "heavy"', "material.steel.density"),
        ("density = 7850", "densty = 7850", "material.steel.dens"),
        ('section = "tube_40x40x3"', 'section = "pipe"', "member column: section 'pipe'"),
        ("to = [0.0, 0.0, 1.48]", "to = [0.0, 0.0, 0.0]", "member.0 of column: ends where it begins"),
        ("to = [0.0, 0.0, 1.48]", "to = [0.0, 1.48]", "member.0.to"),
        ('name = "crossbeam"', 'name = "column"', "'column' is given twice"),
        ("direction = [1, 0, 0]", "direction = [0, 0, 0]", "of col_037_x: the direction is zero"),
        ("at = [0.0, 0.0, 0.37]", "at = [0.01, 0.0, 0.37]", "sensor col_037_x: [0.01, 0.0, 0.37] lies on no member"),
        ("[[support]]\nat = [0.0, 0.0, 0.0]", "[[support]]\nat = [0.0, 0.1, 0.0]", "support: [0.0, 0.1, 0.0] lies on"),
        (
            "[[support]]",
            "[[body]]\nat = [9.0, 0.0, 0.0]\nmass = 1.0\n\n[[support]]",
            "body: [9.0, 0.0, 0.0] lies on no member",
        ),
        (
            "[[support]]",
            '[[joint]]\nmember = "crossbeam"\nat = [0.0, 0.0, 0.5]\nstiffness = {rx = 1.0}\n\n[[support]]',
            "joint of crossbeam: [0.0, 0.0, 0.5] does not lie on it",
        ),
        (
            "[[support]]",
            '[[joint]]\nmember = "beam"\nat = [0.0, 0.0, 1.48]\nstiffness = {rx = 1.0}\n\n[[support]]',
            "member 'beam' is not defined; there are ['column', 'crossbeam']",
        ),
        (
            "[[support]]",
            '[[joint]]\nmember = "crossbeam"\nat = [0.2, 0.0, 1.48]\nstiffness = {rx = 1.0}\n\n[[support]]',
            "joint of crossbeam: no other member and no support is at [0.2, 0.0, 1.48]",
        ),
        ("elements = 37\n", "", "member column: elements is missing"),
        ("elements = 37", "elements = 0", "member.0.elements of column: Input should be greater"),
        ("direction = [1, 0, 0]", 'direction = "x"', "Input should be a list in brackets, found 'x'"),
        (
            "shear_modulus = 80.8e9",
            "poisson_ratio = 0.7",
            "material.steel: poisson_ratio: expected more than -1 and up",
        ),
        (
            "shear_modulus = 80.8e9",
            "shear_modulus = 80.8e9\npoisson_ratio = 0.3",
            "material.steel: expected shear_modulus or poisson_ratio, found both",
        ),
        (
            "density = 7850",
            "densty = 7850",
            "material.steel.densty: not a known key, did you mean 'density'?; known here are density, poisson_",
        ),
        (
            "[[support]]",
            "[[suport]]",
            "suport: not a known key, did you mean 'support'?; known here are body, breathing_crack, external, ground, "
            "joint, material, member",
        ),
        (
            "elements = 37",
            "element = 37",
            "member.0.element of column: not a known key, did you mean 'elements'?; known here are elements, from",
        ),
        ("density = 7850", "dens = 7850", "material.steel.dens: not a known key, did you mean 'density'?; known here"),
        ("density = 7850", "rho = 7850", "material.steel.rho: not a known key; known here are density, poisson_ratio"),
        ("[[support]]", "[mesh]\nelement_length = 0.0\n\n[[support]]", "mesh.element_length: Input should be greater"),
        (
            'fixed = ["x", "y", "z", "rx", "ry", "rz"]',
            'fixed = ["x", "y", "z"]\nstiffness = {z = 1.0, rx = 1.0}',
            "support at [0.0, 0.0, 0.0]: z is both fixed and on a spring",
        ),
        (
            "[[support]]",
            "[[body]]\nat = [0.0, 0.0, 1.0]\nmass = -1.0\ninertia = [1e-3, 0.0, 0.0]\n\n[[support]]",
            "body at [0.0, 0.0, 1.0]: inertia [0.001, 0.0, 0.0] is not of the sign of its mass -1.0",
        ),
    ],
)
def test_invalid_entry_is_named_in_the_error(old: str, new: str, entry: str) -> None:
    text = t_structure_toml()
    assert old in text
    with pytest.raises(StructureError) as caught:
        parse_structure(text.replace(old, new, 1), "frame.toml")
    assert str(caught.value).startswith("frame.toml: ")
    assert entry in str(caught.value)


def test_structure_without_members_is_refused() -> None:
    with pytest.raises(StructureError, match=r"bare\.toml: member"):
        parse_structure('name = "bare"\nmember = []\n[material]\n[section]\n', "bare.toml")


def test_invalid_toml_is_reported_with_the_line() -> None:
    with pytest.raises(StructureError, match=r"frame\.toml: .*line 2"):
        parse_structure('name = "x"\nmember = = 1', "frame.toml")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "cannot be read: No such file or directory"),
        (b"\xff\xfe\x00", "expected a structure file, found no text"),
    ],
    ids=["missing", "not text"],
)
def test_unreadable_file_is_named_in_the_error(tmp_path: Path, content: bytes | None, reason: str) -> None:
    path = tmp_path / "frame.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(StructureError, match=rf"frame\.toml: {reason}") as caught:
        load_structure(path)
    assert caught.value.path == path


def test_dump_round_trip_is_lossless(tmp_path: Path) -> None:
    path = tmp_path / "frame.toml"
    path.write_text(t_structure_toml(), encoding="utf-8")
    read = load_structure(path)
    assert read == t_frame()
    assert Structure.model_validate(read.model_dump(by_alias=True)) == read
    assert Structure.model_validate_json(read.model_dump_json(by_alias=True)) == read


def test_example_and_its_page_contain_every_key() -> None:
    """The commented example uses, and the page names, each key that a file may have."""
    text = (ROOT / "examples" / "portal_frame.toml").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "howto" / "model" / "structure.md").read_text(encoding="utf-8")
    portal = load_structure(ROOT / "examples" / "portal_frame.toml")
    entries: dict[str, type[BaseModel]] = {
        "material": Material, "section": Section, "member": Member, "support": Support, "joint": Joint,
        "segment": Segment, "body": Body, "sensor": Sensor,
    }  # fmt: skip
    keys = {key for entry in entries.values() for key in _keys(entry)} | set(entries) | {"mesh", "element_length"}
    assert [key for key in sorted(keys) if f"`{key}`" not in page and f"[{key}" not in page] == []
    assert [key for key in sorted(keys) if key not in text] == []
    # 8.1 kg/m of IPE 100, 4.25 of 60 x 40 x 3 and 1.08 of 21.3 x 2.3 by their tables, the machine and half a kilogram
    tabulated = 4.0 * 8.1 + 3.0 * 4.25 + np.hypot(0.8, 0.8) * 1.08 + 40.0 + 0.5
    assert build_model(portal).total_mass() == pytest.approx(tabulated, rel=1e-3)


def _keys(entry: type[BaseModel]) -> list[str]:
    return [field.alias or name for name, field in entry.model_fields.items()]


def test_shipped_frame_has_the_reference_values() -> None:
    """The figures of the tested structure; changing one is a change of the reference structure."""
    frame = t_frame()
    assert [(m.name, m.start, m.end, m.elements) for m in frame.member] == [
        ("column", (0.0, 0.0, 0.0), (0.0, 0.0, 1.48), 37),
        ("crossbeam", (-0.4, 0.0, 1.48), (0.4, 0.0, 1.48), 16),
    ]
    assert frame.material["steel"].model_dump() == {
        "youngs_modulus": 210e9,
        "shear_modulus": 80.8e9,
        "density": 7850.0,
    }
    assert frame.section["tube_40x40x3"].model_dump() == {
        "area": 4.1934e-4,
        "second_moment": (9.3e-8, 9.3e-8),
        "torsion_constant": 1.58e-7,
        "shear_factor": 0.44,
        "edge": (0.02, 0.02),
        "round": False,
    }
    assert " ".join(frame.channels) == (
        "col_037_x col_037_y col_074_x col_074_y col_111_x col_111_y "
        "beam_mid_x beam_mid_y beam_left_y beam_left_z beam_right_y beam_right_z"
    )


def test_members_without_element_count_use_the_mesh_length() -> None:
    text = t_structure_toml().replace("elements = 37\n", "") + "\n[mesh]\nelement_length = 0.05\n"
    assert [m.elements for m in parse_structure(text).member] == [30, 16]  # 1.48 m / 0.05 m = 29.6; the other says it


def test_poisson_ratio_replaces_the_shear_modulus() -> None:
    steel = parse_structure(t_structure_toml().replace("shear_modulus = 80.8e9", "poisson_ratio = 0.3")).material[
        "steel"
    ]
    assert steel.shear_modulus == pytest.approx(210e9 / 2.6)


@pytest.mark.parametrize(
    ("column", "beam"), [("1.4799", "1.48"), ("1.48", "1.4802")], ids=["end short of a member", "member beside an end"]
)
def test_members_with_a_small_gap_between_them_are_refused(column: str, beam: str) -> None:
    """They would not be joined, and the crossbeam would have no support."""
    text = t_structure_toml().split("[[sensor]]")[0]
    text = text.replace("to = [0.0, 0.0, 1.48]", f"to = [0.0, 0.0, {column}]")
    text = text.replace("40, 0.0, 1.48]", f"40, 0.0, {beam}]")
    with pytest.raises(ModelError, match=r"member crossbeam: an end, support or joint at .* misses it by 0\.[12] mm"):
        build_model(parse_structure(text))


def test_two_joints_of_a_member_at_one_point_are_refused() -> None:
    with pytest.raises(StructureError, match=r"joint of b at .* is given twice"):
        _portal(_joint("b") + _joint("b"))


def test_mesh_length_is_an_upper_bound_and_changes_only_elements() -> None:
    fine = t_frame().with_mesh(0.03)
    assert [m.elements for m in fine.member] == [50, 27]
    assert fine.model_copy(update={"member": t_frame().member}) == t_frame()


def _portal(joints: str) -> Structure:
    """Two posts and a third member that all meet at one point."""
    members = "".join(
        f'[[member]]\nname = "{name}"\nfrom = [0.0, 0.0, 0.0]\nto = {to}\nmaterial = "m"\nsection = "s"\nelements = 2\n'
        for name, to in (("a", [1.0, 0.0, 0.0]), ("b", [0.0, 1.0, 0.0]), ("c", [0.0, 0.0, 1.0]))
    )
    return parse_structure(
        'name = "corner"\n[material.m]\nyoungs_modulus = 1.0\nshear_modulus = 0.4\ndensity = 1.0\n'
        "[section.s]\narea = 1.0\nsecond_moment = [0.01, 0.01]\ntorsion_constant = 0.02\n"
        f'{members}[[support]]\nat = [1.0, 0.0, 0.0]\nfixed = ["x", "y", "z", "rx", "ry", "rz"]\n{joints}'
    )


def _joint(member: str) -> str:
    return f'[[joint]]\nmember = "{member}"\nat = [0.0, 0.0, 0.0]\nstiffness = {{rx = 1e-6, ry = 1e-6, rz = 1e-6}}\n'


def test_joints_of_two_members_at_one_point_are_both_flexible() -> None:
    """Each soft joint adds its member's three slow rotations; the member below the joint stays as it was."""
    slow = [
        int((build_model(_portal(joints), mass="consistent").modes(10).frequency < 0.01).sum())
        for joints in ("", _joint("b"), _joint("c"), _joint("b") + _joint("c"))
    ]
    assert slow == [0, 3, 3, 6]


def test_frequencies_do_not_depend_on_joint_order() -> None:
    one, other = (
        build_model(_portal(_joint(first) + _joint(second)), mass="consistent").modes(8).frequency
        for first, second in (("b", "c"), ("c", "b"))
    )
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_sensor_corrections_apply_to_gain_delay_and_channel() -> None:
    """A file without them reads as before; with them, channels, gains and delays are those that logs have."""
    plain = t_frame()
    wrong = t_structure_toml() + (
        "\n[sensors.col_037_x]\ngain = 0.8\nsign = -1\ndelay = 5e-4\nchannel = 'col_037_y'\n"
        "[sensors.col_037_y]\nchannel = 'col_037_x'\n[sensors.beam_mid_y]\ngain = 0.0\n"
    )
    found = parse_structure(wrong)
    first, second = (plain.channels.index(name) for name in ("col_037_x", "col_037_y"))
    assert (found.channels[first], found.channels[second]) == ("col_037_y", "col_037_x")
    assert found.corrected_sensors[first].gain == pytest.approx(-0.8 * plain.sensor[first].gain)
    assert found.delays["col_037_y"] == 5e-4
    assert set(plain.channels) - set(found.active_channels) == {"beam_mid_y"}
    rows, expected = build_model(found).sensor_rows, build_model(plain).sensor_rows
    np.testing.assert_allclose(rows[first], -0.8 * expected[first])
    assert parse_structure(dump_structure(found)) == found


@pytest.mark.parametrize(
    ("entry", "what"),
    [
        ("[sensors.nowhere]\ngain = 1.1\n", "sensors nowhere: sensor 'nowhere' is not defined"),
        ("[sensors.col_037_x]\nchannel = 'beam_mid_y'\n", "the name 'beam_mid_y' is given twice"),
        ("[sensors.col_037_x]\nsign = 0\n", "sensors.col_037_x.sign"),
    ],
)
def test_invalid_sensor_corrections_are_refused_with_the_reason(entry: str, what: str) -> None:
    with pytest.raises(StructureError, match=re.escape(what)):
        parse_structure(t_structure_toml() + "\n" + entry)


def test_crack_is_read_and_written() -> None:
    structure = parse_structure(t_structure_toml() + COLUMN_CRACK)
    assert parse_structure(dump_structure(structure)) == structure
    added = dump_structure(structure, t_structure_toml(), note="found")
    assert added.startswith(t_structure_toml().rstrip())
    assert parse_structure(added) == structure
    assert structure.breathing_crack[0].closed == 0.0


@pytest.mark.parametrize(
    ("old", "new", "entry"),
    [
        ("mean = 0.0155", "mean = 0.06", "expected closed <= mean <= flexibility, found 0, 0.06, 0.05"),
        ('"column"', '"colum"', "member 'colum' is not defined"),
        ("0.0, 0.3]", "0.1, 0.3]", "[0.0, 0.1, 0.3] does not lie on it"),
        ('"below"', '"under"', "breathing_crack.0.opens"),
        ('"below"', '"within"', "expected a moment > 0 with opens = within, found -0.0016"),
        ('"below"', '"slips"', "expected a moment > 0 with opens = slips, found -0.0016"),
    ],
)
def test_invalid_crack_is_named(old: str, new: str, entry: str) -> None:
    with pytest.raises(StructureError) as caught:
        parse_structure(t_structure_toml() + COLUMN_CRACK.replace(old, new))
    assert entry in str(caught.value)
