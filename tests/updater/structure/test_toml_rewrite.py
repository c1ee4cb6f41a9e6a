"""A structure written back into its original text: unchanged parts stay to the letter."""

import difflib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.updater.frames import ALL, t_frame
from updater import Body, Structure, StructureError, dump_structure, parse_structure, t_structure_toml
from updater.structure import Correction, Joint, Section, Sensor, Support

# Ways of saying things that TOML and the structure file have: inline tables, dotted keys, shapes, a mesh, comments.
ODD = """# A bench rig.
name = "bench"   # as on the drawing
mesh = {element_length = 0.05}

# -- materials ------------
[material]
steel = {youngs_modulus = 210e9, poisson_ratio = 0.3, density = 7850.0}  # S235
alloy.youngs_modulus = 70e9
alloy.shear_modulus = 26e9
alloy.density = 2700  # from the label

[section.post]   # cold formed
shape = "box"
width = 40e-3    # m
height = 40e-3
thickness = 3e-3
corner_radius = 6e-3

[[member]]
name = "post"
from = [0, 0, 0]
to = [0, 0, 1.0]   # to the plate
material = "steel"
section = "post"

[[member]]
name = "arm"
from = [0, 0, 1.0]
to = [0.5, 0, 1.0]
material = "alloy"
section = "post"
elements = 4  # enough

# -- what holds it --------
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]   # bolted

# -- what measures --------
[[sensor]]
channel = "tip"
at = [0.5, 0, 1.0]
direction = [0, 0, 1]
gain = 1.0   # calibrated in May
"""
PORTAL = (Path(__file__).parents[3] / "examples" / "portal_frame.toml").read_text(encoding="utf-8")
INLINE = """name = "inline"
member = [{name = "a", from = [0, 0, 0], to = [1, 0, 0], material = "m", section = "s", elements = 2}]  # all of it
support = [
    {at = [0, 0, 0], fixed = ["x", "y", "z"]},  # the foot
]
[material.m]
youngs_modulus = 1.0
shear_modulus = 0.4
density = 1.0
[section.s]
area = 1.0
second_moment = [0.01, 0.01]
torsion_constant = 0.02
"""


def _changed_lines(before: str, after: str) -> list[str]:
    """Return lines taken out (-) and put in (+)."""
    lines = difflib.ndiff(before.splitlines(), after.splitlines())
    return [line for line in lines if line[0] in "+-" and line[2:].strip()]


def _with(structure: Structure, **changes: Any) -> Structure:
    return structure.model_copy(update=changes)


def test_moved_sensor_is_written_with_a_comment_and_keeps_its_own() -> None:
    structure = parse_structure(ODD)
    tip = structure.sensor[0].model_copy(update={"at": (0.4, 0.0, 1.0), "gain": 2.0})
    written = dump_structure(_with(structure, sensor=(tip,)), ODD, note="found")
    assert sorted(_changed_lines(ODD, written)) == [
        "+ at = [0.4, 0.0, 1.0] # found; was [0.5, 0.0, 1.0]",
        "+ gain = 2.0   # calibrated in May",
        "- at = [0.5, 0, 1.0]",
        "- gain = 1.0   # calibrated in May",
    ]


@pytest.mark.parametrize("text", [t_structure_toml(), PORTAL, ODD, INLINE], ids=["shipped", "portal", "odd", "inline"])
def test_unchanged_structure_is_written_back_identically(text: str) -> None:
    assert dump_structure(parse_structure(text), text) == text


def test_changed_value_is_replaced_in_its_line() -> None:
    steel = t_frame().material["steel"].model_copy(update={"youngs_modulus": 2.05e11})
    text = t_structure_toml()
    written = dump_structure(_with(t_frame(), material={"steel": steel}), text)
    assert _changed_lines(text, written) == ["- youngs_modulus = 210e9", "+ youngs_modulus = 2.05e11"]


def test_bodies_are_added_with_a_note_and_comments_are_kept() -> None:
    old = parse_structure(ODD)
    new = old.with_bodies([Body(at=(0.25, 0, 1.0), mass=0.3), Body(at=(0.25, 0, 1.0), mass=0.1, offset=(0, 0, 0.02))])
    written = dump_structure(new, ODD, note="found in May")
    assert written.startswith(ODD)
    assert written[len(ODD) :] == (
        "\n[[body]]\n# found in May\nat = [0.25, 0.0, 1.0]\nmass = 0.3\n"
        "\n[[body]]\n# found in May\nat = [0.25, 0.0, 1.0]\nmass = 0.1\noffset = [0.0, 0.0, 0.02]\n"
    )
    assert parse_structure(written) == new
    assert dump_structure(old, written).strip() == ODD.strip()  # and they go without a trace


def test_corrections_are_appended_each_in_its_own_table() -> None:
    old = parse_structure(t_structure_toml())
    new = _with(old, sensors={"beam_left_z": Correction(gain=0.8), "beam_mid_y": Correction(sign=-1, delay=5e-4)})
    written = dump_structure(new, t_structure_toml(), note="found in May")
    assert _changed_lines(t_structure_toml(), written) == [
        "+ [sensors.beam_left_z]", "+ # found in May", "+ gain = 0.8",
        "+ [sensors.beam_mid_y]", "+ # found in May", "+ sign = -1", "+ delay = 0.0005",
    ]  # fmt: skip
    assert parse_structure(written) == new
    assert dump_structure(old, written).strip() == t_structure_toml().strip()


