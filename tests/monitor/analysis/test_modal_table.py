"""Modes from tables: a cause is found in them as in logs, and an error of a table is one line."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from daq import LogError
from monitor.analysis.modal_table.table import read_table, read_tables
from oma import ModalEstimate
from tests.examiner.cases import draw
from tests.examiner.path import after
from tests.support.monitor.cli import Commands, assert_refused
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, load_structure, t_structure_toml

BODY = Body(at=(0.2, 0, 1.48), mass=0.3)
CHANNELS = t_frame().channels
ONLY = (
    "--only",
    "added_mass",
    "--only",
    "distributed_mass",
    "--only",
    "local_stiffness",
    "--only",
    "support_stiffness",
)


def table(path: Path, estimate: ModalEstimate, *, shapes: bool = True, stds: bool = True) -> Path:
    """Write the measured modes."""
    names = ["frequency", "damping", *(["frequency_std"] if stds else []), *(CHANNELS if shapes else ())]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        for i, frequency in enumerate(estimate.frequency):
            std = [estimate.frequency_std[i]] if stds else []
            writer.writerow([frequency, estimate.damping[i], *std, *(estimate.shape[i].real if shapes else ())])
    return path


def measured(seed: int, body: Body | None = None) -> ModalEstimate:
    return measure(true_model(np.random.default_rng(411), body), np.random.default_rng((412, seed)), np.ones(12))


def structure(folder: Path) -> Path:
    path = folder / "t_structure.toml"
    path.write_text(t_structure_toml(), encoding="utf-8")
    return path


@pytest.mark.parametrize("shapes", few_of([False, True]))
def test_added_mass_is_found_from_two_tables_of_modes(tmp_path: Path, modalwatch: Commands, shapes: bool) -> None:
    """Frequencies alone leave a mirror image; the mass is weighed all the same, spread over 30 cm or not.

    Of causes in the structure: from frequencies, many faults of sensors are not determined.
    """
    before = table(tmp_path / "before.csv", measured(1), shapes=shapes)
    after = table(tmp_path / "after.csv", measured(2, BODY), shapes=shapes)
    out = tmp_path / "found.json"
    done = modalwatch("diagnose", structure(tmp_path), after, "--reference", before, "--json", out, *ONLY)
    assert done.code in {0, 1}, done
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["verdict"] in {"explained", "ambiguous"}
    assert not shapes or [set(c["cannot_be_told_from"]) - {"distributed_mass"} for c in found["causes"]] == [set()]
    named = {cause["cause"]: cause for cause in found["causes"]}
    mass = named["added_mass"]["parameters"]["mass"]
    assert abs(mass["value"] - 0.3) < max(4 * mass["std"], 0.1)
    assert "fitted to the reference logs" in " ".join(done.out.split())
    assert shapes or "1.0000" not in done.out  # no MAC of the model's shapes with themselves
    if shapes:
        assert abs(named["added_mass"]["where"]["position"][0] - 0.2) < 0.06


@pytest.mark.thorough
def test_structure_extended_by_an_earlier_diagnosis_is_noted(tmp_path: Path, modalwatch: Commands) -> None:
    path = structure(tmp_path)
    path.write_text(
        path.read_text(encoding="utf-8")
        + "\n[[body]]\n# found by modalwatch diagnose\nat = [0.2, 0, 1.48]\nmass = 0.3\n"
    )
    before, after = (table(tmp_path / f"{name}.csv", measured(seed)) for seed, name in enumerate(("before", "after")))
    done = modalwatch("diagnose", path, after, "--reference", before)
    assert "earlier diagnosis" in done.out


def test_diagnosis_is_saved_even_if_the_report_cannot_be_written(tmp_path: Path, modalwatch: Commands) -> None:
    """The report cannot be written: that is an error, after the verdict, the JSON and the extended model."""
    before, after = (table(tmp_path / f"{s}.csv", measured(s, b)) for s, b in ((1, None), (2, BODY)))
    out = tmp_path / "out"
    (out / "report.html").mkdir(parents=True)
    done = modalwatch(
        "diagnose", structure(tmp_path), after, "--reference", before, "--only", "added_mass", "--out", out
    )
    assert done.code == 2
    assert "report.html: cannot be written" in done.err
    found = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert found["verdict"] in {"explained", "ambiguous"}
    assert Path(found["extended_model"]).exists()
    assert "g added on the crossbeam" in " ".join(done.out.split())


def test_error_in_a_table_names_its_file(tmp_path: Path, modalwatch: Commands) -> None:
    now, before = table(tmp_path / "now.csv", measured(3)), tmp_path / "before.csv"
    before.write_text("\n".join(["frequency", *(f"{2 * np.pi * f}" for f in measured(4).frequency)]), encoding="utf-8")
    with_units = table(tmp_path / "good.csv", measured(5))
    shaped = with_units.read_text(encoding="utf-8").splitlines()
    wrong = [shaped[0], *(f"{float(r.split(',')[0]) / 1000},{r.split(',', 1)[1]}" for r in shaped[1:])]
    (tmp_path / "khz.csv").write_text("\n".join(wrong), encoding="utf-8")
    path = structure(tmp_path)
    assert f"{before}: the mode at" in modalwatch("diagnose", path, now, "--reference", before).err
    for option in ("--reference", "--held-out"):
        rest = () if option == "--reference" else ("--reference", with_units)
        reported = " ".join(modalwatch("diagnose", path, now, *rest, option, tmp_path / "khz.csv").err.split())
        assert f"{tmp_path / 'khz.csv'}: frequencies: expected hertz" in reported


@pytest.mark.thorough
@pytest.mark.usefixtures("undrawn")
def test_recalibrated_model_is_written_if_the_change_is_unexplained(tmp_path: Path, modalwatch: Commands) -> None:
    """Steel of 260 GPa, and all sensors mounted again, each slightly turned."""
    text = t_structure_toml()
    stiff = text.replace("youngs_modulus = 210e9", "youngs_modulus = 260e9")
    assert stiff != text
    path = structure(tmp_path)
    path.write_text(stiff, encoding="utf-8")
    windows = after(draw("reseated", 1), np.random.default_rng(413)).estimates
    tables = [table(tmp_path / f"{k}.csv", window) for k, window in enumerate(windows)]
    done = modalwatch("diagnose", path, *tables, "--out", tmp_path / "out")
    assert done.code == 1
    reported = " ".join(done.out.split())
    assert "no known cause explains" in reported
    assert "its own parameters fitted the file's frequencies are off by" in reported
    nearer = tmp_path / "out" / "structure_recalibrated.toml"
    assert nearer.name in reported
    found = load_structure(nearer)
    assert found.material["steel"].youngs_modulus < 230e9
    again = modalwatch("diagnose", nearer, *tables, "--only", "model_parameters")
    assert "recalibrated" not in again.out
    taken = tmp_path / "taken" / nearer.name
    taken.mkdir(parents=True)
    refused = modalwatch("diagnose", path, *tables, "--only", "model_parameters", "--out", taken.parent)
    assert_refused(refused, f"--out: {taken}: cannot be written: ")


def test_tables_of_the_same_state_show_no_change(tmp_path: Path, modalwatch: Commands) -> None:
    before, after = table(tmp_path / "a.csv", measured(3)), table(tmp_path / "b.csv", measured(4))
    out = tmp_path / "found.json"
    assert modalwatch("diagnose", structure(tmp_path), after, "--reference", before, "--json", out).code == 0
    assert json.loads(out.read_text(encoding="utf-8"))["verdict"] == "nothing_to_explain"


def test_table_provides_temperature_amplitude_and_default_deviations(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("frequency,temperature,rms\n38.8,21.5,0.02\n10.8,21.5,0.02\n11.0,21.5,0.02\n", encoding="utf-8")
    found = read_table(t_frame(), path)
    assert (found.temperature, found.rms, found.shaped) == (21.5, 0.02, False)
    assert found.estimate.frequency.tolist() == [10.8, 11.0, 38.8]
    np.testing.assert_allclose(found.estimate.frequency_std, 1e-3 * found.estimate.frequency)
    assert (found.estimate.damping_std > 1).all()
    together = read_tables(t_frame(), [path])
    assert not together.shaped
    assert together.stated


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("f\n1\n2\n3\n", "line 1: expected a column 'frequency'"),
        ("time [h],f1 [Hz]\n0,2\n", "line 1: expected a column 'frequency' [Hz], found time, f1"),
        ("", "line 1: expected a column 'frequency' [Hz], found none"),
        ("10.8,1\n11,1\n38,1\n", "line 1: expected names of columns, found numbers"),
        ("# by hand\n\nfrequency [min]\n1\n2\n3\n", "line 3, column frequency [min]: expected the unit Hz"),
        ("frequency,damping\n10,0.4\n11,0.5\n38,0.3\n", "line 3, column damping: expected a ratio, found 0.5"),
        ("frequency,\n10,a\n11,b\n38,c\n", "line 1, column without a name: expected one of"),
        ("frequency,colour\n1,2\n2,2\n3,2\n", "line 1, column colour"),
        ("frequency\n10\neleven\n30\n", "line 3, column frequency: expected a number, found 'eleven'"),
        ("frequency\n10\n-11\n30\n", "line 3, column frequency: expected a number over 0"),
        ("frequency,damping\n10,0.01\n11\n30,0.01\n", "line 3: expected 2 columns"),
        ("frequency\n10\n11\n", "expected at least 3 modes, found 2"),
        ("frequency,beam_mid_x,beam_mid_x\n10,1,1\n11,1,1\n30,1,1\n", "line 1, column beam_mid_x: named twice"),
        ("frequency;damping\n10,5;0,01\n11,2;a\n", "line 3, column damping: expected a number, found 'a'"),
        ("frequency,beam_mid_x\n10,1\n11,1\n30,1\n", "expected shapes at 2 sensors or more"),
        ("frequency,beam_mid_x,beam_mid_y\n10,1,1\n11,0,0\n30,1,1\n", "line 3: the shape is zero"),
        ("frequency\n10\n11\n5000\n", "the mode at 5000 Hz has no partner"),
        (
            "frequency\n67.7\n68.9\n69.5\n",
            "Hz has no partner in the model by frequency, whose modes are at 10.78, ",
        ),
        (
            "frequency,beam_mid_x,beam_mid_y,beam_left_z\n10,1,0,0\n11,0,1,0\n38,0,0,1\n10,1,0,0\n",
            ": the mode at 10 Hz is in the table twice",
        ),
    ],
)
def test_invalid_table_is_refused_with_a_one_line_error(tmp_path: Path, text: str, where: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(LogError) as error:
        read_table(t_frame(), path)
    assert str(error.value).startswith(f"{path}: ")
    assert where in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text",
    [
        "frequency [Hz],damping [%],beam_mid_x,beam_mid_y\n10.8,0.4,1,2\n11,0.5,2,-1\n38.75,0.3,1,1\n",
        "Frequency (kHz);Damping (%);beam_mid_x;beam_mid_y\n0,0108;0,4;1;2\n0,011;0,5;2;-1\n0,03875;0,3;1;1\n",
        "mode,frequency,damping,beam_mid_x,beam_mid_y,\n3,38.75,0.003,1,1,\n1,10.8,0.004,1,2,\n2,11,0.005,2,-1,\n,,,,,\n",
        "# pyOMA2\n\nfrequency\tdamping\tbeam_mid_x\tbeam_mid_y\n\n10.8\t0.004\t1 + 0i\t2 - 0i\n"
        "11\t0.005\t-2+0j\t(1+0j)\n38.75\t.003\t7e-9\t7e-9\n\n",
        '"frequency","damping","beam_mid_x","beam_mid_y"\n"10,8","0,004","1","2"\n"11","0,005","2","-1"\n'
        '"38,75","0,003","1","1"\n',
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_common_table_formats_and_encodings_are_read(tmp_path: Path, text: str, encoding: str) -> None:
    path = tmp_path / "modes.csv"
    path.write_bytes(text.replace("\n", "\r\n").encode(encoding))
    found = read_table(t_frame(), path).estimate
    np.testing.assert_allclose(found.frequency, [10.8, 11.0, 38.75])
    np.testing.assert_allclose(found.damping, [0.004, 0.005, 0.003])
    assert found.channels == ("beam_mid_x", "beam_mid_y")
    expected = np.array([[1, 2], [2, -1], [1, 1]]) / np.sqrt([[5], [5], [2]])
    np.testing.assert_allclose(np.abs((found.shape * expected).sum(1)), 1)


def test_text_in_another_encoding_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "modes.csv"
    path.write_bytes("# gemessen\n# Br\u00fccke\nfrequency\n10.8\n".encode("latin-1"))
    with pytest.raises(LogError, match=r"line 2: expected text in UTF-8, found byte 0xfc"):
        read_table(t_frame(), path)


def test_semicolons_and_decimal_commas_are_read(tmp_path: Path) -> None:
    path = tmp_path / "modes.csv"
    path.write_text("frequency;damping\n10,8;0,004\n11;0,005\n38,75;0,003\n", encoding="utf-8")
    found = read_table(t_frame(), path).estimate
    assert found.frequency.tolist() == [10.8, 11.0, 38.75]
    assert found.damping.tolist() == [0.004, 0.005, 0.003]


def test_output_of_identify_is_read_as_a_table(tmp_path: Path) -> None:
    estimate = measured(5)
    modes = [
        {
            "id": i,
            "frequency": {"value": f, "std": s},
            "damping": {"value": 0.01, "std": 0.001},
            "shape": {c: [z.real, z.imag] for c, z in zip(CHANNELS, shape, strict=True)},
            "shape_std": dict.fromkeys(CHANNELS, 0.01),
        }
        for i, (f, s, shape) in enumerate(zip(estimate.frequency, estimate.frequency_std, estimate.shape, strict=True))
    ]
    path = tmp_path / "modes.json"
    path.write_text(json.dumps({"modes": modes}), encoding="utf-8")
    found = read_table(t_frame(), path)
    np.testing.assert_allclose(found.estimate.frequency, estimate.frequency)
    assurance = np.abs((found.estimate.shape.conj() * estimate.shape).sum(1)) / np.linalg.norm(estimate.shape, axis=1)
    np.testing.assert_allclose(assurance, 1)
    assert found.shaped
    path.write_text('{"modes": [{"frequency": {"value": -1}}]}', encoding="utf-8")
    with pytest.raises(LogError, match=r"modes\.0\.frequency\.value"):
        read_table(t_frame(), path)
