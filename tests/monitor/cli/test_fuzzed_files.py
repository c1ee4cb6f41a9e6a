"""Mutated files end in a documented exit code, in bounded time, memory and output: few cases of each reader here.

`make fuzz` runs 2000 of each.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.thorough import few_of

_ROOT = Path(__file__).parents[3]
READERS = (
    *(
        "structure",
        "matrices",
        "site",
        "scenario",
        "modal-table",
        "series",
        "bodies",
        "csv",
        "table",
        "arrays",
        "formats",
        "universal",
    ),
    *("programs", "can-log", "dbc", "lines", "log", "state"),
)


@pytest.fixture(scope="module", params=few_of([1, 4]), ids="{} cases".format)
def outcomes(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Return the outcomes of cases, run by one process that imports the program once."""
    file = tmp_path_factory.mktemp("fuzz") / "outcomes.jsonl"
    arguments = [*READERS, "--cases", str(request.param), "--file", str(file)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(_ROOT)}
    run = [sys.executable, str(_ROOT / "tests" / "fuzz" / "run.py"), *arguments]
    done = subprocess.run(run, env=environment, capture_output=True, text=True, timeout=200, check=False)
    assert file.exists(), done.stderr
    return [json.loads(line) for line in file.read_text().splitlines()]


@pytest.mark.parametrize("reader", READERS)
def test_mutated_files_are_read_or_refused(outcomes: list[dict[str, Any]], reader: str) -> None:
    own = [outcome for outcome in outcomes if outcome["reader"] == reader]
    assert own
    assert not [outcome for outcome in own if outcome["faults"]]
