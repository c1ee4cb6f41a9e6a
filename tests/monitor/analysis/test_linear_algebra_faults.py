"""A singular matrix is an internal fault: numpy's error is a ValueError, but neither bad input nor too few modes."""

import ast
from pathlib import Path

import numpy as np
import pytest

from daq import Channel, Recording
from monitor.analysis.explanation import explain
from oma import IdentificationError, identify
from tests.examiner.models.specimen import draw_state
from tests.examiner.path import FRAME, observation
from tests.examiner.signals import estimated

ROOT = Path(__file__).parents[3]
_PACKAGES = ("updater", "oma", "monitor/analysis", "monitor/watch")
# Each of these reads text or a file, and reports a ValueError with its line or field.
_READERS = {
    "updater/fe/external/programs/harwell_boeing.py",
    "updater/structure/structure.py",
    "updater/structure/toml_file.py",
    "updater/fe/external/files.py",
    "updater/fe/external/programs/meshes.py",
    "updater/fe/external/programs/nastran.py",
    "updater/fe/external/programs/numbers.py",
    "updater/fe/external/programs/output4.py",
    "updater/fe/external/tables.py",
    "oma/tracking/track_state.py",
    "monitor/analysis/modal_table/csv.py",
    "monitor/analysis/modal_table/columns.py",
    "monitor/analysis/time_range.py",
    "monitor/analysis/known_bodies.py",
    "monitor/watch/memory/codec.py",
    "monitor/watch/memory/state.py",
}
_SOLVER = {"updater/fe/factorization.py"}  # PyPardiso raises ValueError


def fail(*_: object, **__: object) -> None:
    raise np.linalg.LinAlgError("Singular matrix")


def test_failed_decomposition_is_reported_as_internal_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("oma.identification.IdentificationStream.identify", fail)
    channels = tuple(Channel(name=f"c{i}", device="d", axis=i) for i in range(3))
    data = np.random.default_rng(1).standard_normal((6000, 3))
    recording = Recording(channels=channels, data=data, rate=100.0, start=0)
    with pytest.raises(IdentificationError, match="internal error in the identification: Singular matrix"):
        identify(recording)


@pytest.mark.parametrize("where", ["learn_reference", "diagnose"])
def test_singular_matrix_in_diagnosis_is_not_reported_as_input_error(
    where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = draw_state(1)
    random = np.random.default_rng(1)
    before, now = (observation(state, estimated(state, 4, random, noise="law")) for _ in range(2))
    monkeypatch.setattr(f"monitor.analysis.explanation.{where}", fail)
    with pytest.raises(np.linalg.LinAlgError):
        explain(FRAME, before, now)


def test_computation_modules_do_not_catch_value_error() -> None:
    modules = {p.relative_to(ROOT).as_posix() for package in _PACKAGES for p in (ROOT / package).rglob("*.py")}
    exceptions = _READERS | _SOLVER
    assert exceptions <= modules
    for path in sorted(modules - exceptions):
        for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
            if isinstance(node, ast.ExceptHandler) and node.type is not None:
                names = {n.id for n in ast.walk(node.type) if isinstance(n, ast.Name)}
                assert "ValueError" not in names, f"{path}:{node.lineno}"
