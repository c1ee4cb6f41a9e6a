"""Matrices in the files of other programs: CalculiX, Abaqus, Ansys, Nastran and OpenSees."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from scipy import sparse
from scipy.io import hb_write
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.sparse.linalg import eigsh

from daq import FloatArray
from tests.support.nastran_files import binary_output4, dmig, sparse_output4
from tests.support.opensees import needs_opensees, ops
from tests.support.updater.frames import beam, clamped
from updater import (
    Matrices,
    Model,
    ModelError,
    ProgramFiles,
    StructureError,
    build_model,
    opensees_matrices,
    read_program_files,
)
from updater.fe.external.programs.conversion import read_labelled
from updater.fe.external.programs.meshes import read_mesh

HERE = Path(__file__).parent
CALCULIX = HERE / "calculix"
STRIP = ProgramFiles(stiffness=CALCULIX / "strip.sti", mass=CALCULIX / "strip.mas", nodes=CALCULIX / "strip.inp")


def frequencies(found: Matrices, n: int) -> FloatArray:
    value = eigsh(found.stiffness, n, found.mass, sigma=0.0, return_eigenvectors=False)
    return np.sort(np.sqrt(value)) / (2 * np.pi)


def test_calculix_matrices_have_the_frequencies_of_calculix() -> None:
    table = (CALCULIX / "modes.dat").read_text(encoding="utf-8").partition("F A C T O R S")[0]
    lines = [line.split() for line in table.splitlines()]
    expected = [float(words[3]) for words in lines if len(words) == 5 and words[0].isdecimal()]
    found = read_program_files(STRIP)
    assert len(expected) == 5
    np.testing.assert_allclose(frequencies(found, 5), expected, rtol=2e-6)  # seven digits are printed
    assert len(found.faces) == 2 + 4 * 2
    held = found.nodes[:, 0] == 0
    assert (found.dofs[held] < 0).all()
    assert (found.dofs[~held, :3] >= 0).all()


def test_group_is_the_difference_of_two_stiffnesses_of_calculix() -> None:
    found = read_program_files(replace(STRIP, doubled={"root": CALCULIX / "doubled.sti"}))
    doubled = read_program_files(replace(STRIP, stiffness=CALCULIX / "doubled.sti", rows=CALCULIX / "strip.dof"))
    root = found.groups["root"]
    assert abs(found.stiffness + root - doubled.stiffness).max() < 1e-10 * abs(found.stiffness).max()
    held = found.nodes[(found.dofs[:, 0] >= 0)][np.unique(root.tocoo().coords[0] // 3)]
    assert held[:, 0].max() == pytest.approx(0.15)  # its free nodes are those of the first brick


def simple() -> Model:
    return build_model(beam(length=1.0, elements=3, support=clamped(), modulus=7e10, density=2.7e3), mass="consistent")


def nodes_of(model: Model, path: Path, scale: float = 1.0) -> Path:
    lines = ["*NODE", *(f"{i + 1}, {x * scale}, {y * scale}, {z * scale}" for i, (x, y, z) in enumerate(model.nodes))]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def rows_of(model: Model) -> list[tuple[int, int]]:
    node, axis = np.nonzero(model.dofs >= 0)
    order = np.argsort(model.dofs[node, axis])
    return [(int(n) + 1, int(a)) for n, a in zip(node[order], axis[order], strict=True)]


@pytest.mark.parametrize("millimetres", [False, True])
def test_abaqus_matrix_input_is_read_in_both_systems_of_units(tmp_path: Path, millimetres: bool) -> None:
    """One triangle; the fixed node's stiffness is 1e36, as Abaqus writes it."""
    model = simple()
    rows = rows_of(model)
    unit = np.array([1e-3**0.5 if axis < 3 else 1e-3**-0.5 for _, axis in rows]) if millimetres else np.ones(len(rows))
    for name in ("stiffness", "mass"):
        entries = sparse.coo_array(
            sparse.tril(sparse.diags_array(unit) @ getattr(model, name) @ sparse.diags_array(unit))
        )
        lines = [
            f"{rows[i][0]},{rows[i][1] + 1}, {rows[j][0]},{rows[j][1] + 1},  {value:.15e}"
            for i, j, value in zip(*entries.coords, entries.data, strict=True)
        ]
        lines += [f"1,{k}, 1,{k}, 1.000000000000000e+36" for k in range(1, 7)] if name == "stiffness" else []
        (tmp_path / f"{name}.mtx").write_text("\n".join(lines), encoding="utf-8")
    found = read_program_files(
        ProgramFiles(
            stiffness=tmp_path / "stiffness.mtx",
            mass=tmp_path / "mass.mtx",
            nodes=nodes_of(model, tmp_path / "job.inp", 1e3 if millimetres else 1.0),
            millimetres=millimetres,
        )
    )
    _same(found, model)


