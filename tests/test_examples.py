"""The examples: each runs as it stands, and comes to the number it should."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np

EXAMPLES = Path(__file__).parents[1] / "examples"


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


def test_report_log() -> None:
    found = run("report_log.py")
    answer, truth = found["answer"], found["truth"]
    assert abs(answer.mass - truth["mass"]) < 3 * answer.mass_std
    assert abs(answer.position[0] - truth["position"][0]) < 3 * answer.position_std
    assert f"{1000 * answer.mass:.0f} ± {1000 * answer.mass_std:.0f} g added on the crossbeam" in found["verdict"]
    assert found["verdict"] in found["report"]
