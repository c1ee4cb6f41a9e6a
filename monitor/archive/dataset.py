"""Results as Parquet: four tables, each with one file per log in folders by site (`site=NAME`)."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from monitor.results.windows import AlarmResult, Result, WindowResult
from monitor.text.causes import change_text

if TYPE_CHECKING:
    import pyarrow as pa


def schemas() -> "Mapping[str, pa.Schema]":
    """Return the tables: their columns and types; times are UTC, frequencies in Hz, masses in kg, positions in m."""
    import pyarrow as pa

    time, text, number = pa.timestamp("ns", tz="UTC"), pa.string(), pa.float64()
    window = {"log": text, "window": pa.int64(), "start": time}
    return {
        "windows": pa.schema(
            window
            | {
                "end": time,
                "phase": text,
                "problem": text,
                "n_modes": pa.int32(),
                "novelty": number,
                "limit": number,
                "verdict": text,
                "causes": text,
                "mass": number,
                "mass_std": number,
                "member": text,
                "x": number,
                "y": number,
                "z": number,
            }
        ),
        "modes": pa.schema(
            window
            | {
                "mode": pa.int32(),
                "frequency": number,
                "frequency_std": number,
                "damping": number,
                "damping_std": number,
                "shift_percent": number,
                "shift_std_percent": number,
                "channels": pa.list_(text),
                "shape": pa.list_(number),
            }
        ),
        "alarms": pa.schema({"log": text, "time": time, "state": text, "kind": text, "text": text}),
        "logs": pa.schema(
            {"log": text, "bytes": pa.int64(), "windows": pa.int64(), "seconds": number, "problem": text}
        ),
    }


def write_tables(
    folder: Path, site: str, part: str, log: str, results: Sequence[Result], about: Mapping[str, Any]
) -> None:
    """Write the results of one log; files of the same part are replaced.

    Parameters
    ----------
    folder : of the results
    site : name of the site
    part : name of the files
    log : name of the log
    results : of the log
    about : row of the table `logs`, without `log`
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    windows = [result for result in results if isinstance(result, WindowResult)]
    rows = {
        "windows": [_window(log, window) for window in windows],
        "modes": [row for window in windows for row in _modes(log, window)],
        "alarms": [
            {"log": log, "time": a.time, "state": a.state, "kind": a.kind, "text": a.text}
            for a in results
            if isinstance(a, AlarmResult)
        ],
        "logs": [{"log": log, **about}],
    }
    for name, schema in schemas().items():
        path = folder / name / f"site={site}" / f"{part}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(".part")
        pq.write_table(pa.Table.from_pylist(rows[name], schema=schema), unfinished)
        unfinished.replace(path)


def keep_parts(folder: Path, parts: Collection[str], sites: Collection[str]) -> None:
    """Remove the files of some sites that an earlier run has written for logs that are not among these parts."""
    for name in schemas():
        for site in sites:
            for path in (folder / name / f"site={site}").glob("*.parquet"):
                if path.stem not in parts:
                    path.unlink()


def _window(log: str, window: WindowResult) -> dict[str, Any]:
    answer, diagnosis, novelty = window.answer, window.diagnosis, window.novelty
    place = answer.position if answer else (None, None, None)
    return {
        "log": log,
        "window": window.index,
        "start": window.start,
        "end": window.end,
        "phase": window.phase,
        "problem": window.problem,
        "n_modes": len(window.modes),
        "novelty": novelty.t2 if novelty else None,
        "limit": novelty.limit if novelty else None,
        "verdict": diagnosis.verdict if diagnosis else None,
        "causes": change_text(diagnosis) if diagnosis else None,
        "mass": answer.mass if answer else None,
        "mass_std": answer.mass_std if answer else None,
        "member": answer.member if answer else None,
        **dict(zip("xyz", place, strict=True)),
    }


def _modes(log: str, window: WindowResult) -> list[dict[str, Any]]:
    return [
        {
            "log": log,
            "window": window.index,
            "start": window.start,
            "mode": mode.id,
            "frequency": mode.frequency,
            "frequency_std": mode.frequency_std,
            "damping": mode.damping,
            "damping_std": mode.damping_std,
            "shift_percent": mode.shift_percent,
            "shift_std_percent": mode.shift_std_percent,
            "channels": window.channels,
            "shape": mode.shape,
        }
        for mode in window.modes
    ]