def _same(found: Matrices, model: Model) -> None:
    np.testing.assert_allclose(found.nodes, model.nodes, atol=1e-12)
    order = found.dofs[model.dofs >= 0]
    for name in ("stiffness", "mass"):
        expected = getattr(model, name)
        assert abs(getattr(found, name)[order][:, order] - expected).max() < 1e-12 * abs(expected).max()


@pytest.mark.parametrize("kind", ["RUA", "RSA"])
def test_harwell_boeing_matrices_are_read_with_the_mapping_of_ansys(tmp_path: Path, kind: str) -> None:
    model = simple()
    names = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
    mapping = ["     Matrix Eqn      Node    DOF"]
    mapping += [f"{i:12d}{node:12d}   {names[axis]}" for i, (node, axis) in enumerate(rows_of(model), start=1)]
    for name in ("stiffness", "mass"):
        matrix = getattr(model, name)
        path = tmp_path / f"{name}.matrix"
        hb_write(path, sparse.csc_array(sparse.tril(matrix)) if kind == "RSA" else matrix)
        path.write_text(path.read_text().replace("RUA", kind, 1), encoding="utf-8")
    (tmp_path / "job.mapping").write_text("\n".join(mapping), encoding="utf-8")
    listing = [" NODE        X             Y             Z         THXY    THYZ    THZX"]
    listing += [
        f"{i + 1:6d} {x:13.6E} {y:13.6E} {z:13.6E}  0.00  0.00  0.00" for i, (x, y, z) in enumerate(model.nodes)
    ]
    (tmp_path / "nodes.lis").write_text("\n".join(listing), encoding="utf-8")
    found = read_program_files(
        ProgramFiles(
            stiffness=tmp_path / "stiffness.matrix",
            mass=tmp_path / "mass.matrix",
            nodes=tmp_path / "nodes.lis",
            rows=tmp_path / "job.mapping",
        )
    )
    rounded = replace(found, nodes=np.where(abs(found.nodes - model.nodes) < 1e-6, model.nodes, found.nodes))
    order = rounded.dofs[model.dofs >= 0]
    np.testing.assert_allclose(rounded.nodes, model.nodes)
    # scipy writes as many digits as the largest entry needs
    assert abs(found.stiffness[order][:, order] - model.stiffness).max() < 1e-7 * abs(model.stiffness).max()
    np.testing.assert_allclose(frequencies(found, 4), model.modes(4).frequency, rtol=1e-5)


