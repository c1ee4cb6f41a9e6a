"""Groups of external matrices: panels and feet of a table whose stiffness changes.

The model is made of OpenSees' ShellMITC4 elements of 0.1 m, the measured table of scikit-fem's Morley triangles, three
times as fine: thick and thin plates, other elements, another mesh.
"""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse

from daq import FloatArray
from tests.support.opensees import needs_opensees
from tests.support.thorough import few_of
from tests.support.updater.frames import unmoved
from tests.support.updater.plates import COARSE, FEET, N_MODES, Table, windows, write_table
from updater import (
    DiagnosisResult,
    Reference,
    StructureError,
    build_model,
    diagnose,
    dump_structure,
    learn_reference,
    load_structure,
    parse_structure,
    stack_tracks,
)
from updater.causes import CATALOGUE, JointHypothesis, SelectedCause, prediction
from updater.causes.stiffness.group_stiffness import GroupStiffness
from updater.fe import Matrices, read_matrices, save_matrices
from updater.inference import compare
from updater.quantities import Quantity
from updater.reference import channel_rows

pytestmark = needs_opensees

#: truth; cause, place and parameter that are expected
EFFECTS: dict[str, tuple[dict[str, Any], list[tuple[str, str, str, float]]]] = {
    "panel": ({"factors": {"panel_10": 0.7}}, [("local_stiffness", "panel_10", "loss", 0.3)]),
    "panel at a corner": ({"factors": {"panel_01": 0.8}}, [("local_stiffness", "panel_01", "loss", 0.2)]),
    "loose foot": ({"factors": {"foot_ne": 0.5}}, [("local_stiffness", "foot_ne", "loss", 0.5)]),
    "looser foot": ({"factors": {"foot_ne": 0.3}}, [("local_stiffness", "foot_ne", "loss", 0.7)]),
    "mass": ({"mass": (0.9, 0.6, 0.15)}, [("added_mass", "y = 0.6", "mass", 0.15)]),
    "mass of 300 g": ({"mass": (0.9, 0.6, 0.3)}, [("added_mass", "y = 0.6", "mass", 0.3)]),
    "mass of 600 g": ({"mass": (0.9, 0.6, 0.6)}, [("added_mass", "y = 0.6", "mass", 0.6)]),
    "panel and mass": (
        {"factors": {"panel_01": 0.7}, "mass": (1.15, 0.2, 0.3)},
        [("added_mass", "y = 0.2", "mass", 0.3), ("local_stiffness", "panel_01", "loss", 0.3)],
    ),
    "nothing": ({}, []),
}
SEEDS = (1, 2, 3, 4)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_table(tmp_path_factory.mktemp("table"))


@pytest.fixture(scope="module")
def own(table: Path) -> Reference:
    """A reference whose modes are the model's own: predictions must agree with the extended structure."""
    random = np.random.default_rng(1)
    learnt = learn_reference(load_structure(table), windows(Table().modes(), 8, random), unmoved(8, N_MODES))
    modes = learnt.calibration.modes
    return replace(learnt, frequency=modes.frequency, shape=modes.shape)


@pytest.mark.parametrize(
    "factors", [{"panel_11": 0.7}, {"foot_se": 0.1}, {"foot_sw": 1.8}, {"panel_00": 0.6, "foot_sw": 0.5}]
)
def test_predicted_modes_agree_with_those_of_the_extended_structure(own: Reference, factors: dict[str, float]) -> None:
    """Sixty modes and forty states of self-stress miss a full solution by 2e-5 of frequency (measured)."""
    data = compare(own, own.baseline)
    cause = CATALOGUE["local_stiffness"].propose(own, data)
    assert cause is not None
    groups: tuple[str, ...] = cause.group  # type: ignore[attr-defined]
    chosen = [SelectedCause(cause, groups.index(name), np.array([-np.log(f)])) for name, f in factors.items()]
    predicted = prediction(data, chosen)
    structure = own.structure
    for one in chosen:
        structure = one.cause.extend(structure, one.row, one.theta)
    model = build_model(structure, mass="consistent")
    modes = model.modes(16)
    seen = (channel_rows(model, data.channels) @ modes.shape).T
    frequency = data.frequency[data.paired] * np.exp(predicted.log_ratio[0])
    unit = seen / np.linalg.norm(seen, axis=1, keepdims=True)
    partner = np.argmax(
        np.abs(predicted.shape[0] @ unit.T) - 5 * np.abs(np.log(frequency[:, None] / modes.frequency)), axis=1
    )
    np.testing.assert_allclose(frequency, modes.frequency[partner], rtol=1e-4)


