"""Results as Parquet: four tables, each with one file per log in folders by site (`site=NAME`)."""

import io
from collections.abc import Collection, Mapping
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
                **dict.fromkeys("xyz", number),
            }
        ),
        "modes": pa.schema(
            window
            | {"mode": pa.int32()}
            | dict.fromkeys((f"{name}{std}" for name in ("frequency", "damping") for std in ("", "_std")), number)
            | {"shift_percent": number, "shift_std_percent": number}
            | {"channels": pa.list_(text), "shape": pa.list_(number)}
        ),
        "alarms": pa.schema({"log": text, "time": time, "state": text, "kind": text, "text": text}),
        "logs": pa.schema(
            {"log": text, "bytes": pa.int64(), "windows": pa.int64(), "seconds": number, "problem": text}
        ),
    }


class LogTables:
    """Rows of the tables of one log, so far.

    Parameters
    ----------
    log : name of the log
    """

    def __init__(self, log: str) -> None:
        self._log = log
        self._rows: dict[str, list[dict[str, Any]]] = {"windows": [], "modes": [], "alarms": []}

    def add(self, result: Result) -> None:
        """Add the next result of the log."""
        if isinstance(result, WindowResult):
            self._rows["windows"].append(_window(self._log, result))
            self._rows["modes"] += _modes(self._log, result)
        elif isinstance(result, AlarmResult):
            row = {"time": result.time, "state": result.state, "kind": result.kind, "text": result.text}
            self._rows["alarms"].append({"log": self._log, **row})

    def files(self, n_bytes: int, n_windows: int, seconds: float, problem: str | None) -> dict[str, bytes]:
        """Return the tables as Parquet files, by their names.

        Parameters
        ----------
        n_bytes : size of the log
        n_windows : that were identified
        seconds : of data in the windows
        problem : reason why it was not analysed to its end
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        about = {"log": self._log, "bytes": n_bytes, "windows": n_windows, "seconds": seconds, "problem": problem}
        rows, found = self._rows | {"logs": [about]}, {}
        for name, schema in schemas().items():
            file = io.BytesIO()
            pq.write_table(pa.Table.from_pylist(rows[name], schema=schema), file)
            found[name] = file.getvalue()
        return found


def write_tables(folder: Path, site: str, part: str, tables: Mapping[str, bytes]) -> None:
    """Write the tables of one log; files of the same part are replaced.

    Parameters
    ----------
    folder : of the results
    site : name of the site
    part : name of the files
    tables : of the log, as Parquet files
    """
    for name, content in tables.items():
        path = folder / name / f"site={site}" / f"{part}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(".part")
        unfinished.write_bytes(content)
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
            "channels": window.channels,
            **mode.model_dump(exclude={"id"}),
        }
        for mode in window.modes
    ]