@pytest.mark.parametrize("form", ["lines", "columns"])
def test_harwell_boeing_file_has_a_right_hand_side(tmp_path: Path, form: str) -> None:
    """Layout of HBMAT with its defaults, as public readers of its files expect it, and numbers without blanks between.

    Those readers: war16641/GoodTool, ANSYS/HBFILEREAD.m (five lines of header, then one number per line, D for E, the
    right-hand side last); read_hbmat of AMfe.
    """
    model = simple()
    names = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
    mapping = [f"{i:12d}{node:12d}   {names[axis]}" for i, (node, axis) in enumerate(rows_of(model), start=1)]
    (tmp_path / "k.mapping").write_text("\n".join(["     Matrix Eqn      Node    DOF", *mapping]), encoding="utf-8")
    matrix = sparse.csc_array(sparse.tril(model.stiffness))
    matrix.sort_indices()
    n, (per_line, width) = matrix.shape[0], (1, 14) if form == "lines" else (7, 3)
    blocks = [[f"{v + 1:{width}d}" for v in index] for index in (matrix.indptr, matrix.indices)]
    blocks += [[f"{v:25.15E}".replace("E", "D") for v in values] for values in (matrix.data, np.ones(n))]
    blocks = [["".join(block[k : k + per_line]) for k in range(0, len(block), per_line)] for block in blocks]
    counts = [len(block) for block in blocks]
    path = tmp_path / "k.matrix"
    head = [
        "",
        "".join(f"{count:14d}" for count in (sum(counts), *counts)),
        f"RSA           {n:14d}{n:14d}{matrix.nnz:14d}{0:14d}",
        f"({per_line}I{width})".ljust(16) * 2 + f"({per_line}D25.15)".ljust(20) * 2,
        f"F             {1:14d}{n:14d}",
    ]
    path.write_text("\n".join([*head, *(line for block in blocks for line in block)]), encoding="utf-8")
    found = read_labelled(path, None, ())
    assert found.rows == tuple((node, axis) for node, axis in rows_of(model))
    assert abs(found.matrix - model.stiffness).max() < 1e-14 * abs(model.stiffness).max()


@pytest.mark.parametrize(("old", "new"), [("  1  3", "  1 99"), (" 1 4 2", " 1 7 2")])
def test_harwell_boeing_file_with_indices_outside_the_matrix_is_refused(tmp_path: Path, old: str, new: str) -> None:
    """Places of columns and numbers of rows, which scipy would follow in memory."""
    matrix = sparse.csc_array(np.diag([2.0] * 6) - np.diag([1.0] * 3, 3) - np.diag([1.0] * 3, -3))
    hb_write(tmp_path / "k.matrix", matrix)
    text = (tmp_path / "k.matrix").read_text(encoding="utf-8")
    head = "\n".join(text.splitlines()[4:])
    assert old in head, head
    (tmp_path / "k.matrix").write_text(text.replace(old, new), encoding="utf-8")
    names = [f"{i + 1} {1 + i // 3} {('UX', 'UY', 'UZ')[i % 3]}" for i in range(6)]
    (tmp_path / "k.mapping").write_text("\n".join(names), encoding="utf-8")
    (tmp_path / "nodes.lis").write_text("1 0 0 0\n2 1 0 0\n", encoding="utf-8")
    with pytest.raises(StructureError, match=r"k\.matrix: no Harwell-Boeing matrix can be read: "):
        beam_of(tmp_path / "k.matrix", tmp_path / "nodes.lis")


def test_nastran_output4_of_pynastran_has_the_frequencies_of_the_cantilever() -> None:
    """Six rows per grid point and nothing held: the clamp is added as a support of the structure file would be."""
    folder = HERE / "nastran"
    found = read_program_files(
        ProgramFiles(stiffness=folder / "kgg.op4", mass=folder / "mgg.op4", nodes=folder / "beam.bdf")
    )
    np.testing.assert_allclose(found.nodes[:, 0], np.linspace(0, 1, 5))
    free = np.arange(6, 30)
    clamp = replace(found, stiffness=found.stiffness[free][:, free], mass=found.mass[free][:, free])
    root = brentq(lambda x: np.cos(x) * np.cosh(x) + 1, 1.5, 2.0)
    expected = root**2 / (2 * np.pi) * np.sqrt(70e9 * 1.3e-8 / (2700 * 4e-4))
    # cubic elements with consistent mass are (beta h)^4 / 1440 too stiff
    excess = (root / 4) ** 4 / 1440
    np.testing.assert_allclose(frequencies(clamp, 2), expected * (1 + excess), rtol=2e-6)


BEAM = np.array([[k, axis] for k in range(10, 51, 10) for axis in range(1, 7)])  # rows of nastran/beam.bdf


