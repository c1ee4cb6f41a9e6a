"""Springs to the ground at nodes of external matrices: a mast of OpenSees' beams; ours are measured."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from oma import ModalEstimate
from tests.support.opensees import needs_opensees, ops
from tests.support.updater.frames import noisy_estimates, unmoved
from updater import (
    Reference,
    build_model,
    diagnose,
    dump_structure,
    learn_reference,
    load_structure,
    parse_structure,
    save_matrices,
    stack_tracks,
)
from updater.causes import CATALOGUE, SelectedCause, prediction
from updater.causes.stiffness.connections import Springs
from updater.fe import opensees_matrices, self_stress
from updater.inference import compare

pytestmark = needs_opensees

LENGTH, N = 2.0, 20  # m, elements
AREA, ABOUT_X, ABOUT_Y, TORSION = 1.6e-3, 2.2e-7, 6.0e-7, 4.0e-7  # box of steel: E I / L is 23 and 63 kN m/rad
E, G, DENSITY, SHEAR = 210e9, 81e9, 7850.0, 0.44
FOOT = {"rx": 2.0e5, "ry": 3.0e5}  # N m/rad
BASE = [0, 0, 0]
HEIGHTS = (0.4, 0.8, 1.1, 1.4, 1.7, 2.0)
CHANNELS = tuple(f"{axis}{i}" for axis in "xy" for i in range(len(HEIGHTS)))
N_MODES = 6
STD = 2e-4  # of ln f
ONLY = ("support_stiffness", "added_mass", "global_stiffness", "sensor_gain")


def _common() -> str:
    """Return sensors, and the support with its springs."""
    directions = {"x": [1, 0, 0], "y": [0, 1, 0]}
    text = [
        f'[[sensor]]\nchannel = "{axis}{i}"\nat = [0, 0, {z}]\ndirection = {directions[axis]}\n'
        for axis in "xy"
        for i, z in enumerate(HEIGHTS)
    ]
    springs = ", ".join(f"{axis} = {k}" for axis, k in FOOT.items())
    return "".join(text) + f'[[support]]\nat = {BASE}\nfixed = ["x", "y", "z", "rz"]\nstiffness = {{ {springs} }}\n'


@pytest.fixture(scope="module")
def mast(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Matrices of beams without any support, and a structure file with springs at the foot."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for i in range(N + 1):
        ops.node(i + 1, 0.0, 0.0, LENGTH * i / N)
    ops.geomTransf("Linear", 1, 1, 0, 0)  # local y and z are along -y and x
    for i in range(N):
        given = (E, G, AREA, TORSION, ABOUT_Y, ABOUT_X, SHEAR * AREA, SHEAR * AREA, 1)
        mass = ("-mass", DENSITY * AREA, "-cMass")
        ops.element("ElasticTimoshenkoBeam", i + 1, i + 1, i + 2, *given, *mass)
    folder = tmp_path_factory.mktemp("mast")
    save_matrices(folder / "mast.npz", opensees_matrices(ops))
    ops.wipe()
    text = f'name = "mast"\n[external]\nmatrices = "mast.npz"\n[[member]]\nname = "mast"\nfrom = {BASE}\n'
    (folder / "mast.toml").write_text(text + f"to = [0, 0, {LENGTH}]\n" + _common(), encoding="utf-8")
    return folder / "mast.toml"


def _true_windows(n: int, random: np.random.Generator, **foot: float) -> list[ModalEstimate]:
    """Return windows of our own model of another mesh, its springs multiplied by factors."""
    shear = f"shear_factor = {SHEAR}"
    text = f"""name = "true"