def _diagnosed(table: Path, effect: str, seed: int, only: tuple[str, ...] = ()) -> tuple[Reference, DiagnosisResult]:
    """Return the diagnosis of four windows after eight before; the modulus of the measured table scatters by 2 %."""
    random = np.random.default_rng(seed)
    modulus = 70e9 * (1 + 0.02 * random.standard_normal())
    before = windows(Table(modulus=modulus).modes(), 8, random)
    after = windows(Table(modulus=modulus, **EFFECTS[effect][0]).modes(), 4, random)
    reference = learn_reference(load_structure(table), before, unmoved(8, N_MODES))
    event = reference.mean_of(stack_tracks(after, unmoved(4, N_MODES)))
    return reference, diagnose(reference, event, only=only)


def _named(found: DiagnosisResult) -> dict[tuple[str, str], dict[str, Quantity]]:
    """Return the parameters by cause and place."""
    return {(c.cause, (c.where and c.where.member) or ""): dict(c.parameters) for c in found.diagnosis.causes}


def _errors(effect: str, found: DiagnosisResult) -> list[float] | None:
    """Return the errors over their standard deviations; None if the causes or places are others than expected."""
    expected, named = EFFECTS[effect][1], _named(found)
    if sorted(named) != sorted((cause, place) for cause, place, *_ in expected):
        return None
    pairs = [(named[cause, place][key], value) for cause, place, key, value in expected]
    return [(quantity.value - value) / quantity.std for quantity, value in pairs if quantity.std]


@pytest.mark.parametrize("only", few_of([("local_stiffness", "added_mass"), ((),)]))
def test_weak_panel_of_a_table_is_named_and_written(table: Path, only: tuple[str, ...]) -> None:
    reference, found = _diagnosed(table, "panel", 1, only)
    errors = _errors("panel", found)
    assert errors is not None
    assert abs(errors[0]) < 3
    assert found.extended is not None
    before, after = (s.external for s in (reference.structure, found.extended))
    assert before is not None
    assert after is not None
    assert after.group["panel_10"].factor == pytest.approx(0.7 * before.group["panel_10"].factor, rel=0.03)


@pytest.mark.thorough
def test_mesh_that_is_coarse_brings_in_no_further_cause(tmp_path: Path) -> None:
    """Frequencies of this mesh are up to 13 % too high. A body of 75 g was named in addition when this was unknown."""
    effect = "panel at a corner"
    _, found = _diagnosed(write_table(tmp_path, mesh=COARSE), effect, 1)
    errors = _errors(effect, found)
    print(_named(found))
    assert errors is not None
    assert abs(errors[0]) < 3


@pytest.mark.thorough
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("mesh", [None, COARSE], ids=["15 x 8", "coarse"])
def test_effects_are_named_or_refused_and_deviations_state_the_errors(
    tmp_path: Path, mesh: tuple[FloatArray, FloatArray] | None
) -> None:
    """No effect is named as another one. Of 36 sizes, 28 or fewer within two deviations have a chance of 0.02 %.

    A coarse mesh may hide the smaller one of two effects (docs/validation/model/groups.md).
    """
    table, size = write_table(tmp_path, mesh=mesh), list[float]()
    for effect, seed in product(EFFECTS, SEEDS):
        found = _diagnosed(table, effect, seed)[1]
        errors = _errors(effect, found)
        print(effect, seed, found.diagnosis.verdict, _named(found), errors)
        size += errors or []
        part = set(_named(found)) < {(cause, place) for cause, place, *_ in EFFECTS[effect][1]}
        refused = found.diagnosis.verdict in {"unexplained", "ambiguous"}
        assert errors is not None or (mesh is not None and (refused or part))
    within = [sum(abs(error) < n for error in size) for n in (1, 2)]
    print(f"{len(size)} sizes, {within[0]} within one deviation, {within[1]} within two")
    assert within[1] >= 0.8 * len(size)


