"""A measured cantilever: its clamp is the error of the simulation, and the mass nearest to it was removed."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from tests.measured.six_masses import (
    PLAIN,
    Cantilever,
    Hypothesis,
    Misfit,
    fitted,
    read_layouts,
    share_explained,
    write_bodies_file,
)
from tests.support.monitor.cli import Commands
from tests.support.thorough import few_of
from updater import build_model

REAL = os.environ.get("MODALWATCH_REAL_DATA")
CLAMP = (*PLAIN, "clamp_shifts", "clamp_turns", "near_clamp", "near_clamp_at")


def test_bending_modes_of_a_hypothesis_match_the_written_structure() -> None:
    values = {
        "stiffness": -0.05,
        "mass": 0.028,
        "clamp_shifts": 6e-5,
        "clamp_turns": 0.06,
        "near_clamp": 0.5,
        "near_clamp_at": 0.004,
        "accelerometer": 0.02,
        "accelerometer_gyration": 0.01,
        "offset": 0.002,
        "gyration": 0.01,
    }
    beam, place = Cantilever(), np.array([0.04, 0.1, 0.15, 0.2, 0.26, 0.3])
    on = np.array([0.0, 1, 1, 1, 1, 1])
    model = build_model(beam.written_out(values, place, on), shear_flexible=True, mass="consistent")
    modes = model.modes(12)
    bending = np.abs(model.sensor_rows @ modes.shape)[0] > 1e-3
    # twenty modes in the place of all: 1e-5 for points, more for what turns
    expected = beam.log_frequency(values, place[None], on)[0]
    np.testing.assert_allclose(np.log(modes.frequency[bending][:5]), expected, atol=3e-4)


@pytest.mark.thorough
@pytest.mark.skipif(not REAL, reason="MODALWATCH_REAL_DATA names no folder")
def test_clamp_fitted_to_measured_cantilever_predicts_held_out_layouts() -> None:
    measured = read_layouts(Path(REAL or "") / "beam-six-masses", slice(0, 24))
    share = share_explained(measured)
    assert np.argmax(share.sum(axis=1)) == 0  # without any model: only the place of the first decides the shifts
    assert share[0, 2:].min() > 2 * share[1:, 2:].max()
    used, unused = measured.only(np.arange(16)), measured.only(np.arange(16, 24))
    beam, noise, off = Cantilever(), measured.noise(), {}
    for free in (PLAIN, CLAMP):
        hypothesis = Hypothesis(free=free, off=0)
        found = fitted(beam, hypothesis, used, noise, starts=2)
        mean, shift = Misfit(beam, hypothesis, unused, noise).differences(np.array(list(found.values.values())))
        off[free] = np.abs(mean).max(), np.sqrt(((shift / noise[1]) ** 2).mean())
    assert off[PLAIN][0] > 0.05  # of a frequency
    assert off[CLAMP][0] < 0.03
    assert off[PLAIN][1] > 2
    # 40 shifts at their own noise would have an rms of 1 +- 0.11; places stray in ways that noise() takes for linear
    assert off[CLAMP][1] < 1.5
    evidence = [fitted(beam, Hypothesis(free=CLAMP, off=k), used, noise, starts=1).log_evidence for k in range(6)]
    assert evidence[0] > max(evidence[1:]) + 20


@pytest.mark.skipif(not REAL, reason="MODALWATCH_REAL_DATA names no folder")
@pytest.mark.parametrize(("state", "off"), few_of([("5.92", ["L1", "L3"]), ("2.96", ["L1"])]))
def test_bodies_command_identifies_masses_removed_from_measured_cantilever(
    tmp_path: Path, modalwatch: Commands, state: str, off: list[str]
) -> None:
    """Four layouts, the clamp as docs/validation/measured/beam_model.md has it from the first state."""
    clamp = {"stiffness": -0.041, "mass": 0.0279, "clamp_shifts": 6.2e-5, "clamp_turns": 0.058, "accelerometer": 0.018}
    clamp |= {"near_clamp": 0.54, "near_clamp_at": 0.0}
    beam, measured = Cantilever(), read_layouts(Path(REAL or "") / "beam-six-masses", slice(0, 4), state=state)
    out = tmp_path / "found.json"
    done = modalwatch("bodies", write_bodies_file(tmp_path, beam, clamp, measured), "--json", out)
    assert (done.code, done.err) == (0, "")
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["verdict"] == "explained"
    assert found["sets"][0]["bodies"] == off
    assert found["sets"][0]["probability"] > 0.99
    for body in found["bodies"]:
        assert (body["mass"] is not None) == (body["name"] in off)
        if body["mass"]:
            assert abs(body["mass"]["value"] - clamp["mass"] * beam.beam) < 3 * body["mass"]["std"]
    print(state, found["sets"][:2], [r["probability_of_answer"] for r in found["records"]])
