"""Results of a soak: the scans in the logs, each by its number, and the faults in the history, each by its event."""

import json
import sqlite3
from pathlib import Path

import numpy as np

from benchmarks.monitor.soak.faults import ANY, Spell
from benchmarks.monitor.soak.rig import LEDGER, places
from daq import Block, read_log


def numbers(folder: Path, axes: dict[str, int]) -> dict[str, np.ndarray]:
    """Return the numbers of the scans in the logs, device by device, in the order of the logs."""
    found: dict[str, list[np.ndarray]] = {name: [] for name in axes}
    for path in sorted((folder / "log").glob("*.mcap"), key=lambda path: path.name):
        for item in read_log(path):
            if isinstance(item, Block):
                found[item.device].append(item.counts[:, axes[item.device]])
    return {name: np.concatenate([*parts, np.zeros(0, int)]).astype(int) for name, parts in found.items()}


def missing(folder: Path, spells: list[Spell], n: int, end: int) -> tuple[list[str], bool]:
    """Return a row of the table a device, and whether nothing is missing without a reason."""
    axes = {name: next(i for i, axis in enumerate("xyz") if axis not in a) for name, (_, a) in places(n).items()}
    with (folder / LEDGER).open(encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    times = np.array([line["time"] for line in lines])
    rows, well = [], True
    for name, logged in numbers(folder, axes).items():
        taken = np.array([line["taken"][name] for line in lines])
        last = int(np.interp(end, times, taken))
        there = np.zeros(taken[-1] + 1, int)
        np.add.at(there, logged[(logged >= 0) & (logged < len(there))], 1)
        gone = np.flatnonzero(there[:last] == 0)
        when = np.interp(gone, taken + np.arange(len(taken)) * 1e-9, times)
        excused = np.array([any(s.may_lose(name, int(t)) for s in spells) for t in when], bool)
        odd = int(np.count_nonzero(~excused)) if len(gone) else 0
        twice = int(np.count_nonzero(there > 1)) + int(np.count_nonzero((logged < 0) | (logged >= len(there))))
        well &= odd == 0 and twice == 0
        killed = [s.begun for s in spells if "unclean_end" in s.fault.named]
        early = [(begun - t) / 1e9 for begun in killed for t in when if 0 < begun - t < 10e9]
        rows.append(f"| {name} | {last} | {len(gone)} | {odd} | {twice} | {max(early, default=0.0):.2f} |")
        for k in np.flatnonzero(~excused)[:3] if len(gone) else ():
            rows.append(
                f"| (first odd ones: {gone[k]} at {when[k] / 1e9 - times[0] / 1e9:.2f} s of the rig) | | | | | |"
            )
    return rows, well


def named(folder: Path, spells: list[Spell]) -> tuple[list[str], bool]:
    """Return a row a fault: whether the history names it, in its time."""
    with sqlite3.connect(folder / "state" / "history.sqlite") as base:
        events = base.execute("SELECT time, topic, device FROM events").fetchall()
    rows, well = [], True
    for spell in spells:
        fault, late = spell.fault, spell.ended + int(100e9)  # a window, and what is tried again after a minute
        device = fault.device if fault.device not in (None, ANY) else None
        label = {
            topic.removeprefix("/event/")
            for at, topic, of in events
            if spell.begun - 1e9 <= at <= late and (device is None or of in ("", device))
        }
        there = all(name in label for name in fault.named)
        well &= there
        words = ", ".join(f"`{name}`" if name in label else f"`{name}` MISSING" for name in fault.named)
        rows.append(
            f"| {fault.what}{f' ({device})' if device else ''} | {(spell.ended - spell.begun) / 1e9:.1f} | {words} |"
        )
    return rows, well