@pytest.mark.parametrize("form", ["sparse", "large sparse", "punch"])
def test_sparse_output4_and_punch_files_have_the_matrices_of_dense_ones(tmp_path: Path, form: str) -> None:
    """Both matrices in one file: each is found by the first letter of its name. Punched numbers have ten digits."""
    folder = HERE / "nastran"
    dense = read_program_files(
        ProgramFiles(stiffness=folder / "kgg.op4", mass=folder / "mgg.op4", nodes=folder / "beam.bdf")
    )
    both = {"MGG": dense.mass.toarray(), "KGG": dense.stiffness.toarray()}
    rows = [(int(node), int(axis)) for node, axis in BEAM]
    text = dmig(both, rows) if form == "punch" else sparse_output4(both, large=form == "large sparse")
    path = tmp_path / ("beam.pch" if form == "punch" else "beam.op4")
    path.write_text(text, encoding="utf-8")
    found = read_program_files(ProgramFiles(stiffness=path, mass=path, nodes=folder / "beam.bdf"))
    np.testing.assert_array_equal(found.dofs, dense.dofs)
    for name, exact in (("stiffness", dense.stiffness), ("mass", dense.mass)):
        np.testing.assert_allclose(getattr(found, name).toarray(), exact.toarray(), rtol=1e-9, err_msg=name)


def beam_of(path: Path, nodes: Path = HERE / "nastran" / "beam.bdf") -> Matrices:
    """Return the matrices of one file with both."""
    return read_program_files(ProgramFiles(stiffness=path, mass=path, nodes=nodes))


@pytest.fixture(scope="module")
def formatted() -> Matrices:
    """The beam of pyNastran's formatted files."""
    folder = HERE / "nastran"
    return read_program_files(
        ProgramFiles(stiffness=folder / "kgg.op4", mass=folder / "mgg.op4", nodes=folder / "beam.bdf")
    )


@pytest.mark.parametrize("name", ["dense", "sparse", "large"])
def test_binary_output4_of_pyyeti_has_the_matrices_of_formatted_files(formatted: Matrices, name: str) -> None:
    """The sparse file has its bytes in the order of the network."""
    found = beam_of(HERE / "nastran" / f"{name}.op4")
    np.testing.assert_array_equal(found.dofs, formatted.dofs)
    for matrix in ("stiffness", "mass"):
        np.testing.assert_array_equal(getattr(found, matrix).toarray(), getattr(formatted, matrix).toarray())


@pytest.mark.parametrize("form", ["dense", "sparse", "large"])
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("word", [4, 8])
@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_output4_is_read_in_every_layout(
    tmp_path: Path, formatted: Matrices, order: str, word: int, single: bool, form: str
) -> None:
    """Written by the records of the guide; with 64-bit integers single precision has 64 bits too."""
    both = {"MGG": formatted.mass.toarray(), "KGG": formatted.stiffness.toarray()}
    path = tmp_path / "beam.op4"
    path.write_bytes(binary_output4(both, order=order, word=word, single=single, form=form))
    found = beam_of(path)
    for name, exact in (("stiffness", formatted.stiffness), ("mass", formatted.mass)):
        rounding = 2.0**-24 if single and word == 4 else 0.0
        np.testing.assert_allclose(getattr(found, name).toarray(), exact.toarray(), rtol=rounding, err_msg=name)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[:-4], "expected a record, found another length at its end"),
        (lambda data: data[:2000], "expected a record, found another length at its end"),
        (lambda data: data[:32], "KGG: expected a column, found the end of the file"),
        (lambda data: data[:16] + b"\x04" + data[17:], "expected a real matrix"),
        (lambda data: data[:32] + b"\x08\0\0\0" + bytes(8) + b"\x08\0\0\0" + data[32:], "a record of 8 bytes"),
        (lambda data: data + b"\x0c\0\0\0" + bytes(12) + b"\x0c\0\0\0", "expected the header of a matrix, found"),
        (lambda data: data[:36] + b"\0\0\0\0" + data[40:], "column 0: the column is invalid"),
        (lambda data: data[:40] + b"\xff\0\0\0" + data[44:], "column 1: the column is invalid"),
    ],
)
def test_damaged_binary_output4_is_refused(
    tmp_path: Path, formatted: Matrices, change: Callable[[bytes], bytes], message: str
) -> None:
    data = binary_output4({"KGG": formatted.stiffness.toarray()})
    (tmp_path / "k.op4").write_bytes(change(data))
    with pytest.raises(StructureError, match=message):
        beam_of(tmp_path / "k.op4")


