"""The examples: each runs as it is, and has the expected result."""

import runpy
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq import DbcSensor
from daq.drivers import read_layout
from daq.protocol.can_scan import encode_scans
from tests.support.thorough import few_of

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(name: str) -> dict[str, Any]:
    """Run an example; return its variables."""
    return runpy.run_path(str(EXAMPLES / name))


def test_identify_csv() -> None:
    found = run("identify_csv.py")
    closed_form = 20 / np.pi * np.sin((2 * np.arange(1, 4) - 1) * np.pi / 14)
    np.testing.assert_allclose(found["exact"], closed_form, rtol=1e-12)
    estimate = found["estimate"]
    assert (np.abs(estimate.frequency - closed_form) < 4 * estimate.frequency_std).all()
    assert (np.abs(estimate.damping - 0.01) < 4 * estimate.damping_std).all()
    assert (estimate.frequency_std < 0.002 * closed_form).all()
    assert found["likeness"].min() > 0.999


def test_merge_setups() -> None:
    found = run("merge_setups.py")
    merged = found["merged"]
    assert merged.channels == tuple(f"floor_{k}" for k in (8, 3, 1, 2, 4, 5, 6, 7))
    assert (np.abs(merged.frequency - found["exact"]) < 4 * merged.frequency_std).all()
    # 1 - MAC is the sum of the shape's variances: of stated deviations up to 0.03 of the unit norm at eight floors
    assert (1 - found["likeness"] < 8 * 0.03**2).all()


@pytest.mark.parametrize("n_windows", few_of([20, 48]))
def test_follow_modes(n_windows: int, tmp_path: Path) -> None:
    """One identity a mode; in a window or two of 44 the two that cross are so mixed that either may be meant."""
    source = (EXAMPLES / "follow_modes.py").read_text(encoding="utf-8")
    assert source.count("range(n_windows)") == 1
    shorter = tmp_path / "follow_modes.py"
    shorter.write_text(source.replace("range(n_windows)", f"range({n_windows})"), encoding="utf-8")
    found = runpy.run_path(str(shorter))
    best = {}
    for mode in found["directions"]:
        counts = {identity: n for (m, identity), n in found["counts"].items() if m == mode}
        best[mode] = max(counts, key=lambda identity: counts[identity])
        assert counts[best[mode]] >= 0.94 * sum(counts.values())
        assert sum(counts.values()) >= n_windows * (0.18 if mode == "y, second" else 0.62)
    assert len(set(best.values())) == 4
    assert found["mixed"] < 0.2 * (sum(found["counts"].values()) + found["mixed"])


@pytest.mark.usefixtures("undrawn")
def test_report_log() -> None:
    found = run("report_log.py")
    answer, truth = found["answer"], found["truth"]
    assert abs(answer.mass - truth["mass"]) < 3 * answer.mass_std
    assert abs(answer.position[0] - truth["position"][0]) < 3 * answer.position_std
    assert f"{1000 * answer.mass:.0f} ± {1000 * answer.mass_std:.0f} g added on the crossbeam" in found["verdict"]
    assert found["verdict"] in found["report"].replace("\u00a0", " ")


