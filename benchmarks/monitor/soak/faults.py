"""Faults of the monitor in a soak: their times, and the event that names each in the history."""

import json
import os
import resource
import signal
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import psutil

from benchmarks.monitor.soak.memory import HOUR
from benchmarks.monitor.soak.rig import CUT, CYCLE, LEDGER, MIN, SILENCE, first_sampled

ANY = "*"  # device: all of them
_STILL = 1.0  # s without a line of the rig's ledger, which has twenty a second


class Soak(Protocol):
    """The running soak on which faults act."""

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

    def webhook(self, *, up: bool, hostile: str = "") -> None:
        """Let notices be accepted, refused, or answered by a hostile reply: "retry" or "trickle"."""
        ...

    def reload(self, more: str = "") -> None:
        """Change a setting, or add text to the file, and have it read."""
        ...

    def write_site(self) -> None:
        """Write the settings."""
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
    """Limit the size of all files of the monitor: the effect of a full disk on a write."""
    resource.prlimit(soak.monitor.pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


class Locked:
    """The history's database, locked by another process."""

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


LOST, BACK = "device_failed", "device_recovered"


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


def _hostile(kind: str, at: float, device: str) -> tuple[Fault, Fault]:
    """Return a fault of the webhook, with a device unplugged during it, so that there is an event to send."""

    def begin(soak: Soak) -> None:
        soak.webhook(up=False)
        soak.webhook(up=True, hostile=kind)

    def end(soak: Soak) -> None:
        soak.webhook(up=False)
        soak.webhook(up=True)

    named = "notice_failed", "notice_recovered"
    fault = Fault(what=f"webhook: {kind}", at=at, seconds=12, begin=begin, end=end, named=named)
    return fault, _plugged(f"unplugged, webhook: {kind}", device, at + 1, 3)


def _history(soak: Soak) -> Path:
    return soak.folder / "state" / "history.sqlite"


def _damage_history(soak: Soak) -> None:
    """Overwrite a page of an index: SQLite calls the file malformed, and all rows can still be read."""
    with closing(sqlite3.connect(_history(soak), timeout=10.0)) as base:
        base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        page = base.execute("SELECT rootpage FROM sqlite_master WHERE name = 'modes_by_time'").fetchone()[0]
        size = base.execute("PRAGMA page_size").fetchone()[0]
    with _history(soak).open("r+b") as raw:
        raw.seek((page - 1) * size)
        raw.write(b"\xa5" * size)


def _delete_history(soak: Soak) -> None:
    for path in _history(soak).parent.glob("history.sqlite*"):
        path.unlink()


def _newest_log(soak: Soak) -> Path:
    return max((soak.folder / "log").glob("*.mcap"), key=lambda path: path.stat().st_mtime)


def _move_log(soak: Soak) -> None:
    path = _newest_log(soak)
    path.rename(path.with_name(f"moved_{path.name}"))


_LOCK = Locked()


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
        named=("recording_failed", "recording_recovered"),
    ),
    Fault(
        what="database locked",
        at=230,
        seconds=20,
        begin=_LOCK.begin,
        end=_LOCK.end,
        named=("history_failed", "history_recovered"),
    ),
    Fault(
        what="log deleted",
        at=212,
        seconds=1,
        begin=lambda soak: _newest_log(soak).unlink(),
        device=ANY,
        named=("log_file_lost",),
        before=24.0,  # since the disk was full: what memory kept then is in the file, too
        after=1.5,
    ),
    Fault(what="log moved", at=218, seconds=1, begin=_move_log, named=("log_file_lost",)),
    Fault(
        what="history damaged",
        at=256,
        seconds=1,
        begin=_damage_history,
        named=("history_failed", "history_renewed", "history_restored", "history_recovered"),
    ),
    Fault(
        what="history deleted",
        at=306,
        seconds=1,
        begin=_delete_history,
        named=("history_failed", "history_renewed", "history_recovered"),
    ),
    *_hostile("trickle", 336, "col_074"),
    *_hostile("retry", 375, "col_037"),  # its notices may wait a minute
    Fault(
        what="settings nested too deep",
        at=425,
        seconds=1,
        begin=lambda soak: soak.reload("x = " + "[" * 20_000 + "]" * 20_000),
        end=lambda soak: soak.write_site(),
        named=("reload_refused",),
    ),
    Fault(
        what="webhook down",
        at=270,
        seconds=25,
        begin=lambda soak: soak.webhook(up=False),
        end=lambda soak: soak.webhook(up=True),
        named=("notice_failed", "notice_recovered"),
    ),
    _plugged("unplugged, webhook down", "beam_mid", 275, 5),
    Fault(
        what="viewer killed",
        at=320,
        seconds=1,
        begin=lambda soak: soak.child(10, soak.viewer_port).kill(),
        named=("viewer_failed", "viewer_recovered"),
        ends=True,
    ),
    Fault(
        what="pages killed",
        at=330,
        seconds=1,
        begin=lambda soak: soak.child(10, soak.web_port).kill(),
        named=("web_failed", "web_recovered"),
        ends=True,
    ),
    Fault(
        what="analysis killed",
        at=400,
        seconds=1,
        begin=lambda soak: soak.child(5).kill(),
        named=("analysis_failed",),
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
        """Return whether a scan taken by a device at a time may be missing because of it."""
        if self.fault.device not in (ANY, device):
            return False
        first, last = self.begun - int(self.fault.before * 1e9), self.ended + int(self.fault.after * 1e9)
        return first <= time_ns <= last


def _times(fault: Fault, seconds: float) -> list[float]:
    """Return when a fault begins in a soak of a length [s]."""
    times = [CYCLE * cycle + fault.at for cycle in range(1 if fault.once else int(seconds // CYCLE) + 1)]
    spared = seconds - HOUR - 1.5 * CYCLE if fault.ends and seconds >= 2 * HOUR - CYCLE else seconds
    return [at for at in times if at + fault.seconds + MIN < seconds and at <= spared]


def by_rig(folder: Path, seconds: float) -> list[Spell]:
    """Return the events of the rig by its own clocks in a soak of a length [s]."""
    spells = []
    for fault in FAULTS:
        if fault.by_rig and fault.device:
            first = first_sampled(folder, fault.device)
            begins = [first + int(at * 1e9) for at in _times(fault, seconds)]
            spells += [Spell(fault, begun, begun + int(fault.seconds * 1e9)) for begun in begins]
    return spells


def stood_still(folder: Path) -> list[Spell]:
    """Return the periods without processor time for the rig: its devices are silent then, and drop scans."""
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
