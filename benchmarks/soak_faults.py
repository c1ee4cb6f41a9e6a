"""What befalls the monitor in a soak, when, and by which word its history has to name it."""

import json
import os
import resource
import signal
import sqlite3
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import psutil
from soak_memory import HOUR
from soak_rig import CUT, CYCLE, LEAST, LEDGER, SILENCE, first_sampled

ANY = "*"  # device: all of them
_STILL = 1.0  # s without a line of the rig's ledger, which has twenty a second


class Soak(Protocol):
    """What faults are done to."""

    folder: Path
    monitor: psutil.Process
    viewer_port: int
    web_port: int

    def tell_rig(self, line: str) -> None:
        """Have the rig do something."""
        ...

    def start_monitor(self) -> None:
        """Start the monitor, and wait until it has started."""
        ...

    def webhook(self, *, up: bool) -> None:
        """Have notices taken, or refused."""
        ...

    def reload(self) -> None:
        """Change a setting and have it read."""
        ...

    def child(self, nice: int, port: int | None = None) -> psutil.Process:
        """Return a process of the monitor's by its priority, and the port that it serves."""
        ...


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One of them; times since the start of its cycle [s]."""

    what: str
    at: float
    seconds: float
    begin: Callable[[Soak], None] = lambda _: None
    end: Callable[[Soak], None] = lambda _: None
    device: str | None = None  #: whose scans may be missing; ANY, or None of nobody
    named: tuple[str, ...] = ()  #: events of the history that have to be there, each with the device
    before: float = 0.3  #: s from which on scans may be missing
    after: float = 1.0  #: s after it until which they may: until the device streams again
    once: bool = False  #: in the first cycle only
    ends: bool = False  #: ends a process: not in the last hour of a long soak, in which their memory is looked at
    by_rig: bool = False  #: timed by the rig, since its device first sampled


def _limit(soak: Soak, size: int) -> None:
    """Let no file of the monitor grow beyond a size: what a full disk does to a write."""
    resource.prlimit(soak.monitor.pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


class Locked:
    """The history's database, locked by somebody else."""

    def __init__(self) -> None:
        self._held: sqlite3.Connection | None = None

    def begin(self, soak: Soak) -> None:
        """Lock it."""
        self._held = sqlite3.connect(soak.folder / "state" / "history.sqlite", timeout=30.0, isolation_level=None)
        self._held.execute("BEGIN EXCLUSIVE")

    def end(self, _: Soak) -> None:
        """Let it go."""
        if self._held:
            self._held.close()


def _kill(soak: Soak) -> None:
    os.kill(soak.monitor.pid, signal.SIGKILL)
    soak.monitor.wait(10)


_LOCK = Locked()
LOST, BACK = "device_lost", "device_back"


def _plugged(what: str, device: str, at: float, seconds: float, how: str = "plug") -> Fault:
    return Fault(
        what=what,
        at=at,
        seconds=seconds,
        begin=lambda soak: soak.tell_rig(f"unplug {device}"),
        end=lambda soak: soak.tell_rig(f"{how} {device}"),
        device=device,
        named=(LOST, BACK),
    )


