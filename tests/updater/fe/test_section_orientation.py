"""Orientation of a member's section about its axis."""

import itertools

import numpy as np
import pytest

from daq import FloatArray
from tests.support.updater.frames import beam, clamped, t_frame
from updater import Model, StructureError, build_model, parse_structure, t_structure_toml

UPRIGHT, FLAT = 3e-3, 1e-3  # second moments about the local y and z axes


def _turned(direction: tuple[float, float, float], local_y: tuple[float, float, float] | None) -> Model:
    plain = beam(
        length=1.0, elements=2, support=clamped(), second_moment=(UPRIGHT, FLAT), torsion_constant=2e-3,
        direction=direction,
    )  # fmt: skip
    return build_model(plain.model_copy(update={"member": (plain.member[0].model_copy(update={"local_y": local_y}),)}))


def _tip_stiffness(model: Model, load: FloatArray) -> float:
    rows = model.read(np.asarray(model.structure.member[0].end))[:3]
    moved = rows @ np.linalg.solve(model.stiffness.toarray(), rows.T @ load)
    return float(1 / (load @ moved))


@pytest.mark.parametrize(
    ("direction", "local_y"),
    [
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
        ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
        ((0.36, -0.48, 0.8), (1.0, 2.0, 3.0)),
        ((0.0, 1.0, 0.0), (0.0, 5.0, -1.0)),
    ],
)
def test_bending_stiffness_follows_the_local_section_axes(
    direction: tuple[float, float, float], local_y: tuple[float, float, float]
) -> None:
    """3 E I / L^3 along y by the second moment about z, and the other way round."""
    along = np.asarray(direction)
    y = np.asarray(local_y) - (np.asarray(local_y) @ along) * along
    y /= np.linalg.norm(y)
    model = _turned(direction, local_y)
    assert _tip_stiffness(model, y) == pytest.approx(3 * FLAT, rel=1e-9)
    assert _tip_stiffness(model, np.cross(along, y)) == pytest.approx(3 * UPRIGHT, rel=1e-9)


@pytest.mark.parametrize("local_y", [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_rotary_inertia_follows_the_local_section_axes(local_y: tuple[float, float, float]) -> None:
    """A free beam's inertia about its end: A L^3 / 3 and the second moment about the same axis, per density."""
    plain = beam(length=1.0, elements=3, support=(), second_moment=(UPRIGHT, FLAT))
    model = build_model(
        plain.model_copy(update={"member": (plain.member[0].model_copy(update={"local_y": local_y}),)}),
        mass="consistent",
    )
    about_y, about_z = (UPRIGHT, FLAT) if local_y[1] else (FLAT, UPRIGHT)
    for axis, moment in ((1, about_y), (2, about_z)):
        rigid = np.zeros(model.n_dofs)
        for node, point in enumerate(model.nodes):
            rigid[model.dofs[node, 3 + axis]] = 1
            rigid[model.dofs[node, :3]] = np.cross(np.eye(3)[axis], point)
        assert rigid @ (model.mass @ rigid) == pytest.approx(1 / 3 + moment, rel=1e-12)


def test_default_section_width_is_horizontal() -> None:
    level, post = _turned((0.6, 0.8, 0.0), None), _turned((0.0, 0.0, 1.0), None)
    assert _tip_stiffness(level, np.array([0.0, 0.0, 1.0])) == pytest.approx(3 * UPRIGHT, rel=1e-9)
    assert _tip_stiffness(level, np.array([-0.8, 0.6, 0.0])) == pytest.approx(3 * FLAT, rel=1e-9)
    assert _tip_stiffness(post, np.array([0.0, 1.0, 0.0])) == pytest.approx(3 * FLAT, rel=1e-9)


def test_displacement_inside_a_turned_element_is_exact() -> None:
    """Two elements interpolate the exact cubic under a tip load, whichever way the section is turned."""
    for local_y, load in itertools.product(((0.0, 1.0, 0.0), (0.0, 1.0, 1.0)), np.eye(3)[1:]):
        model = _turned((1.0, 0.0, 0.0), local_y)
        tip = model.read(np.array([1.0, 0.0, 0.0]))[:3]
        moved = np.linalg.solve(model.stiffness.toarray(), tip.T @ load)
        quarter, end = (model.read(np.array([x, 0.0, 0.0]))[:3] @ moved for x in (0.25, 1.0))
        np.testing.assert_allclose(quarter, end * (3 * 0.25**2 - 0.25**3) / 2, atol=1e-12 * np.abs(end).max())


@pytest.mark.parametrize("local_y", ["[0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0]", "[0, 0, -3]"])
def test_local_y_along_the_member_is_refused(local_y: str) -> None:
    text = t_structure_toml().replace("elements = 37", f"elements = 37\nlocal_y = {local_y}")
    with pytest.raises(StructureError, match=r"member\.0 of column: local_y .* does not point across the member"):
        parse_structure(text)


def test_square_tube_frequencies_do_not_depend_on_orientation() -> None:
    frame = t_frame()
    turned = frame.model_copy(
        update={"member": (frame.member[0].model_copy(update={"local_y": (1, 2, 0)}), frame.member[1])}
    )
    np.testing.assert_allclose(build_model(turned).modes(8).frequency, build_model(frame).modes(8).frequency, rtol=1e-9)