@pytest.mark.parametrize("length", [b"\0\0\0\0", b"\x05\0\x02\0", b"\x01\0\x04\0"])
def test_damaged_string_of_a_sparse_column_is_refused(tmp_path: Path, length: bytes) -> None:
    """A string of no words, of one word, and of more than the record has."""
    data = binary_output4({"KGG": np.eye(30)}, form="sparse")
    (tmp_path / "k.op4").write_bytes(data[:48] + length + data[52:])
    with pytest.raises(StructureError, match="column 1: the column is invalid"):
        beam_of(tmp_path / "k.op4")


SPRINGS = (3e4, 5e4)  # N/m, of two springs in a row from node 50 to the ground, a scalar point between them


def _with_scalar_point(
    formatted: Matrices, springs: tuple[float, float] = SPRINGS
) -> tuple[FloatArray, FloatArray, list[tuple[int, int]]]:
    """Return stiffness, mass and rows of the beam with scalar point 25, of which the row is after that of node 20."""
    rows = [(int(node), int(axis)) for node, axis in BEAM]
    at = rows.index((30, 1))
    stiffness, mass = (
        np.insert(np.insert(matrix.toarray(), at, 0.0, axis=0), at, 0.0, axis=1)
        for matrix in (formatted.stiffness, formatted.mass)
    )
    rows.insert(at, (25, 0))
    tip = rows.index((50, 3))
    stiffness[np.ix_([tip, at], [tip, at])] += springs[0] * np.array([[1, -1], [-1, 1]])
    stiffness[at, at] += springs[1]
    return stiffness, mass, rows


@pytest.mark.parametrize("form", ["binary", "formatted", "punch"])
@pytest.mark.parametrize("card", ["SPOINT,25", "SPOINT,25,THRU,25"])
def test_scalar_points_without_mass_are_condensed(tmp_path: Path, formatted: Matrices, form: str, card: str) -> None:
    """Springs k and c in a row are k c / (k + c); rounding is relative to the largest stiffness."""
    stiffness, mass, rows = _with_scalar_point(formatted)
    both = {"KGG": stiffness, "MGG": mass}
    path = tmp_path / ("beam.pch" if form == "punch" else "beam.op4")
    if form == "binary":
        path.write_bytes(binary_output4(both))
    else:
        path.write_text(dmig(both, rows) if form == "punch" else sparse_output4(both, large=False), encoding="utf-8")
    nodes = tmp_path / "beam.bdf"
    nodes.write_text((HERE / "nastran" / "beam.bdf").read_text(encoding="utf-8") + f"{card}\n", encoding="utf-8")
    found = beam_of(path, nodes)
    expected = formatted.stiffness.toarray()
    tip = int(formatted.dofs[4, 2])
    expected[tip, tip] += SPRINGS[0] * SPRINGS[1] / sum(SPRINGS)
    np.testing.assert_array_equal(found.dofs, formatted.dofs)
    np.testing.assert_allclose(found.stiffness.toarray(), expected, rtol=1e-9, atol=1e-15 * expected.max())


def scalar_file(
    folder: Path, stiffness: FloatArray, mass: FloatArray, groups: Mapping[str, Path] = MappingProxyType({})
) -> ProgramFiles:
    """Return files of the beam with scalar point 25."""
    (folder / "beam.op4").write_bytes(binary_output4({"KGG": stiffness, "MGG": mass}))
    text = (HERE / "nastran" / "beam.bdf").read_text(encoding="utf-8")
    (folder / "beam.bdf").write_text(text + "SPOINT,25\n", encoding="utf-8")
    both = folder / "beam.op4"
    return ProgramFiles(stiffness=both, mass=both, nodes=folder / "beam.bdf", groups=groups)


def test_scalar_point_that_moves_without_force_is_refused(tmp_path: Path, formatted: Matrices) -> None:
    stiffness, mass, rows = _with_scalar_point(formatted)
    at = rows.index((25, 0))
    stiffness[at, at] -= sum(SPRINGS)
    with pytest.raises(StructureError, match="25: a motion needs no force"):
        read_program_files(scalar_file(tmp_path, stiffness, mass))