FAULTS = (
    _plugged("unplugged", "col_037", 60, 6),
    Fault(
        what="silent", at=SILENCE[1], seconds=SILENCE[2], device=SILENCE[0], named=(LOST, BACK), after=3.0, by_rig=True
    ),
    Fault(what="frames cut", at=CUT[1], seconds=CUT[2], device=CUT[0], named=("gap",), by_rig=True),
    _plugged("unplugged, then babble", "col_074", 160, 4, "babble"),
    Fault(
        what="disk full",
        at=190,
        seconds=10,
        begin=lambda soak: _limit(soak, 2000),
        end=lambda soak: _limit(soak, resource.RLIM_INFINITY),
        named=("recording_stopped", "recording_resumed"),
    ),
    Fault(
        what="database locked",
        at=230,
        seconds=20,
        begin=_LOCK.begin,
        end=_LOCK.end,
        named=("history_down", "history_back"),
    ),
    Fault(
        what="webhook down",
        at=270,
        seconds=25,
        begin=lambda soak: soak.webhook(up=False),
        end=lambda soak: soak.webhook(up=True),
        named=("notice_failed", "notice_back"),
    ),
    _plugged("unplugged, webhook down", "beam_mid", 275, 5),
    Fault(
        what="viewer killed",
        at=320,
        seconds=1,
        begin=lambda soak: soak.child(10, soak.viewer_port).kill(),
        named=("no_viewer", "viewer_back"),
        ends=True,
    ),
    Fault(
        what="pages killed",
        at=330,
        seconds=1,
        begin=lambda soak: soak.child(10, soak.web_port).kill(),
        named=("no_web", "web_back"),
        ends=True,
    ),
    Fault(
        what="analysis killed",
        at=400,
        seconds=1,
        begin=lambda soak: soak.child(5).kill(),
        named=("analysis_died",),
        ends=True,
    ),
    Fault(
        what="settings reloaded", at=440, seconds=1, begin=lambda soak: soak.reload(), named=("reloaded",), ends=True
    ),
    Fault(
        what="kill -9, restart",
        at=470,
        seconds=3,
        begin=_kill,
        end=lambda soak: soak.start_monitor(),
        device=ANY,
        named=("unclean_end",),
        before=0.5,
        once=True,
    ),
)


@dataclass(frozen=True)
class Spell:
    """A fault as it came to pass [ns UTC]."""

    fault: Fault
    begun: int
    ended: int

    def may_lose(self, device: str, time_ns: int) -> bool:
        """Tell whether a scan that a device took at a time may be missing for it."""
        if self.fault.device not in (ANY, device):
            return False
        first, last = self.begun - int(self.fault.before * 1e9), self.ended + int(self.fault.after * 1e9)
        return first <= time_ns <= last


def _times(fault: Fault, seconds: float) -> list[float]:
    """Return when a fault begins in a soak of a length [s]."""
    times = [CYCLE * cycle + fault.at for cycle in range(1 if fault.once else int(seconds // CYCLE) + 1)]
    spared = seconds - HOUR - 1.5 * CYCLE if fault.ends and seconds >= 2 * HOUR - CYCLE else seconds
    return [at for at in times if at + fault.seconds + LEAST < seconds and at <= spared]


def by_rig(folder: Path, seconds: float) -> list[Spell]:
    """Return what the rig has done by its own clocks in a soak of a length [s]."""
    spells = []
    for fault in FAULTS:
        if fault.by_rig and fault.device:
            first = first_sampled(folder, fault.device)
            begins = [first + int(at * 1e9) for at in _times(fault, seconds)]
            spells += [Spell(fault, begun, begun + int(fault.seconds * 1e9)) for begun in begins]
    return spells


def stood_still(folder: Path) -> list[Spell]:
    """Return when the rig had no processor: its devices are silent then, and drop what finds their lines full."""
    with (folder / LEDGER).open(encoding="utf-8") as file:
        times = [int(json.loads(line)["time"]) for line in file]
    fault = Fault(what="the rig stood still", at=0.0, seconds=0.0, device=ANY, after=3.0)
    return [Spell(fault, begun, ended) for begun, ended in pairwise(times) if ended - begun > _STILL * 1e9]


def played(soak: Soak, seconds: float, look: Callable[[], None]) -> list[Spell]:
    """Have all other faults happen, cycle after cycle; `look` is called all the while."""
    begun = time.monotonic()
    times = [(at, fault) for fault in FAULTS if not fault.by_rig for at in _times(fault, seconds)]
    steps = [(at + (fault.seconds if ends else 0.0), ends, fault) for at, fault in times for ends in (False, True)]
    spells: list[Spell] = []
    started: dict[str, int] = {}
    for at, ends, fault in sorted(steps, key=lambda step: step[:2]):
        while time.monotonic() - begun < at:
            look()
        if ends:
            fault.end(soak)
            spells.append(Spell(fault, started[fault.what], time.time_ns()))
        else:
            started[fault.what] = time.time_ns()
            fault.begin(soak)
    while time.monotonic() - begun < seconds:
        look()
    return spells
