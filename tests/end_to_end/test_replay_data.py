"""The recorded log of the repository: it opens, repeats what was found live, and finds what its manifest says."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from monitor.replay import replay
from monitor.results import WindowResult

FOLDER = Path(__file__).parents[2] / "replay_data"
LOGS = tomllib.loads((FOLDER / "manifest.toml").read_text(encoding="utf-8"))["log"]


@pytest.mark.parametrize("entry", LOGS, ids=[entry["file"] for entry in LOGS])
def test_replay_repeats_the_live_run_and_finds_the_mass(entry: dict[str, object]) -> None:
    """Digits may differ between machines' BLAS; on any machine modes and answer agree to a thousandth."""
    report = replay(FOLDER / str(entry["file"]), None, lambda _: None)
    live = [r for r in report.logged if isinstance(r, WindowResult)]
    found = [r for r in report.found if isinstance(r, WindowResult)]
    assert len(live) == len(found)
    for a, b in zip(live, found, strict=True):
        np.testing.assert_allclose([m.frequency for m in a.modes], [m.frequency for m in b.modes], rtol=1e-3)
    answer = [w.answer for w in found if w.answer][-1]
    assert np.linalg.norm(np.subtract(answer.position, np.array(entry["position"]))) < 0.10
    assert answer.mass == pytest.approx(entry["mass"], rel=0.15)