def test_scalar_point_with_mass_is_an_oscillator(tmp_path: Path, formatted: Matrices) -> None:
    """A mass between two springs in a row from the tip to the ground: its frequencies are those of the file's rows.

    The beam is clamped at its first node. Its total mass, the sum over translations along z, is without the oscillator.
    """
    stiffness, mass, rows = _with_scalar_point(formatted)
    at = rows.index((25, 0))
    mass[at, at] = 0.3
    found = read_program_files(scalar_file(tmp_path, stiffness, mass))
    place, axis = (int(k[0]) for k in np.nonzero(found.dofs == found.stiffness.shape[0] - 1 - (len(rows) - 1 - at)))
    assert (place, axis) == (len(formatted.nodes), 3)
    assert (found.nodes[place] > found.nodes[:-1].max(axis=0)).all()
    free = np.arange(6, len(rows))
    value = eigh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)], eigvals_only=True, subset_by_index=[0, 3])
    clamped = replace(found, stiffness=found.stiffness[free][:, free], mass=found.mass[free][:, free])
    np.testing.assert_allclose(frequencies(clamped, 4), np.sqrt(value) / (2 * np.pi), rtol=1e-9)
    along = [one.dofs[:, 2][one.dofs[:, 2] >= 0] for one in (found, formatted)]
    total = [one.mass[d][:, d].sum() for one, d in zip((found, formatted), along, strict=True)]
    assert total[0] == pytest.approx(total[1], rel=1e-12)


def test_scalar_point_of_a_group_is_kept(tmp_path: Path, formatted: Matrices) -> None:
    """The group is both springs: with a factor of a half on it, the point between them is softer too."""
    stiffness, mass, rows = _with_scalar_point(formatted)
    springs = stiffness - _with_scalar_point(formatted, (0.0, 0.0))[0]
    (tmp_path / "springs.op4").write_bytes(binary_output4({"KGG": springs}))
    found = read_program_files(scalar_file(tmp_path, stiffness, mass, groups={"springs": tmp_path / "springs.op4"}))
    softer = (found.stiffness - 0.5 * found.groups["springs"]).toarray()
    np.testing.assert_allclose(softer, stiffness - 0.5 * springs, rtol=1e-12, atol=1e-12 * stiffness.max())
    assert len(rows) == found.stiffness.shape[0]


def test_dmig_entries_in_small_and_free_fields_are_read(tmp_path: Path) -> None:
    """Two entries per line, and numbers with no letter at their exponent."""
    (tmp_path / "k.bdf").write_text(
        "DMIG    K2GG           0       6       1       0\n"
        "DMIG    K2GG           1       1               1       1  2.5+4        +A\n"
        "+A             2       1 -2.5+4               2       2    7.5        +B\n"
        "DMIG,K2GG,2,1,,2,1,2.5+4\nDMIG,M2GG,0,6,1,0\nDMIG,M2GG,2,2,,2,2,3.\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\n",
        encoding="utf-8",
    )
    found = read_program_files(
        ProgramFiles(stiffness=tmp_path / "k.bdf", mass=tmp_path / "k.bdf", nodes=tmp_path / "k.bdf")
    )
    np.testing.assert_array_equal(found.stiffness.toarray(), [[2.5e4, -2.5e4, 7.5], [-2.5e4, 2.5e4, 0], [7.5, 0, 0]])
    np.testing.assert_array_equal(found.mass.toarray(), np.diag([0.0, 0.0, 3.0]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("       0       6       2", "       0       9       2"), "holds no square matrix"),
        (lambda text: text.replace("       6       2", "       6       4"), "expected a real matrix"),
        (lambda text: text.replace("KGG ", "QGG "), "expected a matrix with a name in K, found QGG, MGG"),
        (lambda text: text.replace(f"{50:16d}{6:16d}", f"{50:16d}{0:16d}"), "node 50: expected degrees of freedom 1"),
        (lambda text: text.replace(f"{50:16d}{6:16d}", f"{50:16d}{'x':>16s}"), "expected a node and a degree of freed"),
        (lambda text: re.sub(r"D[+]08$", "D*08", text, flags=re.MULTILINE), "DMIG: expected a number, found '1.12000"),
        (lambda text: re.sub(r"^[*] .*\n", "", text, flags=re.MULTILINE), "no matrix can be read: KGG has no entries"),
    ],
)
def test_invalid_dmig_entries_are_refused(tmp_path: Path, change: object, message: str) -> None:
    assert callable(change)
    folder = HERE / "nastran"
    dense = read_program_files(
        ProgramFiles(stiffness=folder / "kgg.op4", mass=folder / "mgg.op4", nodes=folder / "beam.bdf")
    )
    both = {"KGG": dense.stiffness.toarray(), "MGG": dense.mass.toarray()}
    path = tmp_path / "beam.pch"
    path.write_text(change(dmig(both, [(int(node), int(axis)) for node, axis in BEAM])), encoding="utf-8")
    with pytest.raises(StructureError, match=message):
        read_program_files(ProgramFiles(stiffness=path, mass=path, nodes=folder / "beam.bdf"))


