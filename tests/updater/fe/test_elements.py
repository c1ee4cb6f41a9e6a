"""Finite elements against closed forms, and the T-frame against its published table."""

import numpy as np
import pytest

from daq import FloatArray
from tests.support.updater.reference_frame import t_frame
from updater import Body, ModelError, Structure, build_model, parse_structure, t_structure_toml
from updater.structure import Joint, Support

E, G, RHO, AREA, SECOND, J, LENGTH = 210e9, 80.8e9, 7850.0, 4.1934e-4, 9.3e-8, 1.58e-7, 1.5
TABLE = {
    None: [10.78, 10.97, 38.84, 68.77, 92.53, 158.02, 253.11, 270.96],
    (0.304, 0.25, 1.48): [10.36, 10.55, 36.65, 66.37, 91.93, 153.98, 241.08, 269.60],
    (0.152, 0.0, 0.92): [10.74, 10.92, 38.84, 67.68, 89.90, 156.55, 253.08, 269.68],
}


def bar(fixed: tuple[str, ...], n: int, end_fixed: tuple[str, ...] = ()) -> Structure:
    """A straight bar along x, held at its start."""
    return Structure.model_validate(
        {
            "name": "bar",
            "material": {"steel": {"youngs_modulus": E, "shear_modulus": G, "density": RHO}},
            "section": {
                "tube": {"area": AREA, "second_moment": (SECOND, SECOND), "torsion_constant": J, "shear_factor": 0.44}
            },
            "member": [
                {
                    "name": "bar",
                    "from": (0, 0, 0),
                    "to": (LENGTH, 0, 0),
                    "material": "steel",
                    "section": "tube",
                    "elements": n,
                }
            ],
            "support": [{"at": (0, 0, 0), "fixed": fixed}, {"at": (LENGTH, 0, 0), "fixed": end_fixed}],
        }
    )


def cantilever_frequency(number: int) -> float:
    """Euler-Bernoulli: (lambda L)^2 sqrt(E SECOND / (rho A L^4)) / 2 pi."""
    root = [1.875104068711961, 4.694091132974175, 7.854757438237613][number]
    return float(root**2 * np.sqrt(E * SECOND / (RHO * AREA * LENGTH**4)) / (2 * np.pi))


ALL = ("x", "y", "z", "rx", "ry", "rz")


def bending_only(n: int) -> FloatArray:
    """Frequencies of a cantilever that can only bend in one plane (twins removed), without rotary inertia's help."""
    model = build_model(bar(ALL, n, ("x", "z", "rx", "ry")), mass="consistent")
    return model.modes(3).frequency


def test_cantilever_frequency_converges_with_fourth_order() -> None:
    """Consistent mass and cubic shapes: error ~ h^4. Rotary inertia shifts the limit, so meshes are compared."""
    coarse, fine, finest = (bending_only(n)[1] for n in (4, 8, 32))
    order = np.log2((coarse - finest) / (fine - finest))
    assert 3.8 < order < 4.2


def test_slender_cantilever_agrees_with_euler_bernoulli() -> None:
    """Rotary inertia lowers mode 1 by about 2 (r / L)^2 x 2.3, r^2 = SECOND / A: under 0.1 % here."""
    relative = (SECOND / AREA) / LENGTH**2
    assert bending_only(32)[0] == pytest.approx(cantilever_frequency(0), rel=6 * relative)


def test_lumped_cantilever_converges_with_second_order() -> None:
    frequency = [build_model(bar(ALL, n, ("x", "z", "rx", "ry"))).modes(1).frequency[0] for n in (8, 16)]
    error = np.abs(np.array(frequency) / cantilever_frequency(0) - 1)
    assert 1.8 < np.log2(error[0] / error[1]) < 2.2


@pytest.mark.parametrize(
    ("free", "speed"), [("x", np.sqrt(E / RHO)), ("rx", np.sqrt(G * J / (RHO * 2 * SECOND)))], ids=["axial", "torsion"]
)
def test_fixed_free_rod_and_shaft_agree_with_the_wave_equation(free: str, speed: float) -> None:
    """f = c / 4 L; linear elements with consistent mass are high by (pi h / 2 L)^2 / 24."""
    n = 20
    held = tuple(axis for axis in ALL if axis != free)
    structure = bar(ALL, n)
    supports = [Support.model_validate({"at": (LENGTH * k / n, 0, 0), "fixed": held}) for k in range(1, n + 1)]
    model = build_model(structure.model_copy(update={"support": (structure.support[0], *supports)}), mass="consistent")
    expected = speed / (4 * LENGTH)
    assert model.modes(1).frequency[0] == pytest.approx(expected, rel=(np.pi / 2 / n) ** 2 / 24 * 1.1)


def test_free_free_bar_on_soft_springs_agrees_with_its_closed_form() -> None:
    """(beta L) = 4.730041, lowered by rotary inertia: r^2 / 2 times the integral of phi'^2 over that of phi^2, 24.7.

    The springs are so soft that they move a flexible mode by less than 1e-5.
    """
    soft = dict.fromkeys(ALL, 1.0)
    structure = bar((), 40).model_copy(
        update={
            "support": tuple(Support.model_validate({"at": p, "stiffness": soft}) for p in ((0, 0, 0), (LENGTH, 0, 0)))
        }
    )
    flexible = [f for f in build_model(structure, mass="consistent").modes(10).frequency if f > 20]
    expected = 4.730040744862704**2 * np.sqrt(E * SECOND / (RHO * AREA * LENGTH**4)) / (2 * np.pi)
    assert flexible[0] == pytest.approx(expected * (1 - 24.7 * (SECOND / AREA) / LENGTH**2), rel=1e-4)


