"""A file whose branch is rigid on a hollow chord, measured modes of solids whose wall bends there.

Springs at and beyond the chord's face represent the wall. In most draws the file's parameters alone are named; some
are ambiguous with the place of a sensor. A change that follows is found.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, MeshQuad
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

from daq import FloatArray
from monitor.analysis.explanation import explain
from oma import ModalEstimate
from tests.support.portals.block_specimens import Specimen
from tests.support.portals.block_windows import change_is_found, measured_modes, prediction_errors
from tests.support.portals.wall_specimens import draw_tubes
from tests.support.updater.frames import noisy_estimates, unmoved
from updater import (
    Structure,
    build_model,
    calibrate,
    dump_structure,
    matched,
    mean_modes,
    nominal_reference,
    parse_structure,
    stack_tracks,
)
from updater.inference import compare
from updater.reference import wall_errors
from updater.structure import (
    TURNS,
    ModelParameter,
    apply_parameters,
    flexibility_unit,
    model_parameters_of,
    physical_value,
    rounded,
    simplified,
    wall_of,
)

N_USED, N_UNUSED, N_WINDOWS = 8, 4, 5
CHORD = 'shape = "box"\nwidth = 0.06\nheight = 0.06\nthickness = 0.003'
FILE = """
name = "branch"
[mesh]
element_length = 0.1
[material.m]
youngs_modulus = 2.1e11
shear_modulus = 8e10
density = 7850
[section.chord]
{chord}
[section.branch]
shape = "box"
width = {width}
height = {width}
thickness = 0.003
[[member]]
name = "chord"
from = [0, 0, 0]
to = [0, 0, 1]
material = "m"
section = "chord"
[[member]]
name = "branch"
from = [0, 0, 0.6]
to = {end}
material = "m"
section = "branch"
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
"""
JOINT = '[[joint]]\nmember = "{}"\nat = [0, 0, 0.6]\nstiffness = {{ ry = 4e4 }}'
BEYOND = 1.15 * (0.04 / 0.06) ** 2 * 0.03  # of the face [m]: by the square of the branch's share of the width
THIN = CHORD.replace("0.003", "0.001")  # wall of 670 Hz; the eighth mode has 580 Hz
FOOT = 5e6  # N m/rad
BEAMS_ERROR = 2e-3  # of ln f of any model of beams
TIP, ALONG, UP = (0.5, 0.0, 0.6), 0, 2


def structure_of(
    chord: str = CHORD, *, width: float = 0.04, way: tuple[float, float, float] = (0.5, 0.0, 0.0), further: str = ""
) -> Structure:
    """Return a branch on a chord, of 0.5 m along x unless it goes another way [m]."""
    end = np.add((0.0, 0.0, 0.6), way).tolist()
    return parse_structure(FILE.format(chord=chord, width=width, end=end) + further)


def measured_frame() -> Structure:
    """Return the same on a foot that turns, with sensors on both members."""
    sensors = "".join(
        f'[[sensor]]\nchannel = "{x}_{z}_{axis}"\nat = [{x}, 0, {z}]\ndirection = {direction}\n'
        for x, z in ((0.0, 0.5), (0.0, 1.0), (0.25, 0.6), (0.5, 0.6))
        for axis, direction in (("x", [1, 0, 0]), ("y", [0, 1, 0]), ("z", [0, 0, 1]))
    )
    text = FILE.format(chord=THIN, width=0.04, end=[0.5, 0.0, 0.6]) + sensors
    clamp = 'fixed = ["x", "y", "z", "rx", "ry", "rz"]'
    return parse_structure(
        text.replace(clamp, f'fixed = ["x", "y", "z", "rz"]\nstiffness = {{ rx = {FOOT:g}, ry = {FOOT:g} }}')
    )


def wall_parameters(structure: Structure) -> dict[str, ModelParameter]:
    """Return the springs of walls by their names."""
    return {knob.key: knob for knob in model_parameters_of(structure) if knob.kind == "wall"}


def test_wall_of_a_hollow_chord_has_springs_at_its_face() -> None:
    structure = structure_of()
    found = wall_parameters(structure)
    assert sorted(found) == ["branch.wall_ry", "branch.wall_rz", "branch.wall_x"]
    wall = wall_of(structure, structure.member_named("branch"), (0.0, 0.0, 0.6))
    assert wall is not None
    assert wall.start == pytest.approx({"ry": 0.03, "rz": 0.03 + BEYOND, "x": 0.03})  # half the depth of the chord


def test_spring_about_a_chord_that_lies_is_about_local_y() -> None:
    """A branch that stands on a chord along its local y axis."""
    lying = FILE.format(chord=CHORD, width=0.04, end=[0.5, 0.0, 0.6])
    for old, new in (("[0, 0, 1]", "[0, 1, 0]"), ("[0, 0, 0.6]", "[0, 0.6, 0]"), ("[0.5, 0.0, 0.6]", "[0.5, 0.6, 0]")):
        lying = lying.replace(old, new)
    structure = parse_structure(lying)
    wall = wall_of(structure, structure.member_named("branch"), (0.0, 0.6, 0.0))
    assert wall is not None
    assert wall.start["ry"] > wall.start["rz"] == pytest.approx(0.03)


def test_springs_of_a_branch_that_ends_on_the_chord_are_at_its_end() -> None:
    text = FILE.format(chord=CHORD, width=0.04, end=[0.0, 0.0, 0.6])
    structure = parse_structure(text.replace("from = [0, 0, 0.6]", "from = [-0.5, 0, 0.6]"))
    wall = wall_of(structure, structure.member_named("branch"), (0.0, 0.0, 0.6))
    assert wall is not None
    ends = {axis: wall.branch.length - wall.span(axis)[1] for axis in wall.start}
    assert ends == pytest.approx({"ry": 0.03, "rz": 0.03 + BEYOND, "x": 0.03})


@pytest.mark.parametrize("angle", [0.0, 30.0, 45.0])
def test_face_of_a_round_chord_is_at_its_radius(angle: float) -> None:
    way = 0.5 * np.cos(np.radians(angle)), 0.5 * np.sin(np.radians(angle)), 0.0
    structure = structure_of('shape = "tube"\ndiameter = 0.06\nthickness = 0.003', width=0.03, way=way)
    wall = wall_of(structure, structure.member_named("branch"), (0.0, 0.0, 0.6))
    assert wall is not None
    assert list(wall.start.values()) == pytest.approx([0.03] * 3)


def test_bounds_of_a_wall_hold_its_expected_value() -> None:
    """Least stiffnesses of twice the expected one; the greatest does not count, since the file has the wall rigid."""
    expected = wall_parameters(structure_of())["branch.wall_ry"]
    least = 2 * physical_value(structure_of(), expected, expected.mean)
    bounded = structure_of(further=f'[updating.bounds]\n"branch.wall_ry" = [{least}, {10 * least}]')
    found = wall_parameters(bounded)["branch.wall_ry"]
    assert [found.mean, found.upper] == pytest.approx([expected.mean / 2] * 2)
    assert found.lower == expected.lower


def test_springs_of_a_wall_that_is_as_good_as_rigid_are_not_written() -> None:
    structure = structure_of()
    knobs = list(wall_parameters(structure).values())
    least = np.array([knob.lower for knob in knobs])
    assert not simplified(apply_parameters(structure, knobs, least), knobs).segment
    soft_about_y = least.copy()
    soft_about_y[0] = knobs[0].mean
    (kept,) = simplified(apply_parameters(structure, knobs, soft_about_y), knobs).segment
    assert kept.bending[0] < 0.1
    assert (kept.bending[1], kept.axial) == (1.0, 1.0)


def test_written_spring_has_two_digits_of_its_deviation() -> None:
    structure = structure_of()
    knob = wall_parameters(structure)["branch.wall_ry"]
    extended = apply_parameters(structure, [knob], np.array([knob.mean]))
    stiffness = physical_value(structure, knob, knob.mean)
    (exact,), (short,) = (s.segment for s in (extended, rounded(extended, [knob], {knob.key: 0.2 * stiffness})))
    assert abs(short.bending[0] - exact.bending[0]) < 0.05 * 0.2 * exact.bending[0]
    assert len(f"{short.bending[0]:g}".lstrip("0.")) <= 3


@pytest.mark.parametrize(
    "structure",
    [
        structure_of('shape = "rectangle"\nwidth = 0.06\nheight = 0.06'),
        structure_of(width=0.06),  # on the sides of the chord
        structure_of(further=JOINT.format("branch")),
        structure_of(further=JOINT.format("chord")),
        structure_of(way=(0.36, 0.36, 0.0)),
        structure_of(way=(0.0, 0.0, 0.3)),  # a sleeve
    ],
    ids=["solid chord", "wide branch", "joint of the branch", "joint of the chord", "corner", "sleeve"],
)
def test_other_joints_have_no_springs_of_walls(structure: Structure) -> None:
    assert not wall_parameters(structure)


def test_springs_that_the_file_has_are_parameters_about_its_values() -> None:
    """Two of three: the wall is rigid along the branch."""
    structure = structure_of()
    knobs = list(wall_parameters(structure).values())[:2]
    value = np.array([0.3, 0.2])
    written = parse_structure(dump_structure(apply_parameters(structure, knobs, value)))
    found = wall_parameters(written)
    assert list(found) == ["branch.wall_ry", "branch.wall_rz"]
    assert [knob.mean for knob in found.values()] == pytest.approx(value.tolist(), rel=1e-9)
    assert [knob.prior for knob in found.values()] == [knob.prior for knob in knobs]
    again = apply_parameters(written, list(found.values()), 2 * value)
    expected = apply_parameters(structure, knobs, 2 * value)
    assert again.segment == expected.segment
    assert simplified(again, list(found.values())).segment == again.segment


@pytest.mark.parametrize(("axis", "lever", "way"), [("ry", 0.47, UP), ("x", 1.0, ALONG)])
def test_spring_of_a_wall_adds_its_flexibility_at_the_face(axis: str, lever: float, way: int) -> None:
    """A unit force at the tip moves it by lever^2 / k more; the segment of the spring has 1.5 mm."""
    structure = structure_of()
    knob = wall_parameters(structure)[f"branch.wall_{axis}"]
    softer = apply_parameters(structure, [knob], np.array([knob.mean]))
    before, after = (tip_flexibility(one, way) for one in (structure, softer))
    added = lever**2 / physical_value(structure, knob, knob.mean)
    assert after - before == pytest.approx(added, rel=2 * 0.0015 / 0.47)


def test_error_of_a_wall_is_that_of_a_spring_whose_flexibility_rises_with_frequency() -> None:
    """Each mode, with springs that are softer by the square of its frequency over the wall's, to first order.

    The share is at most 0.04, and so is the second order of the shift, relative to the first.
    """
    structure = structure_of()
    knobs = list(wall_parameters(structure).values())
    wall = wall_of(structure, structure.member_named("branch"), (0.0, 0.0, 0.6))
    assert wall is not None
    model = build_model(apply_parameters(structure, knobs, np.array([k.mean for k in knobs])))
    modes = model.modes(6)
    for mode, (frequency, error) in enumerate(zip(modes.frequency, wall_errors(model, modes).sum(1), strict=True)):
        softer = np.array([k.mean * (1 + (frequency / wall.frequency) ** 2) for k in knobs])
        changed = build_model(apply_parameters(structure, knobs, softer)).modes(6).frequency[mode]
        assert (frequency / wall.frequency) ** 2 < 0.04
        assert np.log(frequency / changed) == pytest.approx(error, rel=0.04)


@pytest.mark.parametrize("of_file", [1.0, 0.7])
def test_springs_that_the_file_has_are_calibrated_with_the_error_of_the_wall(of_file: float) -> None:
    """The truth's foot is the file's; its springs soften with frequency, which a foot must not replace.

    Springs that the file has with 0.7 of the flexibility are fitted, instead of a foot that is softer.
    """
    structure = measured_frame()
    written, windows = softening_springs(structure, N_USED, of_file)
    measured = mean_modes(stack_tracks(windows, unmoved(N_WINDOWS)))
    found = {parameter.name: parameter for parameter in calibrate(written, measured).parameters}
    for axis in TURNS[:2]:
        foot, true = found[f"support 0 flexibility {axis}"], flexibility_unit(structure, axis, (0, 0, 0)) / FOOT
        print(axis, foot.value, foot.std, true)
        assert abs(foot.value - true) < 2 * foot.std
    for knob in list(wall_parameters(written).values())[:2]:  # a mode beyond the first order determines that along it
        spring, true = found[knob.name], knob.mean / of_file
        print(knob.key, spring.value, spring.std, true)
        assert abs(spring.value - true) < 3 * spring.std


def test_inertia_of_a_wall_has_one_amplitude_in_all_modes() -> None:
    """One deviation e of a spring in all modes has e' inv(C) e < 1, with C = D + e e' + ..

    Three of them have less than 9. With the error of a single mode reversed, these are not expected.
    """
    written, windows = softening_springs(measured_frame(), N_USED)
    reference = nominal_reference(written, stack_tracks(windows, unmoved(N_WINDOWS)))
    expected = reference.calibration.frequency_error.only(reference.paired)
    data = compare(reference, matched(reference.baseline, reference.baseline))
    np.testing.assert_array_equal(data.common_deviation[:, 1:], expected.walls)
    covariance = expected.covariance + BEAMS_ERROR**2 * np.eye(len(expected.walls))

    def chi_square(off: FloatArray) -> float:
        return float(off @ np.linalg.solve(covariance, off))

    for error in expected.walls.T:
        assert chi_square(3 * error) < 9
    reversed_in_one = expected.walls[:, 1].copy()
    reversed_in_one[np.argsort(reversed_in_one)[-2]] *= -1
    print("errors, %:", (100 * expected.walls).round(2).tolist(), chi_square(3 * reversed_in_one))
    assert chi_square(3 * reversed_in_one) > 9


def softening_springs(structure: Structure, n: int, of_file: float = 1.0) -> tuple[Structure, list[ModalEstimate]]:
    """Return a file with springs, and windows of n modes whose springs are softer by the square of their frequency.

    Parameters
    ----------
    of_file : flexibility of the file's springs, over that at frequency 0 [-]
    """
    knobs = list(wall_parameters(structure).values())
    soft = np.array([knob.mean for knob in knobs])
    wall = wall_of(structure, structure.member_named("branch"), (0.0, 0.0, 0.6))
    assert wall is not None
    written = apply_parameters(structure, knobs, soft)
    model = build_model(written, shear_flexible=True, mass="consistent")
    frequency, shape = model.modes(n).frequency, np.empty((n, len(structure.channels)))
    for mode, share in enumerate((frequency / wall.frequency) ** 2):
        changed = apply_parameters(structure, knobs, soft * (1 + share))
        own = build_model(changed, shear_flexible=True, mass="consistent").modes(n)
        seen = model.sensor_rows @ own.shape[:, mode]
        frequency[mode], shape[mode] = own.frequency[mode], seen / np.linalg.norm(seen)
    random = np.random.default_rng(1)
    file = apply_parameters(structure, knobs, of_file * soft)
    return file, noisy_estimates(frequency, shape, written.channels, N_WINDOWS, random, std=1e-4, shape_std=1e-3)


def test_frequency_of_a_wall_is_that_of_a_strip_of_solids() -> None:
    """In plane strain, hinged at the middle of its edges. Area over circumference is t (1 - t / width)."""
    wall = wall_of(structure_of(), structure_of().member_named("branch"), (0.0, 0.0, 0.6))
    assert wall is not None
    width, thickness = 0.06, 0.003
    mesh = MeshQuad.init_tensor(np.linspace(0, width, 31), np.linspace(-thickness / 2, thickness / 2, 3))
    basis = Basis(mesh, ElementVector(ElementQuad2()))
    stiffness = linear_elasticity(*lame_parameters(2.1e11, 0.3)).assemble(basis)
    x, y = mesh.p
    hinge = basis.nodal_dofs[:, (np.isclose(x, 0) | np.isclose(x, width)) & np.isclose(y, 0)]
    mass = 7850 * BilinearForm(lambda u, v, _: dot(u, v)).assemble(basis)
    free = basis.complement_dofs(hinge.ravel())
    value = eigsh(stiffness[free][:, free].tocsc(), 1, mass[free][:, free].tocsc(), sigma=0.0, v0=np.ones(len(free)))[0]
    strip = float(np.sqrt(value[0])) / (2 * np.pi)
    print(strip, wall.frequency)
    assert wall.frequency == pytest.approx(strip * (1 - thickness / width), rel=0.01)  # of shear and inertia: 0.4 %


def test_expected_flexibilities_are_those_of_a_draw_of_solids() -> None:
    """Draw 18, which the coefficients are not from, under static loads; such draws were -10 to +19 % off."""
    chord = CHORD.replace("0.06", "0.069322").replace("0.003", "0.003117")
    structure = structure_of(chord, width=0.045336)
    wall = wall_of(structure, structure.member_named("branch"), (0.0, 0.0, 0.6))
    assert wall is not None
    unit = wall.branch.length / structure.section["branch"].second_moment[0]
    found = wall.expected["ry"] * unit, wall.expected["rz"] * unit
    assert found == pytest.approx((2.804e6, 3.509e6), rel=0.2)  # times E [1/m3]


def tip_flexibility(structure: Structure, way: int) -> float:
    """Return the displacement of the tip of the branch per force along a global axis [m/N]."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    row = model.read(np.array(TIP), way)
    return float(row @ np.linalg.solve(model.stiffness.toarray(), row))


