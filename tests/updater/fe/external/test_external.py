"""Matrices that another program made, in the place of a structure's members."""

from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from tests.support.thorough import few_of
from tests.support.updater.frames import N_MODES, beam, clamped, t_frame, t_truth, unmoved
from updater import (
    Body,
    MassUpdater,
    Matrices,
    Model,
    ModelError,
    StiffnessUpdater,
    Structure,
    StructureError,
    build_model,
    diagnose,
    dump_structure,
    learn_reference,
    load_structure,
    locate_mass,
    parse_structure,
    save_matrices,
    stack_tracks,
)
from updater.fe.external.files import whole_blocks
from updater.localization import spread_mass
from updater.structure import portable_text

FOOT = '\n[[support]]\nat = [0.0, 0.0, 0.0]\nfixed = ["x", "y", "z", "rx", "ry", "rz"]\n'


def matrices_of(model: Model) -> Matrices:
    """Return the output of another program: no rows for fixed directions, no separate springs."""
    free = (model.dofs >= 0).any(1)
    return Matrices(stiffness=model.stiffness, mass=model.mass, nodes=model.nodes[free], dofs=model.dofs[free])


def external_text(structure: Structure, files: str) -> str:
    lines = [f'name = "{structure.name}"\n[external]\n{files}\n{FOOT}']
    lines += [f'[[member]]\nname = "{m.name}"\nfrom = {list(m.start)}\nto = {list(m.end)}\n' for m in structure.member]
    lines += [
        f'[[sensor]]\nchannel = "{s.channel}"\nat = {list(s.at)}\ndirection = {list(s.direction)}\n'
        for s in structure.sensor
    ]
    return "\n".join(lines)


