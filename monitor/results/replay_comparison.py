"""Comparison of the results of a replay with those of the live run, value by value.

Processors differ in rounding. Numbers are therefore compared relative to the largest number of the same field in a
result, such as the increments of all nodes. Texts are not compared, because they repeat numbers of other fields.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from monitor.results.windows import AlarmResult, ReferenceResult, Result, WindowResult

#: relative: kernels of linear algebra for other processors change results of the shipped log by up to 1e-8
ROUNDING = 1e-6
_TEXTS = frozenset({"error", "found", "next_measurement", "note", "outlook", "problem", "text", "why"})
Path = tuple[str | int, ...]
_MISSING = object()


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Value of a result that differs between replay and live run."""

    result: str  #: such as `window 12`
    value: str  #: such as `modes.3.frequency`
    found: Any
    live: Any
    relative: float  #: for numbers: relative to the largest number of the same field; else infinite [-]


@dataclass(frozen=True, kw_only=True)
class ReplayComparison:
    """Agreement of the results of a replay with those of the live run."""

    largest: Difference | None  #: largest one before `first`
    first: Difference | None  #: first one that is larger than rounding

    @property
    def kind(self) -> Literal["identical", "rounding", "different"]:
        """Class of the largest difference."""
        if self.first:
            return "different"
        return "rounding" if self.largest else "identical"

    @property
    def text(self) -> str:
        """Return the comparison as a sentence."""
        if self.first:
            d = self.first
            return f"NOT the same as live from {d.result} on: {d.value} is {_shown(d.found)}, live {_shown(d.live)}"
        if self.largest:
            d = self.largest
            return (
                f"the same as live, within rounding: largest relative difference {d.relative:.1e}, "
                f"{d.value} of {d.result}"
            )
        return "the same as live, to the last digit"

    def payload(self) -> dict[str, Any]:
        """Return the comparison as JSON values."""
        shown = self.first or self.largest
        at = {"result": shown.result, "value": shown.value} if shown else None
        relative = shown.relative if shown and math.isfinite(shown.relative) else None
        return {"kind": self.kind, "relative_difference": relative if shown else 0.0, "at": at}


def compare_results(found: Sequence[Result], live: Sequence[Result]) -> ReplayComparison:
    """Compare results of a replay with those of the log; fields that are missing in an older log are left out."""
    largest: Difference | None = None
    for number, result in enumerate(live):
        recorded = json.loads(result.model_dump_json(exclude_unset=True))
        name = _name(result)
        if number >= len(found) or _name(found[number]) != name:
            other = _name(found[number]) if number < len(found) else None
            first = Difference(result=name, value="result", found=other, live=name, relative=math.inf)
            return ReplayComparison(largest=largest, first=first)
        for difference in _differences(name, found[number].payload(), recorded):
            if difference.relative > ROUNDING:
                return ReplayComparison(largest=largest, first=difference)
            if largest is None or difference.relative > largest.relative:
                largest = difference
    return ReplayComparison(largest=largest, first=None)


def _name(result: Result) -> str:
    if isinstance(result, WindowResult):
        return f"window {result.index}"
    if isinstance(result, ReferenceResult):
        return "the reference"
    return f"alarm state {result.state!r}" if isinstance(result, AlarmResult) else "the self-test"


def _missing(values: Iterable[Path], path: Path) -> str:
    """Return what is in place of a value that a result does not have."""
    return "several values" if any(other[: len(path)] == path for other in values) else "absent"


def _differences(name: str, found: Any, live: Any) -> Iterator[Difference]:  # noqa: ANN401 - JSON values
    values, expected = dict(_flat(found)), dict(_flat(live))
    largest: dict[Path, float] = {}
    for path, value in expected.items():
        if _is_number(value):
            largest[_kind(path)] = max(largest.get(_kind(path), 0.0), abs(value))
    for path, value in expected.items():
        other = values.get(path, _MISSING)
        if other == value:
            continue
        relative = math.inf
        if _is_number(value) and _is_number(other):
            relative = abs(other - value) / max(largest[_kind(path)], abs(other))
        shown = _missing(values, path) if other is _MISSING else other
        yield Difference(result=name, value=".".join(map(str, path)), found=shown, live=value, relative=float(relative))


def _flat(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:  # noqa: ANN401 - JSON values
    """Yield path and value of all fields but texts, and the length of every list."""
    if isinstance(value, dict):
        for key, part in value.items():
            if key not in _TEXTS:
                yield from _flat(part, (*path, key))
    elif isinstance(value, list):
        yield (*path, "length"), str(len(value))
        for number, part in enumerate(value):
            yield from _flat(part, (*path, number))
    else:
        yield path, value


def _kind(path: Path) -> Path:
    """Return a path without its list indices."""
    return tuple(part for part in path if isinstance(part, str))


def _is_number(value: Any) -> bool:  # noqa: ANN401 - JSON values
    """Return whether a value is subject to rounding; times, indices and counts are integers and are not."""
    return isinstance(value, float)


def _shown(value: Any) -> str:  # noqa: ANN401 - JSON values
    return f"{value:.6g}" if isinstance(value, float) else str(value)