@needs_opensees
def test_opensees_domain_is_read_with_groups_and_tied_nodes() -> None:
    """A frame with a rigid floor: two columns, of which one is a group, and a mass at the floor's retained node."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, place in enumerate([(0, 0, 0), (4, 0, 0), (0, 0, 3), (4, 0, 3), (2, 0, 3)], start=1):
        ops.node(tag, *map(float, place))
    ops.fix(1, 1, 1, 1, 1, 1, 1)
    ops.fix(2, 1, 1, 1, 1, 1, 1)
    ops.fix(5, 0, 0, 1, 1, 1, 0)
    ops.geomTransf("Linear", 1, 1, 0, 0)
    for tag, (low, high) in enumerate([(1, 3), (2, 4)], start=1):
        ops.element("elasticBeamColumn", tag, low, high, 1e-2, 2e11, 8e10, 1e-5, 2e-5, 3e-5, 1)
    ops.rigidDiaphragm(3, 5, 3, 4)
    ops.mass(5, 500.0, 500.0, 0.0, 0.0, 0.0, 700.0)
    found = opensees_matrices(ops, {"column": [1]})
    ops.wipe()
    at = [int(np.argmin(np.linalg.norm(found.nodes - place, axis=1))) for place in ([0, 0, 3], [2, 0, 3])]
    assert (found.dofs[at[0]] >= 0).tolist() == [False, False, True, True, True, False]
    assert (found.dofs[at[1]] >= 0).tolist() == [True, True, False, False, False, True]
    sway = found.dofs[at[1], 0]
    both, one = (matrix[[sway]][:, [sway]].toarray()[0, 0] for matrix in (found.stiffness, found.groups["column"]))
    assert both == pytest.approx(2 * one, rel=1e-12)
    assert sorted([12 * 2e11 * second / 27 for second in (2e-5, 3e-5)]) == pytest.approx(
        sorted(found.groups["column"].diagonal()[found.dofs[at[1], :2]].tolist()), rel=1e-9
    )
    assert found.mass.diagonal()[found.dofs[at[1], [0, 1, 5]]].tolist() == [500.0, 500.0, 700.0]


@needs_opensees
def test_opensees_groups_need_elements_of_the_domain() -> None:
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    ops.node(1, 0.0, 0.0, 0.0)
    with pytest.raises(ModelError, match="group foot: the domain of OpenSees has no element 7"):
        opensees_matrices(ops, {"foot": [7]})
    ops.node(2, 1.0, 0.0, 0.0)
    ops.geomTransf("Linear", 1, 0, 1, 0)
    ops.element("elasticBeamColumn", 7, 1, 2, 1e-4, 2e11, 8e10, 1e-8, 1e-8, 1e-8, 1)
    with pytest.raises(ModelError, match="groups foot and post share the element 7 of OpenSees"):
        opensees_matrices(ops, {"foot": [7], "post": [7]})
    ops.wipe()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("strip.sti", "1 1 x\n", r"strip\.sti: expected 3 numbers per line, found '1 1 x'"),
        ("strip.sti", "1 900 2.0\n", "expected 72 rows, as many as there are names of them, found row 900"),
        ("strip.sti", "1 2\n", "expected a matrix of Abaqus, CalculiX, Ansys"),
        ("strip.sti", "", "the file is empty"),
        ("strip.dof", "5.1\n5.1\n", r"strip\.dof: node 5: degree of freedom 1 is there twice"),
        ("strip.dof", "5.9\n", r"strip\.dof: node 5: expected degrees of freedom 1 to 6, found 9"),
        ("strip.dof", "five\n", r"expected NODE\.AXIS, found 'five'"),
        ("strip.inp", "*NODE\n1, 0, 0\n", r"node 9 has rows in strip\.sti, and no position"),
        ("strip.inp", "*NODE\n5, 0, nan\n", "no nodes can be read: node 5 is not finite"),
        ("strip.inp", "*HEADING\n", "no nodes can be read"),
    ],
)
def test_invalid_files_are_refused_with_the_file_and_the_line(
    tmp_path: Path, name: str, text: str, message: str
) -> None:
    for file in ("strip.sti", "strip.mas", "strip.dof", "strip.inp"):
        content = text if file == name else (CALCULIX / file).read_text(encoding="utf-8")
        (tmp_path / file).write_text(content, encoding="utf-8")
    with pytest.raises(StructureError, match=message):
        read_program_files(
            ProgramFiles(
                stiffness=tmp_path / "strip.sti",
                mass=tmp_path / "strip.mas",
                nodes=tmp_path / "strip.inp",
                rows=tmp_path / "strip.dof",
            )
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: re.sub(r"^(\s+1)\s+1\s+7", r"\1       0       9", text, flags=re.MULTILINE), "expected numbers"),
        (
            lambda text: text.replace("30      30       6       2", "30      30       6       4"),
            "expected a real matrix",
        ),
        (lambda text: text.replace("30      30", "24      24", 1), "expected 30 rows, six per node, found 24 x 24"),
        (lambda text: text.replace("1P,3E23.16", "          "), "column 1: expected numbers, found"),
        (lambda text: text[:400], "expected numbers"),
        (lambda text: "Nastran\n" + text, "expected an OUTPUT4 file, found 'Nastran'"),
        (lambda text: "", "no matrix can be read: the file is empty"),
    ],
)
def test_invalid_output4_files_are_refused(tmp_path: Path, change: object, message: str) -> None:
    assert callable(change)
    text = (HERE / "nastran" / "kgg.op4").read_text(encoding="utf-8")
    (tmp_path / "k.op4").write_text(change(text), encoding="utf-8")
    with pytest.raises(StructureError, match=message):
        read_program_files(
            ProgramFiles(stiffness=tmp_path / "k.op4", mass=tmp_path / "k.op4", nodes=HERE / "nastran" / "beam.bdf")
        )


def test_node_in_the_basic_coordinate_system_by_its_number_is_read(tmp_path: Path) -> None:
    (tmp_path / "m.bdf").write_text("GRID           1       0      0.   1.5-3      0.       0\n", encoding="utf-8")
    assert read_mesh(tmp_path / "m.bdf").nodes == {1: (0.0, 1.5e-3, 0.0)}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*NODE\n1,0,0\n*NODE\n1,5,0\n", "node 1 is at two places, as in several parts"),
        ("*NODE\n1,0,0\n*INSTANCE, NAME=a-1, PART=a\n0.,0.,7.\n", "an instance of a part is moved"),
    ],
)
def test_parts_with_positions_of_their_own_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "m.inp").write_text(text, encoding="utf-8")
    with pytest.raises(StructureError, match=f"m.inp: no nodes can be read: {message}"):
        read_mesh(tmp_path / "m.inp")
    (tmp_path / "m.inp").write_text(text.replace("7.", "0.").replace("1,5,0", "2,5,0"), encoding="utf-8")
    assert read_mesh(tmp_path / "m.inp").nodes[1] == (0.0, 0.0, 0.0)
