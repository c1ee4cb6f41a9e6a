"""The numbers behind the pictures, as components that a dataframe query of the recording reads back unrounded."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from daq import FloatArray
from monitor.results.windows import Interval, MassAnswer, MassIncrements, OtherPlace


def write_posterior(recording: rr.RecordingStream, answer: MassAnswer) -> None:
    """Write the posterior along the members, the 95 % region, and the answer, in SI units."""
    at = np.array([p.position for p in answer.profile], float).reshape(-1, 3)
    _write(
        recording,
        "/posterior/numbers",
        "Posterior",
        member=[p.member for p in answer.profile],
        **_axes("at", at),
        density=np.array([p.density for p in answer.profile]),
        mass=np.array([p.mass for p in answer.profile]),
    )
    _write(recording, "/posterior/region/numbers", "Region", **_stretches(answer.region))
    places: list[MassAnswer | OtherPlace] = [answer, *answer.others]
    _write(
        recording,
        "/answer/numbers",
        "Answer",
        member=[p.member for p in places],
        **_axes("at", np.array([p.position for p in places], float)),
        position_std=np.array([p.position_std for p in places], float),
        mass=np.array([p.mass for p in places], float),
        mass_std=np.array([p.mass_std for p in places], float),
    )


def write_increments(recording: rr.RecordingStream, direction: int, path: str, found: MassIncrements) -> None:
    """Write a direction's increments, a number a node of the reference in its order [kg]; not-a-number where none."""
    _write(
        recording,
        f"{path}/numbers",
        "Increments",
        increment=_column(found.increment, direction),
        increment_std=_column(found.increment_std, direction),
        normalised=_column(found.normalised, direction),
        normalised_std=_column(found.normalised_std, direction),
        z_limit=np.array([found.z_limit]),
    )


def _column(rows: Sequence[tuple[float | None, float | None, float | None]], direction: int) -> FloatArray:
    values = [row[direction] for row in rows]
    return np.array([np.nan if value is None else value for value in values], float)


def _stretches(region: list[Interval]) -> dict[str, FloatArray | list[str]]:
    start, end = (np.array([getattr(r, e) for r in region], float).reshape(-1, 3) for e in ("start", "end"))
    return {"member": [r.member for r in region], **_axes("from", start), **_axes("to", end)}


def _axes(name: str, points: FloatArray) -> dict[str, FloatArray]:
    """Return the columns of points (n, 3) [m]."""
    return {f"{name}_{axis}": points[:, i] for i, axis in enumerate("xyz")}


def _write(recording: rr.RecordingStream, path: str, what: str, **columns: FloatArray | list[str]) -> None:
    """Write columns whose names in the recording are `modalwatch.WHAT:NAME`."""
    recording.log(path, rr.DynamicArchetype(f"modalwatch.{what}", components=columns))
