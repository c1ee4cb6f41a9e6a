"""Errors of frequencies by the mesh of external matrices: closed form, and a table of two meshes."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.opensees import needs_opensees
from tests.support.updater.plates import write_table
from updater import build_model, load_structure
from updater.fe.external.faces import Faces

pytestmark = needs_opensees


@pytest.mark.parametrize("triangles", [False, True])
def test_wave_on_a_grid_has_the_square_of_elements_per_wavelength(*, triangles: bool) -> None:
    """Of w = cos k x the mean over edges in x and y is 4 sin^2 (k h / 2) / 24; a diagonal counts as a third edge."""
    n, k, h = 24, 2 * np.pi / 1.2, 0.1
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    quads = np.array(
        [[number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]] for i, j in np.ndindex(n, n)]
    )
    halves = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    corners = np.column_stack([halves, np.full(len(halves), -1)]) if triangles else quads
    nodes = h * np.array([(i, j, 0) for i, j in np.ndindex(n + 1, n + 1)])
    dofs = np.full((number.size, 6), -1, np.int32)
    dofs[:, 2] = np.arange(number.size)
    wave = np.cos(k * h * (np.arange(n + 1) + 0.5))[:, None] * np.ones(n + 1)
    expected = 4 * np.sin(k * h / 2) ** 2 / 24 * (4 / 3 if triangles else 1.0)
    found = Faces(nodes, corners).mesh_error(dofs, wave.reshape(-1, 1))[0]
    assert found == pytest.approx(expected, rel=0.05)


def test_faces_count_by_their_area() -> None:
    """A wave on elements of h on one half and of 2 h on the other has the mean square of both: 2.5 h^2."""
    h, k = 0.05, 2 * np.pi / 1.2
    x = np.concatenate([np.arange(0, 1.2, h), np.arange(1.2, 2.4 + h, 2 * h)])
    nodes = np.array([(a, b, 0.0) for a in x for b in (0.0, 1.0)])
    first = 2 * np.arange(len(x) - 1)
    dofs = np.full((len(nodes), 6), -1, np.int32)
    dofs[:, 2] = np.arange(len(nodes))
    quads = np.column_stack([first, first + 2, first + 3, first + 1])
    found = Faces(nodes, quads.astype(np.int32)).mesh_error(dofs, np.cos(k * nodes[:, :1]))[0]
    assert found == pytest.approx(2.5 * (k * h) ** 2 / 24, rel=0.05)


@pytest.mark.thorough
def test_error_is_that_of_a_finer_mesh(tmp_path: Path) -> None:
    """Errors are of order h^2: elements half as long leave a quarter. Eight modes of bending.

    Measured: between 0.6 and 2.0 of the formula, 1.1 in the geometric mean.
    """
    found = []
    for along in (15, 30):
        (tmp_path / str(along)).mkdir()
        file = write_table(tmp_path / str(along), along=along, across=8 * along // 15)
        model = build_model(load_structure(file), mass="consistent")
        modes = model.modes(8)
        found.append((np.log(modes.frequency), model.mesh_error(modes.shape)))
    (coarse, stated), (fine, _) = found
    ratio = 4 / 3 * (coarse - fine) / stated
    assert 0.8 < np.exp(np.log(ratio).mean()) < 1.6
    assert ((ratio > 0.4) & (ratio < 2.5)).all()