@pytest.mark.thorough
@pytest.mark.timeout(2400)
def test_wall_that_bends_is_a_joint_and_no_defect() -> None:
    """Of twenty draws, the first twenty, 17 were explained by the file's parameters alone.

    The other three were ambiguous with a sensor that is 10 to 12 mm off. At least 16: one draw less than was measured,
    as by another version of a library. No draw may have a loss of stiffness, a mass or another cause.
    """
    found = [_explained(seed) for seed in range(1, 21)]
    assert all(better for _, better in found)
    assert sum(named == {"model_parameters"} for named, _ in found) >= 16
    assert not [named for named, _ in found if named - {"model_parameters", "sensor_position"}]


def _explained(seed: int) -> tuple[set[str], bool]:
    """Return the named causes, and whether modes not measured are predicted better by the written file."""
    specimen = draw_tubes(seed)
    frequency, shape = specimen.modes(N_USED + N_UNUSED)
    named, written = _diagnosed(specimen, seed, frequency[:N_USED], shape[:N_USED])
    if written is None:
        return named, False
    before, after = (prediction_errors(one, frequency, shape)[N_USED:] for one in (specimen.file, written))
    print("modes not measured, %:", before.round(2), after.round(2))
    return named, bool(np.mean(after**2) < np.mean(before**2))