def test_new_entry_is_placed_with_its_kind_before_next_heading() -> None:
    old = parse_structure(ODD)
    prop = Support(at=(0.5, 0, 1.0), stiffness={"z": 2e4})
    written = dump_structure(_with(old, support=(*old.support, prop)), ODD)
    support, heading = written.index("stiffness = {z"), written.index("# -- what measures")
    assert written.index("# bolted") < support < heading < written.index("[[sensor]]")
    assert parse_structure(written).support == (*old.support, prop)


def test_derived_values_are_written_only_when_they_change() -> None:
    """A section by its shape stays one as long as it is that shape; so do a Poisson's ratio and the mesh."""
    old = parse_structure(ODD)
    thicker = Section.model_validate({"shape": "box", "width": 0.04, "height": 0.04, "thickness": 0.004})
    written = dump_structure(_with(old, section={"post": thicker}), ODD)
    assert "shape" not in written
    assert "[section.post]   # cold formed\narea = " in written
    assert "poisson_ratio = 0.3" in written
    assert written.count("elements = ") == 1
    assert parse_structure(written).section == {"post": thicker}
    softer = old.material["steel"].model_copy(update={"youngs_modulus": 2e11})
    written = dump_structure(_with(old, material=dict(old.material) | {"steel": softer}), ODD)
    assert "poisson_ratio" not in written
    assert "  # S235" in written
    assert 'shape = "box"' in written
    assert parse_structure(written).material["steel"] == softer


def test_entries_are_removed_and_reordered() -> None:
    frame, text = t_frame(), t_structure_toml()
    fewer = _with(frame, sensor=(*frame.sensor[:2], *frame.sensor[5:]), support=())
    written = dump_structure(fewer, text)
    assert parse_structure(written) == fewer
    assert "support" not in written
    assert all(line.startswith("- ") for line in _changed_lines(text, written))
    turned = _with(frame, sensor=frame.sensor[::-1])
    assert parse_structure(dump_structure(turned, text)) == turned


def test_inline_arrays_stay_inline() -> None:
    old = parse_structure(INLINE)
    new = _with(old, support=(*old.support, Support(at=(1, 0, 0), fixed=("z",))))
    written = dump_structure(new, INLINE)
    assert parse_structure(written) == new
    assert "[[support]]" not in written
    assert "# the foot" in written


def test_text_without_a_valid_structure_is_refused() -> None:
    with pytest.raises(StructureError):
        dump_structure(t_frame(), "name = 3")


numbers = st.floats(1e-12, 1e12, allow_subnormal=False)


@st.composite
def edited(draw: st.DrawFn, structure: Structure) -> Structure:
    """Return a structure with some of everything changed, added and taken out."""
    member = draw(st.sampled_from(structure.member))
    x, y, z = (float(v) for v in member.point(np.round(draw(st.floats(0, 1)), 3) * member.length))
    at = (x, y, z)
    springs = draw(st.dictionaries(st.sampled_from(ALL), numbers, max_size=3))
    sensor = [s for s in structure.sensor if draw(st.integers(0, 3))]
    sensor = [s.model_copy(update={"gain": draw(numbers)}) if draw(st.booleans()) else s for s in sensor]
    if draw(st.booleans()):
        sensor.insert(draw(st.integers(0, len(sensor))), Sensor(channel="new", at=at, direction=(1, 0, 0)))
    bodies = draw(
        st.lists(st.builds(Body, at=st.just(at), mass=numbers | numbers.map(lambda m: -min(m, 1e-4))), max_size=2)
    )
    wrong = st.builds(Correction, gain=numbers, sign=st.sampled_from([1, -1]), delay=st.sampled_from([0.0, 1e-5, 5e-4]))
    known = {s.channel: draw(wrong) for s in sensor if draw(st.booleans())}
    if len(sensor) > 1 and draw(st.booleans()):  # two that have taken each other's place
        first, second = sensor[0].channel, sensor[1].channel
        known |= {first: Correction(channel=second), second: Correction(channel=first, delay=1e-3)}
    material = {
        name: m.model_copy(update={"density": draw(numbers.map(lambda n: max(n, 1.0)))}) if draw(st.booleans()) else m
        for name, m in structure.material.items()
    }
    joint = Joint(member=member.name, at=at, stiffness={"rx": draw(numbers)})
    return _with(
        structure,
        name=draw(st.sampled_from([structure.name, "# other 'name' \"\\", "ä"])),
        material=material,
        member=tuple(m.model_copy(update={"preload": draw(st.sampled_from([0.0, -1e9]))}) for m in structure.member),
        support=tuple(
            draw(st.permutations([*structure.support, Support.model_validate({"at": at, "stiffness": springs})]))
        ),
        joint=draw(st.sampled_from([(), (joint,)])),
        body=tuple(bodies),
        sensor=tuple(sensor),
        sensors={name: correction for name, correction in known.items() if correction != Correction()},
    )


@pytest.mark.parametrize("text", [t_structure_toml(), PORTAL, ODD, INLINE], ids=["shipped", "portal", "odd", "inline"])
@given(data=st.data())
@settings(max_examples=10, deadline=None)
def test_random_changes_are_written_and_read_back(text: str, data: st.DataObject) -> None:
    first = data.draw(edited(parse_structure(text)))
    written = dump_structure(first, text)
    assert parse_structure(written) == first
    second = data.draw(edited(parse_structure(text)))
    assert parse_structure(dump_structure(second, written)) == second