@pytest.mark.thorough
def test_paper_t_structure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Totals without noise to 10 % of the mass for this frame; with noise within 4 deviations of those.

    Where the paper's figures are constant, ours vary by less than two deviations of the increments.
    """
    monkeypatch.setattr("sys.argv", ["", str(tmp_path)])
    found = run("paper_t_structure.py")
    assert {p.name for p in tmp_path.iterdir()} == {
        "paper_location_1.png",
        "paper_location_2.png",
        "paper_modes.png",
    }
    seen: dict[str, list[Any]] = {what[0]: [] for what in found["seen"]}
    for what, value in found["seen"].items():
        seen[what[0]].append(value)
    sums, _, sides, edges = seen["2"]
    assert (sums < 304 / 5).all()
    assert min(sides) > 0.8
    assert (edges > 0.3).all()
    along, peak, side = seen["3"]
    assert max(along, side) < 0.1
    assert 0.15 < peak < 0.35
    beside, lower = seen["4"]
    assert lower < beside < 0.97
    below, above = seen["5"]
    assert below < 0.1
    assert above < 0.6
    expected = {"location 1": (0.342, 0.373, 0.362), "location 2": (0.207, 0.156, 0.0)}
    for place, body in found["BODIES"].items():
        exact, noisy = (found["updates"][place, reported] for reported in found["NOISE"])
        np.testing.assert_allclose(exact.totals, expected[place], atol=0.1 * body.mass)
        assert (np.abs(noisy.totals - exact.totals) < 4 * noisy.totals_std).all()
        paper = [1e-3 * grams for grams in found["PAPER"][place] if grams]
        ratio = exact.totals[: len(paper)] / paper
        assert (ratio > 1 / 1.6).all()
        assert (ratio < 1.6).all()
        assert np.linalg.norm(found["nodes"][exact.flagged[0].node] - np.array(body.at)) < 0.11
        spread = found["spreads"][place, "0.1 % / 2 %"]
        assert spread.mass.sum() == pytest.approx(body.mass, rel=0.25)
        answer = found["answers"][place, "0.1 % / 2 %"]
        assert abs(answer.mass - body.mass) < 4 * answer.mass_std
        start = {"crossbeam": np.array([-0.4, 0.0, 1.48]), "column": np.zeros(3)}[answer.member]
        assert abs(answer.distance - np.linalg.norm(np.array(body.at) - start)) < 4 * answer.distance_std


def test_paper_stiffness(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both changes are flagged where they were made, to a tenth of the column's length, with another foot on the frame.

    Eight modes make up nearly all of a node's flexibility and little of an element's or of a node's mass.
    """
    monkeypatch.setattr("sys.argv", ["", str(tmp_path)])
    found = run("paper_stiffness.py")
    assert [p.name for p in tmp_path.iterdir()] == ["paper_stiffness.png"]
    middle = {"column softened": np.mean(found["SOFT"]), "foot loosened": 0.0}
    for name, update in found["updates"].items():
        strongest = update.flagged[0]
        assert abs(found["height"][strongest] - middle[name]) < 0.15
        assert update.hinges.name[strongest] in ("column", "foot 0")
    median = {name: np.median(share) for name, share in found["shares"].items()}
    assert median["flexibility of a node"] > 0.9
    assert max(median["mass of a node"], median["flexibility of an element"]) < 0.1


@pytest.mark.live
def test_emulated_can() -> None:
    """Nothing is lost; both devices measure the shaker, at the same time but for the transmission of some frames."""
    found = run("emulated_can.py")
    assert found["gaps"] == []
    assert all(scans >= 0.5 * found["rate"] * found["seconds"] for scans in found["scans"].values())
    # the part of a period at the ends: 1 / (2 n_periods) of the power, for at least a second of data
    np.testing.assert_allclose(found["rms"], 0.5 / np.sqrt(2), rtol=0.015)
    assert abs(found["late"]) < 3e-3


@pytest.mark.live
def test_emulated_dbc() -> None:
    """Frames that are lost cost scans, but shift none: the sine is found as it was."""
    found = run("emulated_dbc.py")
    assert found["scans"] + found["missing"] == found["blocks"][-1].end_index
    assert 0 < found["missing"] < 0.1 * found["scans"]
    # of a count, 2^-8 m/s2, rounding takes half at the most: 4 / pi of it in the amplitude
    assert abs(np.hypot(*found["found"]) - found["amplitude"]) < 4 / np.pi * 2**-9


def test_eds_to_dbc(tmp_path: Path) -> None:
    """The frames of a scan are those of the mapping in the EDS file: two and one axes, each with the counter."""
    path = tmp_path / "accelerometer.dbc"
    path.write_text(run("eds_to_dbc.py")["dbc"], encoding="utf-8")
    signals = tuple(f"Acceleration_{axis}" for axis in "xyz")
    layout = read_layout(DbcSensor(file=path, signals=signals, counter="Scan_counter", scale=0.01))
    frames = encode_scans(layout, np.array([[1, -2, 3]], np.int32), 258)
    assert list(frames) == [(0x185, struct.pack("<hhH", 1, -2, 258)), (0x285, struct.pack("<hH", 3, 258))]
    assert layout.scale == 0.01


def test_diagnose_change() -> None:
    found = run("diagnose_change.py")
    diagnosis, truth = found["diagnosis"], found["truth"]
    cause, *others = diagnosis.causes
    assert cause.cause == "added_mass"
    assert {other.cause for other in others} <= {"distributed_mass"}  # 29 s after the event cannot tell the two well
    mass = cause.parameters["mass"]
    assert abs(mass.value - truth["mass"]) < 3 * mass.std
    assert np.linalg.norm(np.subtract(cause.where.position, truth["position"])) < 3 * cause.where.position_std
    assert diagnosis.gain.heldout
    assert diagnosis.gain.frequency_error_percent.after < 0.3 * diagnosis.gain.frequency_error_percent.before


def test_matrices_from_elsewhere() -> None:
    """Four squares across the strip bend too stiffly by about 3 %, the real strip is stiffer by 2 %."""
    found = run("matrices_from_elsewhere.py")
    change = found["found"]
    assert abs(change.mass - found["BODY"]) < 3 * change.mass_std < 0.2 * found["BODY"]
    assert abs(change.distance - found["PLACE"]) < 3 * change.distance_std < 0.01
    assert found["stiffness"].value == pytest.approx(0.99, abs=0.01)