def test_feet_are_calibrated_from_half_their_stiffness(table: Path) -> None:
    """Feet are uncertain by their own figure; a foot that is softer than in the file is found by the calibration."""
    random = np.random.default_rng(3)
    before = windows(Table(factors={"foot_nw": 0.6}).modes(), 8, random)
    reference = learn_reference(load_structure(table), before, unmoved(8, N_MODES))
    factors = {p.name.removeprefix("stiffness of "): p.value for p in reference.calibration.parameters}
    assert factors["foot_nw"] == pytest.approx(0.6, rel=0.1)
    assert all(factors[name] == pytest.approx(1.0, rel=0.15) for name in FEET if name != "foot_nw")


def test_factor_is_written_into_the_text_and_read_back(table: Path) -> None:
    text = "# as built\n" + table.read_text(encoding="utf-8")
    structure = load_structure(table)
    assert structure.external is not None
    softer = structure.model_copy(update={"external": structure.external.with_factor("foot_ne", 0.4)})
    written = dump_structure(softer, text)
    assert written.startswith("# as built\n")
    assert written.count("factor = 0.4") == 1
    assert parse_structure(written, table.parent / "extended.toml") == softer
    whole, changed = (build_model(s, mass="consistent") for s in (structure, softer))
    part = whole.groups["foot_ne"]
    assert abs(whole.stiffness - 0.6 * part - changed.stiffness).max() < 1e-12 * abs(whole.stiffness).max()
    assert abs(changed.groups["foot_ne"] - 0.4 * part).max() < 1e-12 * abs(part).max()


def test_matrix_market_files_of_groups_have_the_same_content(table: Path, tmp_path: Path) -> None:
    npz = table.with_suffix(".npz")
    structure = load_structure(table)
    assert structure.external is not None
    whole = read_matrices(npz, npz, npz)
    group = build_model(structure).groups["foot_sw"]
    save_matrices(tmp_path, replace(whole, groups={"foot_sw": group}))
    text = (
        table.read_text(encoding="utf-8")
        .replace('matrices = "table.npz"', 'stiffness = "stiffness.mtx"\nmass = "mass.mtx"\ndofs = "dofs.csv"')
        .split("[external.group")[0]
    )
    text += '[external.group.foot_sw]\nstiffness = "group_foot_sw.mtx"\n'
    text += '[[member]]\nname = "m"\nfrom = [0, 0.2, 0]\nto = [1.5, 0.2, 0]\n'
    other = build_model(parse_structure(text, tmp_path / "t.toml"))
    assert abs(other.groups["foot_sw"] - group).max() < 1e-12 * abs(group).max()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda k: 1e4 * k, r"group foot_sw: expected 0 to .*, which is the whole, on the diagonal of"),
        (lambda k: 0 * k, "group foot_sw: there is no stiffness"),
        (lambda k: k[:6, :6], "group foot_sw: expected .* entries, found"),
        (lambda k: k * np.nan, "group foot_sw: an entry is not finite"),
        (lambda k: k + _coupled(k), "group foot_sw: indefinite: some motion has a negative energy"),
    ],
)
def test_invalid_groups_are_refused_with_their_name(table: Path, tmp_path: Path, spoil: Any, message: str) -> None:
    npz = table.with_suffix(".npz")
    whole = read_matrices(npz, npz, npz)
    foot = build_model(load_structure(table)).groups["foot_sw"]
    save_matrices(tmp_path / "table.npz", Matrices(**vars(whole) | {"groups": {"foot_sw": spoil(foot)}}))
    text = 'name = "t"\n[external]\nmatrices = "table.npz"\n[external.group.foot_sw]\n'
    text += '[[member]]\nname = "m"\nfrom = [0, 0.2, 0]\nto = [1.5, 0.2, 0]\n'
    with pytest.raises(StructureError, match=message):
        build_model(parse_structure(text, tmp_path / "t.toml"))


def test_groups_that_overlap_are_refused(table: Path, tmp_path: Path) -> None:
    """Inside a panel that is in two groups their sum is more than there is."""
    npz = table.with_suffix(".npz")
    panel = build_model(load_structure(table)).groups["panel_10"]
    groups = {"one": panel, "two": panel}
    save_matrices(tmp_path / "table.npz", replace(read_matrices(npz, npz, npz), groups=groups))
    text = 'name = "t"\n[external]\nmatrices = "table.npz"\n[external.group.one]\n[external.group.two]\n'
    text += '[[member]]\nname = "m"\nfrom = [0, 0.2, 0]\nto = [1.5, 0.2, 0]\n'
    with pytest.raises(StructureError, match=r"group two, with the groups before it: expected 0 to .* is the whole"):
        build_model(parse_structure(text, tmp_path / "t.toml"))


