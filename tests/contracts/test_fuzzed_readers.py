"""Every reader of files of other programs is fuzzed, from files that are sound before they are mutated."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from daq.files.formats.registry import FORMATS
from tests.fuzz.reached import functions_with_a_path
from tests.fuzz.readers import READERS
from tests.monitor.cli import test_fuzzed_files

ROOT = Path(__file__).parents[2]
#: functions with a path that read no file of another program
OTHERS = {
    "daq/files/measurement_file.py:read_data": "read_measured, which commands call",
    "monitor/analysis/channels.py:_of_log": "logs",
    "monitor/analysis/modal_table/table.py:is_table": "the ending alone",
    "updater/fe/external/programs/conversion.py:_names": "the name of a file",
}


@pytest.fixture(scope="module")
def read() -> dict[str, Any]:
    """Return exit codes of sound files and the functions that they reach."""
    run = [sys.executable, str(ROOT / "tests" / "fuzz" / "reached.py")]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(run, env=environment, capture_output=True, text=True, timeout=300, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_every_function_that_reads_a_file_is_reached_by_a_sound_file(read: dict[str, Any]) -> None:
    readers = {
        name
        for name in functions_with_a_path()
        if not name.partition(":")[2].lstrip("_").startswith(("write", "export"))
    }
    assert len(readers) > 100
    assert sorted(readers - OTHERS.keys() - set(read["reached"])) == []
    assert OTHERS.keys() <= readers


def test_sound_files_are_accepted(read: dict[str, Any]) -> None:
    """Exit code 1: read, and the answer needs a person."""
    assert {name: code for name, code in read["codes"].items() if code > 1} == {}


def test_every_format_of_measurements_has_a_sound_file() -> None:
    endings = {seed.suffix or kind.suffix for kind in READERS.values() for seed in kind.seeds()}
    assert [known.name for known in FORMATS if not endings & set(known.endings)] == []


def test_cases_of_all_readers_are_run() -> None:
    assert sorted(test_fuzzed_files.READERS) == sorted(READERS)
