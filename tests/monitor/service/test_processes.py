"""Start and memory of the monitor's child processes."""

import gc
import multiprocessing
import os
import platform
import subprocess
import sys

import pytest

from monitor.service.processes import LastWords, environment, held_memory, report_end

MAPPED = """
import ctypes
class Info(ctypes.Structure):
    names = ("arena", "ordblks", "smblks", "hblks", "mapped", "usmblks", "fsmblks", "used", "free", "keepcost")
    _fields_ = tuple(zip(names, (ctypes.c_size_t,) * len(names)))
libc = ctypes.CDLL(None)
libc.mallinfo2.restype = Info
{first}
bytes(20_000_000)  # after which glibc by itself takes what is smaller from the heap
before = libc.mallinfo2().mapped
kept = bytes(1_000_000)
print(libc.mallinfo2().mapped - before)
"""


TRIMMED = """
from monitor.service.processes import trim_memory
def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096
blocks = [bytes(2000) for _ in range(50_000)]
kept = blocks[::100]  # which keep the heap from shrinking by itself
del blocks
before = resident()
trim_memory()
print(before - resident())
"""
of_glibc = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="of glibc's malloc alone")


def reported(script: str) -> int:
    """Return the number that a script prints, run in a process of its own."""
    plain = {name: value for name, value in os.environ.items() if not name.startswith("MALLOC_")}
    command = [sys.executable, "-c", script]
    return int(subprocess.run(command, capture_output=True, text=True, check=True, env=plain).stdout)


@of_glibc
def test_large_blocks_stay_memory_mapped_after_a_larger_one_was_freed() -> None:
    first = "from monitor.service.processes import give_back_memory\ngive_back_memory()"
    assert reported(MAPPED.format(first="")) == 0
    assert reported(MAPPED.format(first=first)) >= 1_000_000


@of_glibc
def test_trim_returns_freed_small_blocks_to_the_system() -> None:
    assert reported(TRIMMED) > 50_000_000  # of 100 million bytes


def test_environment_variables_are_restored_after_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("KNOWN", "before")
    monkeypatch.delenv("FRESH", raising=False)
    with environment({"KNOWN": "now", "FRESH": "too"}):
        assert (os.environ["KNOWN"], os.environ["FRESH"]) == ("now", "too")
    assert os.environ["KNOWN"] == "before"
    assert "FRESH" not in os.environ


@of_glibc
def test_held_memory_counts_allocated_but_not_freed_objects() -> None:
    gc.collect()  # what is freed meanwhile would count against what is taken
    before = held_memory()
    kept = [[number] for number in range(100_000)], bytes(20_000_000)
    held = held_memory()
    assert 100_000 <= held["blocks"] - before["blocks"] < 300_000
    assert 18_000_000 < held["heap_bytes"] - before["heap_bytes"] < 30_000_000
    del kept
    after = held_memory()
    assert abs(after["blocks"] - before["blocks"]) < 5000
    assert abs(after["heap_bytes"] - before["heap_bytes"]) < 1_000_000


def _fail(*_: object) -> None:
    raise LookupError("token=secret")


def test_child_failure_is_reported_only_to_the_parent(capfd: pytest.CaptureFixture[str]) -> None:
    words = LastWords()
    process = multiprocessing.get_context("fork").Process(target=report_end, args=(words.sender, _fail, 1))
    process.start()
    words.started()
    process.join(10.0)
    assert words.text(process).startswith("its process ended with code 70: LookupError (test_processes.py:")
    assert "".join(capfd.readouterr()) == ""
