"""Sensors, bodies and members anywhere on faces of plates, shells and solids."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from daq import FloatArray
from updater import Body, Matrices, ModelError, StructureError, build_model, parse_structure, save_matrices
from updater.fe.external.faces import Faces

CORNERS = np.array([[0, 0, 0], [1.2, 0.1, 0], [1.1, 1.0, 0], [-0.1, 0.8, 0]], float)
TILT = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
QUAD, TRIANGLE = np.array([[0, 1, 2, 3]], np.int32), np.array([[0, 1, 2, -1]], np.int32)
SHELL = np.arange(24, dtype=np.int32).reshape(4, 6)
SOLID = np.pad(np.arange(12, dtype=np.int32).reshape(4, 3), ((0, 0), (0, 3)), constant_values=-1)


@pytest.mark.parametrize("corners", [QUAD, TRIANGLE])
@pytest.mark.parametrize("dofs", [SHELL, SOLID])
def test_rigid_motion_is_read_exactly_on_any_face(corners: np.ndarray, dofs: np.ndarray) -> None:
    """On a tilted face; the corners of a solid have no rotations, which come from their displacements."""
    nodes = CORNERS @ TILT.T
    point = np.array([0.7, 0.35, 0.0]) @ TILT.T
    shift, turn = np.array([0.3, -0.2, 0.5]), np.array([0.4, 0.1, -0.6])
    moved = np.hstack([shift + np.cross(turn, nodes), np.tile(turn, (4, 1))])
    u = np.zeros(int(dofs.max()) + 1)
    u[dofs[dofs >= 0]] = moved[dofs >= 0]
    read = Faces(nodes, corners).reader(point[None], dofs, len(u)) @ u
    np.testing.assert_allclose(read, [*(shift + np.cross(turn, point)), *turn], atol=1e-12)


@pytest.mark.parametrize("corners", [QUAD, TRIANGLE])
def test_quadratic_deflection_is_read_exactly_between_nodes_with_rotations(corners: np.ndarray) -> None:
    """w = x^2 - x y / 2 + y^2: linear interpolation alone is wrong by over a tenth of it."""

    def deflection(p: FloatArray) -> FloatArray:
        return np.asarray(p[..., 0] ** 2 - p[..., 0] * p[..., 1] / 2 + p[..., 1] ** 2)

    slope = np.stack([2 * CORNERS[:, 0] - CORNERS[:, 1] / 2, 2 * CORNERS[:, 1] - CORNERS[:, 0] / 2], axis=1)
    u = np.zeros((4, 6))
    u[:, 2], u[:, 3], u[:, 4] = deflection(CORNERS), slope[:, 1], -slope[:, 0]
    if corners is QUAD:  # bilinear functions reproduce quadratics only on a parallelogram
        nodes = np.array([[0, 0, 0], [1, 0, 0], [1.3, 0.8, 0], [0.3, 0.8, 0]])
        slope = np.stack([2 * nodes[:, 0] - nodes[:, 1] / 2, 2 * nodes[:, 1] - nodes[:, 0] / 2], axis=1)
        u[:, 2], u[:, 3], u[:, 4] = deflection(nodes), slope[:, 1], -slope[:, 0]
    else:
        nodes = CORNERS
    point = np.array([0.6, 0.3, 0.0])
    read = Faces(nodes, corners).reader(point[None], SHELL, 24)[2] @ u.ravel()
    assert read == pytest.approx(float(deflection(point)), abs=1e-12)


@pytest.fixture
def plate(tmp_path: Path) -> Path:
    """Two by one faces of springs between nodes with three displacements; the left edge has no rows."""
    nodes = np.array([(x, y, 0.0) for x in (0.0, 0.5, 1.0) for y in (0.0, 0.4)])
    dofs = np.full((6, 6), -1, np.int32)
    dofs[2:, :3] = np.arange(12).reshape(4, 3)
    faces = np.array([[0, 2, 3, 1], [2, 4, 5, 3]], np.int32)
    stiffness = sparse.csc_array(sparse.diags_array(np.arange(1.0, 13.0)) * 100)
    mass = sparse.csc_array(sparse.diags_array(np.full(12, 0.5)))
    save_matrices(tmp_path / "p.npz", Matrices(stiffness=stiffness, mass=mass, nodes=nodes, dofs=dofs, faces=faces))
    return tmp_path / "p.npz"


def text(at: str, member: str = "from = [0.5, 0, 0]\nto = [0.5, 0.4, 0]") -> str:
    return (
        f'name = "p"\n[external]\nmatrices = "p.npz"\n[[member]]\nname = "m"\n{member}\n'
        f'[[sensor]]\nchannel = "a"\nat = {at}\ndirection = [0, 0, 1]\n'
    )


def test_sensors_and_bodies_may_be_anywhere_on_faces(plate: Path) -> None:
    """Half a face from a clamped edge the sensor reads half of the other edge; a body adds all of its mass."""
    structure = parse_structure(text("[0.25, 0.1, 0]"), plate.with_name("p.toml"))
    model = build_model(structure, mass="consistent")
    moved = np.zeros(12)
    moved[[2, 5]] = 1.0, 2.0  # z of the nodes at x = 0.5
    assert model.sensor_rows[0] @ moved == pytest.approx(0.5 * (1.0 + 0.25))
    heavy = build_model(structure.with_bodies([Body(at=(0.75, 0.3, 0), mass=2.0)]), mass="consistent")
    shares = np.array([0.125, 0.375, 0.125, 0.375])
    added = (heavy.mass - model.mass).toarray()[2::3, 2::3]
    np.testing.assert_allclose(added, 2.0 * np.outer(shares, shares), atol=1e-12)


def test_a_member_may_be_any_line_on_faces(plate: Path) -> None:
    model = build_model(
        parse_structure(text("[0.25, 0.1, 0]", "from = [0.1, 0.1, 0]\nto = [0.9, 0.3, 0]"), plate.with_name("p.toml")),
        mass="consistent",
    )
    assert model.read(np.array([0.9, 0.3, 0.0]), 2).sum() == pytest.approx(1.0)
    assert model.read(np.array([0.1, 0.1, 0.0]), 2).sum() == pytest.approx(0.2)  # a fifth of the way from the edge


@pytest.mark.parametrize(
    ("at", "member", "message"),
    [
        ("[0.25, 0.1, 0.2]", "from = [0.5, 0, 0]\nto = [0.5, 0.4, 0]", "lies on no member and on no face"),
        (
            "[0.5, 0, 0]",
            "from = [0.1, 0.1, 0]\nto = [1.5, 0.3, 0]",
            "need a node at each end of it, or faces all along",
        ),
    ],
)
def test_points_off_the_faces_are_refused(plate: Path, at: str, member: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        _ = build_model(parse_structure(text(at, member), plate.with_name("p.toml"))).sensor_rows


def test_faces_in_a_table_have_the_same_content(plate: Path) -> None:
    from updater import read_matrices

    found = read_matrices(plate, plate, plate)
    free = replace(found, nodes=found.nodes[2:], dofs=found.dofs[2:], faces=found.faces[1:] - 2)
    save_matrices(plate.parent, free)
    again = read_matrices(*(plate.with_name(name) for name in ("stiffness.mtx", "mass.mtx", "dofs.csv", "faces.csv")))
    np.testing.assert_array_equal(again.faces, free.faces)
    plate.with_name("faces.csv").write_text("a,b,c,d\n0,1,99,2\n", encoding="utf-8")
    with pytest.raises(StructureError, match=r"faces\.csv: line 2: expected three or four nodes of the DOF table"):
        read_matrices(*(plate.with_name(name) for name in ("stiffness.mtx", "mass.mtx", "dofs.csv", "faces.csv")))
