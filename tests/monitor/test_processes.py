"""What processes of the monitor's own find when they start, and what they keep of memory."""

import os
import platform
import subprocess
import sys

import pytest

from monitor.processes import environment

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


def mapped(first: str) -> int:
    """Return how much more is mapped from the system for a million bytes, in a process of its own."""
    found = subprocess.run(
        [sys.executable, "-c", MAPPED.format(first=first)], capture_output=True, text=True, check=True
    )
    return int(found.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="of glibc's malloc alone")
def test_large_blocks_go_back_to_the_system_also_after_a_larger_one_was_freed() -> None:
    assert mapped("") == 0
    assert mapped("from monitor.processes import give_back_memory\ngive_back_memory()") >= 1_000_000


def test_variables_are_as_before_once_the_processes_are_started(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("KNOWN", "before")
    monkeypatch.delenv("FRESH", raising=False)
    with environment({"KNOWN": "now", "FRESH": "too"}):
        assert (os.environ["KNOWN"], os.environ["FRESH"]) == ("now", "too")
    assert os.environ["KNOWN"] == "before"
    assert "FRESH" not in os.environ