def test_groups_that_share_one_element_are_refused(tmp_path: Path) -> None:
    """Each spring of a chain has a second one in parallel at its ends only, so that no sum exceeds the whole."""
    n, spring = 6, np.array([[1.0, -1.0], [-1.0, 1.0]])
    parts = [np.zeros((n, n)) for _ in range(n - 1)]
    for k, part in enumerate(parts):
        part[k : k + 2, k : k + 2] = spring
    whole = sum(parts) + np.diag(np.full(n, 5.0))  # springs to the ground
    dofs = np.full((n, 6), -1, np.int32)
    dofs[:, 0] = np.arange(n)
    chain = Matrices(
        stiffness=sparse.csc_array(whole),
        mass=sparse.csc_array(np.eye(n)),
        nodes=np.column_stack([np.arange(n), np.zeros((n, 2))]).astype(float),
        dofs=dofs,
    )
    text = 'name = "t"\n[external]\nmatrices = "t.npz"\n[external.group.one]\n[external.group.two]\n'
    text += '[[member]]\nname = "m"\nfrom = [0, 0, 0]\nto = [5, 0, 0]\n'
    for first in (1, 2):
        groups = {"one": parts[0] + parts[1], "two": parts[first] + parts[3]}
        save_matrices(tmp_path / "t.npz", replace(chain, groups={k: sparse.csc_array(v) for k, v in groups.items()}))
        structure = parse_structure(text, tmp_path / "t.toml")
        if first == 2:
            assert set(build_model(structure).groups) == {"one", "two"}
            continue
        with pytest.raises(StructureError, match=r"groups one and two share elements: both have .* \[1.0, 0.0, 0.0\]"):
            build_model(structure)


def _coupled(k: sparse.csc_array) -> sparse.csc_array:
    first, second = np.flatnonzero(k.diagonal())[:2].tolist()
    value = 3 * float(k.diagonal().max())
    return sparse.csc_array(([value, value], ([first, second], [second, first])), shape=k.shape)


@pytest.mark.parametrize(("axes", "coupled", "expected"), [((3, 4), False, 1.0), ((2,), False, 1.0), ((2,), True, 0.5)])
def test_error_of_a_group_by_the_mesh_is_half_unless_it_holds_the_structure(
    own: Reference, axes: tuple[int, ...], coupled: bool, expected: float
) -> None:
    """Springs to the ground against rotations or translations, and a spring between two nodes."""
    first, second = own.model.dofs[:2, axes]
    row = np.zeros((len(first), own.model.n_dofs))
    row[np.arange(len(first)), first] = 1.0
    if coupled:
        row[np.arange(len(first)), second] = -1.0
    groups = {"part": sparse.csc_array(1e5 * row.T @ row)}
    calibration = replace(own.calibration, model=replace(own.model, groups=groups))
    reference = replace(own, calibration=calibration)
    cause = CATALOGUE["local_stiffness"].propose(reference, compare(own, own.baseline))
    assert isinstance(cause, GroupStiffness)
    np.testing.assert_array_equal(cause.mesh_share, expected)


def test_group_changes_once_in_an_answer_of_several_causes(own: Reference) -> None:
    """Both starts of a chosen group are excluded; those of the others are not."""
    cause = CATALOGUE["local_stiffness"].propose(own, compare(own, own.baseline))
    assert isinstance(cause, GroupStiffness)
    row = cause.group.index("panel_10")
    joint = JointHypothesis(cause, (SelectedCause(cause, row, np.array([0.3])),))
    excluded = {i for i, prior in enumerate(joint.log_prior) if not np.isfinite(prior)}
    assert excluded == {i for i, group in enumerate(cause.group) if group == "panel_10"}
    assert len(excluded) == 2


def test_a_group_needs_a_name_of_its_own(table: Path) -> None:
    text = table.read_text(encoding="utf-8").replace('name = "y = 0.2"', 'name = "foot_ne"')
    with pytest.raises(StructureError, match="the name 'foot_ne' is given twice"):
        parse_structure(text, table)