def _diagnosed(
    specimen: Specimen, seed: int, frequency: FloatArray, shape: FloatArray
) -> tuple[set[str], Structure | None]:
    """Return the named causes of a diagnosis without reference logs, and the file that it writes."""
    random = np.random.default_rng((seed, 77))
    now, heldout = (measured_modes(specimen, frequency, shape, random) for _ in range(2))
    found = explain(specimen.file, None, now, heldout)
    named = {cause.cause for cause in found.diagnosis.causes}
    print(f"seed {seed}", specimen.facts, found.diagnosis.verdict, sorted(named))
    extended = found.explained.extended
    return named, None if extended is None else parse_structure(dump_structure(extended))


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [2, 4])
def test_loosened_foot_is_found_with_the_file_that_a_diagnosis_wrote(seed: int) -> None:
    """With the springs of the file held, that of draw 2 was unexplained; draw 4 was found with them held, too."""
    specimen = draw_tubes(seed)
    _, written = _diagnosed(specimen, seed, *specimen.modes(N_USED))
    assert written is not None
    assert change_is_found(replace(specimen, text=dump_structure(written)), seed, "foot", N_USED)


@pytest.mark.thorough
@pytest.mark.parametrize(("effect", "seeds"), [("body", (1, 3, 5, 7, 9)), ("foot", (2, 4, 6, 8, 10))])
def test_change_of_a_frame_with_a_wall_joint_is_found(effect: str, seeds: tuple[int, ...]) -> None:
    """Against reference logs, to which the springs of the wall are calibrated. These are all draws that were run."""
    assert all(change_is_found(draw_tubes(seed), seed, effect, N_USED) for seed in seeds)