material.steel = {{youngs_modulus = {E}, shear_modulus = {G}, density = {DENSITY}}}
section.box = {{area = {AREA}, second_moment = [{ABOUT_X}, {ABOUT_Y}], torsion_constant = {TORSION}, {shear}}}
[[member]]
name = "mast"
from = {BASE}
to = [0, 0, {LENGTH}]
material = "steel"
section = "box"
elements = 33
local_y = [1, 0, 0]
"""
    structure = parse_structure(text + _common())
    springs = {axis: k * foot.get(axis, 1.0) for axis, k in FOOT.items()}
    support = structure.support[0].model_copy(update={"stiffness": springs})
    model = build_model(structure.model_copy(update={"support": (support,)}), shear_flexible=True, mass="consistent")
    modes = model.modes(20)
    shape = (model.sensor_rows @ modes.shape).T
    bends = np.flatnonzero(np.abs(shape).max(1) > 1e-3 * np.abs(shape).max())[:N_MODES]
    exact = shape[bends] / np.linalg.norm(shape[bends], axis=1, keepdims=True)
    frequency = modes.frequency[bends]
    return noisy_estimates(frequency, exact, CHANNELS, n, random, std=STD, shape_std=2e-3)


@pytest.fixture(scope="module")
def learned(mast: Path) -> Reference:
    before = _true_windows(8, np.random.default_rng(7))
    return learn_reference(load_structure(mast), before, unmoved(8, N_MODES))


def test_stated_springs_are_calibrated(mast: Path) -> None:
    """A foot that is half as stiff as in the file about one axis; flexibilities have the file's as their deviation."""
    before = _true_windows(8, np.random.default_rng(3), rx=0.5)
    found = learn_reference(load_structure(mast), before, unmoved(8, N_MODES)).calibration
    changes = {change.name: change for change in found.changes()}
    print(changes)
    for name, factor in (("rx", 0.5), ("ry", 1.0)):
        change = changes[f"support 0.{name}"]
        assert change.unit == "N m/rad"
        assert change.before == pytest.approx(FOOT[name])
        assert change.after == pytest.approx(factor * FOOT[name], abs=3 * change.std)
        assert change.std < 0.2 * change.after


@pytest.mark.parametrize("factors", [{"rx": 0.3}, {"ry": 0.5, "rx": 1.5}])
def test_predicted_modes_agree_with_those_of_the_written_file(learned: Reference, factors: dict[str, float]) -> None:
    """The model's own modes and sixteen of them: a spring's change is a rank-one change of flexibility."""
    modes = learned.calibration.modes
    own = replace(learned, frequency=modes.frequency, shape=modes.shape)
    data = compare(own, own.baseline)
    cause = CATALOGUE["support_stiffness"].propose(own, data)
    assert isinstance(cause, Springs)
    active = [axis in factors for axis in cause.axes[0]]
    row = next(i for i in range(len(cause.active)) if cause.active[i].tolist() == active)
    stiffness = own.structure.support[0].stiffness
    theta = np.array(
        [
            cause.unit[row, a] * (1 / factors.get(x, 1.0) - 1) / stiffness.get(x, 1.0)
            for a, x in enumerate(cause.axes[row])
        ]
    )
    chosen = SelectedCause(cause, row, theta)
    written = cause.extend(own.structure, row, theta).support[0]
    assert written.stiffness == pytest.approx({axis: k * factors.get(axis, 1.0) for axis, k in stiffness.items()})
    model = build_model(cause.extend(own.structure, row, theta), mass="consistent")
    frequency = data.frequency[data.paired] * np.exp(prediction(data, [chosen]).log_ratio[0])
    assert np.abs(np.log(frequency / data.frequency[data.paired])).max() > 0.02
    exact = model.modes(20).frequency
    assert np.abs(np.log(frequency[:, None] / exact)).min(1).max() < 1e-4


def test_softer_foot_is_named_about_its_axis_and_written(mast: Path, learned: Reference) -> None:
    random = np.random.default_rng(11)
    after, heldout = (
        learned.mean_of(stack_tracks(_true_windows(4, random, ry=0.5), unmoved(4, N_MODES))) for _ in range(2)
    )
    found = diagnose(learned, after, heldout=heldout, only=ONLY)
    (cause,) = found.diagnosis.causes
    assert cause.cause == "support_stiffness"
    assert cause.where is not None
    assert cause.where.position == (0.0, 0.0, 0.0)
    (change,) = cause.changes
    print(change, found.diagnosis.gain)
    assert change.name == "support 0.ry"
    assert change.after == pytest.approx(0.5 * FOOT["ry"], abs=3 * change.std)
    assert change.std < 0.1 * change.after
    assert found.extended is not None
    text = dump_structure(found.extended, mast.read_text(encoding="utf-8"))
    written = parse_structure(text, mast.parent / "new.toml")
    assert written.support[0].stiffness["ry"] == pytest.approx(change.after, rel=0.05)
    gain = found.diagnosis.gain
    assert gain is not None
    assert gain.frequency_error_percent.before is not None
    assert gain.frequency_error_percent.after is not None
    assert gain.frequency_error_percent.after < 0.2 * gain.frequency_error_percent.before


def test_springs_of_a_determinate_mast_have_no_self_stress(learned: Reference) -> None:
    assert self_stress(learned.model).n == 0