def test_a_structure_without_support_is_refused() -> None:
    with pytest.raises(ModelError, match="support"):
        build_model(bar((), 4)).modes(3)


def test_shear_flexible_cantilever_deflection_matches_timoshenko() -> None:
    """u = P L^3 / 3 E SECOND + P L / kappa G A, exact at the nodes for any mesh."""
    model = build_model(bar(ALL, 3), shear_flexible=True)
    tip = model.read(np.array([LENGTH, 0, 0]), 1)
    flexibility = tip @ np.linalg.solve(model.stiffness.toarray(), tip)
    assert flexibility == pytest.approx(LENGTH**3 / (3 * E * SECOND) + LENGTH / (0.44 * G * AREA), rel=1e-9)


@pytest.mark.parametrize("added", list(TABLE), ids=["nothing", "304 g", "152 g"])
def test_t_frame_has_the_published_frequencies(added: tuple[float, float, float] | None) -> None:
    """10 mm Timoshenko mesh, consistent mass. Tolerance: the table's rounding and 0.01 % for its section constants'."""
    bodies = [] if added is None else [Body(at=(added[1], 0, added[2]), mass=added[0])]
    model = build_model(t_frame().with_mesh(0.01).with_bodies(bodies), shear_flexible=True, mass="consistent")
    np.testing.assert_allclose(model.modes(8).frequency, TABLE[added], rtol=1e-4, atol=0.006)


def test_reference_model_matches_total_and_nodal_mass_of_the_paper() -> None:
    model = build_model(t_frame())
    assert model.total_mass() == pytest.approx(7.505, abs=5e-4)
    column_node = model.read(np.array([0, 0, 0.92]), 0)
    assert column_node @ model.mass @ column_node == pytest.approx(1 / 7.5911, rel=5e-4)  # 3.292 kg/m


def test_mesh_shift_does_not_change_shapes_at_sensors() -> None:
    """RIG: under 0.2 % in any mode at any sensor when nodes move by half an element; fine mesh, so that modes agree."""
    structure = t_frame()
    shapes = []
    for elements in ((148, 80), (149, 81)):
        members = tuple(m.model_copy(update={"elements": n}) for m, n in zip(structure.member, elements, strict=True))
        model = build_model(structure.model_copy(update={"member": members}), mass="consistent")
        shape = model.sensor_rows @ model.modes(8).shape
        shapes.append(np.abs(shape) / np.abs(shape).max(0))
    assert np.abs(shapes[0] - shapes[1]).max() < 2e-3


def test_very_stiff_joint_springs_equal_a_rigid_joint() -> None:
    stiff = Joint(member="crossbeam", at=(0, 0, 1.48), stiffness={"rx": 1e10, "ry": 1e10, "rz": 1e10})
    jointed = build_model(t_frame().model_copy(update={"joint": (stiff,)})).modes(8).frequency
    np.testing.assert_allclose(jointed, build_model(t_frame()).modes(8).frequency, rtol=1e-5)


def test_body_with_offset_equals_a_mass_on_a_rigid_arm() -> None:
    """The same mass on a massless, very stiff member of that length."""
    arm = 0.05
    offset = t_frame().with_bodies([Body(at=(0.25, 0, 1.48), mass=0.3, offset=(0, 0, arm))])
    content = t_frame().model_dump(by_alias=True)
    content["material"]["stiff"] = {"youngs_modulus": 1e17, "shear_modulus": 1e17, "density": 1e-3}
    content["member"] = [
        *content["member"],
        {
            "name": "arm",
            "from": (0.25, 0, 1.48),
            "to": (0.25, 0, 1.48 + arm),
            "material": "stiff",
            "section": "tube_40x40x3",
            "elements": 1,
        },
    ]
    content["body"] = [{"at": (0.25, 0, 1.48 + arm), "mass": 0.3}]
    built = build_model(Structure.model_validate(content), mass="consistent")
    expected = build_model(offset, mass="consistent").modes(8).frequency
    np.testing.assert_allclose(built.modes(8).frequency, expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[[sensor]]", "[[sensr]]", "sensr"),
        ('material = "steel"', 'material = "wood"', "'wood' is not defined"),
        ("density = 7850", "density = -1", "material.steel.density"),
        ('channel = "col_037_x"', 'channel = "col_037_y"', "'col_037_y' is given twice"),
        ("elements = 37", "elements = 0", "member.0.elements"),
        ('fixed = ["x"', 'fixed = ["q"', "support.0.fixed"),
    ],
)
def test_errors_name_file_and_entry(old: str, new: str, says: str) -> None:
    from updater import StructureError

    with pytest.raises(StructureError) as caught:
        parse_structure(t_structure_toml().replace(old, new, 1), "frame.toml")
    assert str(caught.value).startswith("frame.toml: ")
    assert says in str(caught.value)


def test_a_sensor_off_the_structure_is_refused() -> None:
    with pytest.raises(ModelError, match="lies on no member"):
        build_model(t_frame()).read(np.array([0.5, 0.5, 0.5]))