@pytest.fixture(scope="module")
def tower(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A structure file with an npz of a Timoshenko model of the T-frame."""
    folder = tmp_path_factory.mktemp("tower")
    model = build_model(t_frame(), shear_flexible=True, mass="consistent")
    save_matrices(folder / "tower.npz", matrices_of(model))
    (folder / "tower.toml").write_text(external_text(t_frame(), 'matrices = "tower.npz"'), encoding="utf-8")
    return folder / "tower.toml"


def test_external_model_has_modes_and_sensors_of_the_written_model(tower: Path) -> None:
    """Hermite's cubics differ from a Timoshenko element's by at most phi/4 = 1e-2 of its own bending."""
    own = build_model(t_frame(), shear_flexible=True, mass="consistent")
    model = build_model(load_structure(tower), mass="consistent")
    found, expected = model.modes(N_MODES), own.modes(N_MODES)
    np.testing.assert_allclose(found.frequency, expected.frequency, rtol=1e-9)
    seen, shape = model.sensor_rows @ found.shape, own.sensor_rows @ expected.shape
    np.testing.assert_allclose(np.abs(seen), np.abs(shape), atol=1e-3 * np.abs(shape).max())
    assert model.member_names == own.member_names
    # by translation of what is free: the foot's node has its half element's mass outside
    assert model.total_mass() == pytest.approx(own.total_mass() - 3.292 * 0.02, rel=3e-3)


def test_matrix_market_files_and_npz_have_the_same_content(tower: Path, tmp_path: Path) -> None:
    model = build_model(load_structure(tower), mass="consistent")
    save_matrices(tmp_path, matrices_of(model))
    files = 'stiffness = "stiffness.mtx"\nmass = "mass.mtx"\ndofs = "dofs.csv"'
    (tmp_path / "tower.toml").write_text(external_text(t_frame(), files), encoding="utf-8")
    other = build_model(load_structure(tmp_path / "tower.toml"), mass="consistent")
    assert abs(model.stiffness - other.stiffness).max() < 1e-16 * abs(model.stiffness).max()  # 17 digits
    np.testing.assert_allclose(other.modes(4).frequency, model.modes(4).frequency, rtol=1e-10)


@pytest.mark.parametrize("seed", few_of([11, 12]))
def test_mass_is_located_and_diagnosed_with_external_matrices(tower: Path, seed: int) -> None:
    """The truth is another frame: flexible foot and joint, 10 mm mesh, other E and density, gains that scatter."""
    truth = t_truth(seed)
    bare = truth.model()
    loaded = truth.model(Body(at=(0.25, 0, 1.48), mass=0.304))
    before = truth.windows(bare.modes(N_MODES), bare.sensor_rows, 8, seed)
    after = truth.windows(loaded.modes(N_MODES), loaded.sensor_rows, 4, seed + 100)
    reference = learn_reference(load_structure(tower), before, unmoved(8))
    assert [p.name for p in reference.calibration.parameters] == ["stiffness"]
    event = reference.mean_of(stack_tracks(after, unmoved(4)))
    change = locate_mass(reference, event)
    # foot and joint cannot be calibrated here, which costs place (raw FE: 13 mm median, a few times that at worst)
    assert change.member == "crossbeam"
    assert change.distance == pytest.approx(0.65, abs=0.05)
    assert change.mass == pytest.approx(0.304, rel=0.15)
    update = MassUpdater(reference).update(event)
    assert len(update.flagged)
    spread = spread_mass(reference, event)
    assert spread.mass.sum() == pytest.approx(0.304, rel=0.3)
    twin = StiffnessUpdater(reference).update(reference.baseline)
    assert set(twin.hinges.name) == {"column", "crossbeam"}
    assert not len(twin.flagged)
    explained = diagnose(reference, event)
    assert explained.diagnosis.causes[0].cause == "added_mass"


def test_extended_file_with_added_mass_is_read_back(tower: Path) -> None:
    structure = load_structure(tower).with_bodies([Body(at=(0.25, 0, 1.48), mass=0.304)])
    again = parse_structure(dump_structure(structure), tower.parent / "extended.toml")
    heavier = build_model(again, mass="consistent")
    assert heavier.total_mass() == pytest.approx(build_model(load_structure(tower)).total_mass() + 0.304, rel=1e-9)
    expected = build_model(t_frame().with_bodies(structure.body), shear_flexible=True, mass="consistent")
    np.testing.assert_allclose(heavier.modes(4).frequency, expected.modes(4).frequency, rtol=1e-6)


def test_diagnosed_causes_are_written_and_comments_are_kept(tower: Path, tmp_path: Path) -> None:
    text = "# as built\n" + tower.read_text(encoding="utf-8")
    structure = load_structure(tower).with_bodies([Body(at=(0.25, 0, 1.48), mass=0.304)])
    extended = dump_structure(structure, text)
    assert extended.startswith("# as built\n")
    assert parse_structure(extended, tmp_path / "extended.toml") == structure


def test_node_blocks_are_completed_without_changing_values() -> None:
    """Stored entries of the frame's assembly, zeros included, from the entries that are not zero."""
    model = build_model(t_frame(), shear_flexible=True)
    found = matrices_of(model)
    bare = model.stiffness.copy()
    bare.eliminate_zeros()
    whole = whole_blocks(bare, found.dofs)
    assert bare.nnz < model.stiffness.nnz == whole.nnz
    assert abs(whole - model.stiffness).max() == 0


def test_portable_text_contains_absolute_paths(tower: Path) -> None:
    text = portable_text(tower)
    assert parse_structure(text, "elsewhere/x.toml").external == load_structure(tower.resolve()).external
    assert str(tower.parent.resolve() / "tower.npz") in text


def test_lumped_masses_keep_the_total_and_are_positive(tower: Path) -> None:
    whole, lumped = (build_model(load_structure(tower), mass=kind) for kind in ("consistent", "lumped"))
    assert lumped.total_mass() == pytest.approx(whole.total_mass(), rel=1e-12)
    assert lumped.mass.diagonal().min() == 0  # rotations
    assert (lumped.mass.diagonal()[lumped.dofs[lumped.dofs[:, 0] >= 0][:, 0]] > 0).all()


def test_translation_only_nodes_are_interpolated_and_loose_nodes_read_directly(tmp_path: Path) -> None:
    """A chain of springs in y: u_y = (0.1, 0.2, 0.4) at x = 1, 2, 3 and one more node off the line."""
    dofs = np.full((5, 6), -1, np.int32)
    dofs[1:, 1] = np.arange(4)
    nodes = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [3, 1, 0]], float)
    stiffness = sparse.csc_array(np.diag([2.0, 2, 2, 1]) - np.diag([1.0, 1, 1], 1) - np.diag([1.0, 1, 1], -1))
    mass = sparse.csc_array(np.eye(4))
    save_matrices(tmp_path / "m.npz", Matrices(stiffness=stiffness, mass=mass, nodes=nodes, dofs=dofs))
    text = 'name = "chain"\n[external]\nmatrices = "m.npz"\n[[member]]\nname = "c"\nfrom = [0, 0, 0]\nto = [3, 0, 0]\n'
    model = build_model(parse_structure(text, tmp_path / "c.toml"), mass="consistent")
    moved = np.array([0.1, 0.2, 0.4, 0.7])
    assert model.read(np.array([2.25, 0, 0])) @ moved == pytest.approx([0, 0.25, 0, 0, 0, 0.2])
    assert model.read(np.array([0.5, 0, 0]), 1) @ moved == pytest.approx(0.05)
    assert model.read(np.array([3, 1, 0]), 1) @ moved == pytest.approx(0.7)
    with pytest.raises(ModelError, match="on no member"):
        model.read(np.array([3, 0.5, 0]))
    # fixed-free chain of four: omega = 2 sin((2 j - 1) pi / 18)
    expected = 2 * np.sin((2 * np.arange(1, 5) - 1) * np.pi / 18) / (2 * np.pi)
    np.testing.assert_allclose(model.modes(4).frequency, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "row", "column", "value", "message"),
    [
        ("stiffness", 3, 4, 1e9, r"m\.npz: stiffness: not symmetric between ry at \[0\.3333, 0\.0, 0\.0\] \(row 4\)"),
        ("stiffness", 3, 3, -1.0, r"stiffness: -1 on the diagonal of rx at \[0\.3333, 0\.0, 0\.0\] \(row 3\)"),
        ("stiffness", 5, 5, np.nan, "stiffness: an entry is not finite"),
        ("mass", 6, 6, -2.0, r"mass: -2 on the diagonal of x at \[0\.6667"),
    ],
)
def test_invalid_matrices_are_refused_with_the_row(
    tmp_path: Path, name: str, row: int, column: int, value: float, message: str
) -> None:
    found = matrices_of(build_model(beam(length=1.0, elements=3, support=clamped()), mass="consistent"))
    spoilt = getattr(found, name).toarray()
    spoilt[row, column] = value
    fields = vars(found) | {name: sparse.csc_array(spoilt)}
    save_matrices(tmp_path / "m.npz", Matrices(**fields))
    with pytest.raises(StructureError, match=message):
        build_model(_beam_of(tmp_path, 'matrices = "m.npz"'))


