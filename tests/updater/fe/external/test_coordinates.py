"""Coordinate systems of Nastran: positions, and displacements of matrices in other axes, as pyNastran has them."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag

from daq import FloatArray
from tests.support.nastran_files import binary_output4, dmig
from updater import Matrices, ProgramFiles, StructureError, read_program_files
from updater.fe.external.programs.meshes import read_mesh

NASTRAN = Path(__file__).parent / "nastran"
CARDS = NASTRAN / "coordinates.bdf"
NESTED = "\n".join(f"CORD2R,{k},{k - 1},0.,0.,0.,0.,0.,1.\n+,1.,0.,0." for k in range(1, 201))
ROWS = [(node, axis) for node in range(1, 7) for axis in range(1, 7)]


@pytest.fixture(scope="module")
def expected() -> FloatArray:
    """Number, position, and axes by rows of each grid point, by pyNastran."""
    return np.loadtxt(NASTRAN / "coordinates.csv", delimiter=",", skiprows=1)


def _read(folder: Path, stiffness: FloatArray, mass: FloatArray, nodes: Path) -> Matrices:
    path = folder / "both.op4"
    path.write_bytes(binary_output4({"KGG": stiffness, "MGG": mass}))
    return read_program_files(ProgramFiles(stiffness=path, mass=path, nodes=nodes))


def test_positions_and_axes_are_those_of_pynastran(expected: FloatArray) -> None:
    """Systems in systems, through grid points in other systems: angles of the file have eleven digits."""
    mesh = read_mesh(CARDS)
    np.testing.assert_allclose([mesh.nodes[int(k)] for k in expected[:, 0]], expected[:, 1:4], atol=1e-10)
    assert sorted(mesh.axes) == [1, 2, 3, 4, 5]
    for number, *axes in expected[:5, [0, *range(4, 13)]].tolist():
        np.testing.assert_allclose(mesh.axes[int(number)].ravel(), axes, atol=1e-9)  # of differences over 1e-6


def _matrix(random: np.random.Generator) -> FloatArray:
    half = random.standard_normal((len(ROWS), len(ROWS)))
    return half @ half.T


def test_matrices_are_turned_to_the_basic_system(tmp_path: Path, expected: FloatArray) -> None:
    random = np.random.default_rng(1)
    onto = block_diag(*[np.kron(np.eye(2), row[4:].reshape(3, 3)) for row in expected])
    stiffness, mass = (_matrix(random) for _ in range(2))
    found = _read(tmp_path, onto @ stiffness @ onto.T, onto @ mass @ onto.T, CARDS)
    for turned, exact in ((found.stiffness, stiffness), (found.mass, mass)):
        np.testing.assert_allclose(turned.toarray(), exact, atol=1e-8 * np.abs(exact).max())


def test_node_with_other_axes_needs_all_its_rows(tmp_path: Path) -> None:
    """A punch file of the a-set, where y of node 2 is held: along its own axes, which is no row of the basic system."""
    kept = [k for k, row in enumerate(ROWS) if row != (2, 2)]
    random = np.random.default_rng(2)
    both = {name: _matrix(random)[np.ix_(kept, kept)] for name in ("KAAX", "MAAX")}
    path = tmp_path / "both.pch"
    path.write_text(dmig(both, [ROWS[k] for k in kept]), encoding="utf-8")
    with pytest.raises(StructureError, match="node 2: its displacements are in a coordinate system: expected degrees"):
        read_program_files(ProgramFiles(stiffness=path, mass=path, nodes=CARDS))


def test_defaults_of_grid_points_are_read(tmp_path: Path) -> None:
    """GRDSET gives both systems where a grid point has none of its own; 0 is its own."""
    path = tmp_path / "grid.bdf"
    path.write_text(
        "GRDSET,,7,,,,7\nGRID,1,,2.,90.,1.\nGRID,2,0,2.,90.,1.,0\nCORD2C,7,,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.\n",
        encoding="utf-8",
    )
    mesh = read_mesh(path)
    np.testing.assert_allclose([mesh.nodes[1], mesh.nodes[2]], [[0, 2, 1], [2, 90, 1]], atol=1e-12)
    assert list(mesh.axes) == [1]
    np.testing.assert_allclose(mesh.axes[1], [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        ("GRID,1,4,0.,0.,0.", "coordinate system 4 is missing"),
        ("GRID,1,,0.,0.,0.,4\nCORD2R,4,,0.,0.,0.,0.,0.,1.\n+,0.,0.,2.", "coordinate system 4: its three points are on"),
        ("GRID,1,,0.,0.,0.,4\nCORD2R,4,,0.,0.,0.,0.,0.,0.\n+,1.,0.,0.", "coordinate system 4: its three points are on"),
        ("GRID,1,4,0.,0.,0.\nGRID,2\nGRID,3\nCORD1R,4,1,2,3", "coordinate system 4 refers to itself"),
        ("GRID,1,4,0.,0.,0.\nCORD2R,4,4,0.,0.,0.,0.,0.,1.\n+,1.,0.,0.", "coordinate system 4 refers to itself"),
        ("GRID,1,4,0.,0.,0.\nCORD1R,4,7,8,9", "coordinate system: node 7 is missing"),
        ("GRID,1,4,0.,0.,0.\nGRID,7\nGRID,8\nCORD1R,4,7,8", "coordinate system 4: expected three points"),
        ("GRID,1,200,0.,0.,0.\n" + NESTED, "coordinate systems: expected up to 100 in each other"),
        ("GRID,1,,nan,0.,0.", "expected finite numbers"),
        ("GRID,1,,0.,0.,0.,-1", "coordinate system -1 is missing"),
    ],
)
def test_invalid_coordinate_systems_are_refused(tmp_path: Path, cards: str, message: str) -> None:
    path = tmp_path / "grid.bdf"
    path.write_text(cards + "\n", encoding="utf-8")
    with pytest.raises(StructureError, match=f"no nodes can be read: {message}"):
        read_mesh(path)