def _beam_of(folder: Path, files: str) -> Structure:
    member = '[[member]]\nname = "b"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\n'
    return parse_structure(f'name = "b"\n[external]\n{files}\n{FOOT}{member}', folder / "b.toml")


def test_indefinite_matrices_are_refused(tmp_path: Path) -> None:
    """Diagonals are positive, but one pair of DOFs is coupled more strongly than a structure's can be."""
    found = matrices_of(build_model(beam(length=1.0, elements=3, support=clamped()), mass="consistent"))
    for name, match in (("mass", "negative kinetic energy"), ("stiffness", "stiffness is indefinite")):
        spoilt = getattr(found, name).toarray()
        spoilt[0, 6] = spoilt[6, 0] = 2 * spoilt[0, 0]
        save_matrices(tmp_path / f"{name}.npz", Matrices(**vars(found) | {name: sparse.csc_array(spoilt)}))
        with pytest.raises((StructureError, ModelError), match=match):
            build_model(_beam_of(tmp_path, f'matrices = "{name}.npz"'), mass="consistent").modes(2)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("node,x,y,z,axis\n1,0,0,1,w\n", r"d\.csv: line 2: expected node, x, y, z, axis \(x, y, z, rx, ry, rz\)"),
        ("node,x,y,z\n1,0,0,1\n", "line 2: expected node, x, y, z, axis"),
        ("node,x,y,z,axis\n1,0,0,1,y\n1,0,0,1,y\n", "line 3: node 1 has y already"),
        ("node,x,y,z,axis\n1,0,0,1,y\n", r"m\.npz: expected 1 x 1 entries as d\.csv has rows, found \(18, 18\)"),
    ],
)
def test_inconsistent_dof_table_is_refused_with_the_line(tmp_path: Path, table: str, message: str) -> None:
    model = build_model(beam(length=1.0, elements=3, support=clamped()), mass="consistent")
    save_matrices(tmp_path / "m.npz", matrices_of(model))
    (tmp_path / "d.csv").write_text(table, encoding="utf-8")
    with pytest.raises(StructureError, match=message):
        build_model(_beam_of(tmp_path, 'matrices = "m.npz"\ndofs = "d.csv"'))


def test_missing_and_invalid_matrix_files_are_named_in_the_error(tmp_path: Path) -> None:
    with pytest.raises(StructureError, match=r"none\.npz: cannot be read"):
        build_model(_beam_of(tmp_path, 'matrices = "none.npz"'))
    (tmp_path / "text.npz").write_text("no", encoding="utf-8")
    with pytest.raises(StructureError, match=r"text\.npz: stiffness: no matrix can be read"):
        build_model(_beam_of(tmp_path, 'matrices = "text.npz"'))


def test_members_and_supports_without_nodes_are_named_in_the_error(tower: Path) -> None:
    structure = load_structure(tower)
    longer = structure.member[1].model_copy(update={"end": (0.5, 0, 1.48)})
    wrong = structure.model_copy(update={"member": (structure.member[0], longer)})
    with pytest.raises(ModelError, match="member crossbeam: the matrices need a node at each end"):
        build_model(wrong)
    sensor = structure.sensor[0].model_copy(update={"at": (0.1, 0.1, 0.3)})
    with pytest.raises(ModelError, match=r"a sensor: the point \[0\.1, 0\.1, 0\.3\] lies on no member"):
        _ = build_model(structure.model_copy(update={"sensor": (sensor,)})).sensor_rows
    spring = structure.support[0].model_copy(update={"at": (0.0, 0.0, 0.5), "fixed": (), "stiffness": {"x": 1.0}})
    with pytest.raises(ModelError, match=r"support at \[0\.0, 0\.0, 0\.5\]: the matrices have no node there"):
        build_model(structure.model_copy(update={"support": (*structure.support, spring)}))
