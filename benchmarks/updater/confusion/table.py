"""Results of the confusion matrices: kept in a file of JSON lines, counted, and printed as tables."""

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict
from scipy.stats import beta

ROOT = Path(__file__).parents[3]
OUTCOMES = ("right", "alias", "wrong", "misplaced", "refused", "missed")
_TASKS = ("detectable", "nothing", "small", "two", "three", "outside")


class Result(BaseModel):
    """One case judged."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    cell: str
    seed: int
    noise: str
    kind: str
    outcome: str
    reported: str
    done: str = ""
    away: float | None = None  #: m
    errors: dict[str, float] = {}
    deviations: dict[str, float] = {}  #: stated standard deviations of the parameters in `errors`
    inside: bool | None = None  #: whether the true place is in the stated 95 % region
    probability: float | None = None  #: stated, of the first set of causes
    first_is_right: bool | None = None
    true: dict[str, float] = {}
    before: float | None = None  #: root mean square error of frequencies held out [%]
    after: float | None = None
    floor: float | None = None  #: what noise alone would leave of it [%]
    seconds: float = 0.0  #: of processor time


def version() -> str:
    """Return a digest of the code under test and of the code that tests it."""
    files = [*ROOT.glob("updater/**/*.py"), *ROOT.glob("tests/examiner/**/*.py"), *ROOT.glob("monitor/analysis/*.py")]
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def read_results(path: Path, code: str) -> list[Result]:
    """Read the results of this version of the code from a file; an unfinished last line is skipped."""
    if not path.exists():
        return []
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            content = json.loads(line)
        except json.JSONDecodeError:
            continue
        if content.get("version") == code:
            found.append(Result.model_validate(content))
    return found


def tables(results: Sequence[Result]) -> str:
    """Return the matrix, the shares, the accuracies and the misses as Markdown."""
    parts = [_matrix, _shares, _reliability, _coverage, _accuracies, _misses]
    return "\n\n".join(text for part in parts if (text := part(results)))


def _matrix(results: Sequence[Result]) -> str:
    rows = ["| done | draws | " + " | ".join(OUTCOMES) + " |", "|:--" + "|---:" * (1 + len(OUTCOMES)) + "|"]
    for kind in _TASKS:
        for cell in dict.fromkeys(sorted(r.cell for r in results if r.kind == kind)):
            these = [r for r in results if r.cell == cell]
            counts = [sum(r.outcome == o for r in these) for o in OUTCOMES]
            rows.append(f"| {cell} | {len(these)} | " + " | ".join(str(n or "") for n in counts) + " |")
    return "\n".join(rows)


def _share(what: str, wanted: str, good: Iterable[bool]) -> str:
    of = list(good)
    return f"| {what} | {sum(of)} of {len(of)} | {100 * np.mean(of):.1f} % | {wanted} |" if of else ""


def _shares(results: Sequence[Result]) -> str:
    def of(*kinds: str) -> list[Result]:
        return [r for r in results if r.kind in kinds]

    def fine(r: Result) -> bool:
        return r.outcome in {"right", "alias"}

    named = [
        r for r in of("detectable", "two", "three", "small") if r.outcome in {"right", "alias", "wrong", "misplaced"}
    ]
    rows = [
        "| | | | wanted |\n|:--|---:|---:|---:|",
        _share("one cause that can be detected: right first answer", ">= 97 %", map(fine, of("detectable"))),
        _share("right where something is named", ">= 99 %", map(fine, named)),
        _share("false alarms on nothing", "<= 1 %", (r.outcome != "right" for r in of("nothing"))),
        _share("too small to be detected: nothing false is named", "", (r.outcome != "wrong" for r in of("small"))),
        _share("in no catalogue: refused", ">= 95 %", (r.outcome == "right" for r in of("outside"))),
        _share("two causes at once: both right", ">= 90 %", map(fine, of("two"))),
        _share("three causes at once: all right", "", map(fine, of("three"))),
    ]
    return "\n".join(row for row in rows if row)


_TIMES = (
    ("one cause or none", ("detectable", "nothing"), "<= 1.5 s"),
    ("two causes", ("two",), "<= 5 s"),
    ("three causes", ("three",), ""),
)  # kinds of draws whose processor time is stated, and the wanted one
_STATED = (0.0, 0.5, 0.8, 0.9, 0.99, 0.999, 1.0)  # bounds of the classes of stated probabilities


def _reliability(results: Sequence[Result]) -> str:
    """Return the share of right answers by their stated probability, with its 95 % interval (Clopper, Pearson 1934)."""
    rows = [
        "| stated probability | mean | answers | right | share right | 95 % interval |",
        "|:--|---:|---:|---:|---:|---:|",
    ]
    named = [r for r in results if r.probability is not None]
    for low, high in pairwise(_STATED):
        these = [r for r in named if low <= (r.probability or 0) < high or r.probability == high == 1]
        if not these:
            continue
        n, right, mean = len(these), sum(bool(r.first_is_right) for r in these), np.mean([r.probability for r in these])
        least = beta.ppf(0.025, right, n - right + 1) if right else 0.0
        most = beta.ppf(0.975, right + 1, n - right) if right < n else 1.0
        interval = f"{100 * least:.1f} to {100 * most:.1f} %"
        rows.append(f"| {low:g} to {high:g} | {mean:.4f} | {n} | {right} | {100 * right / n:.1f} % | {interval} |")
    return "\n".join(rows) if rows[2:] else ""


def _coverage(results: Sequence[Result]) -> str:
    """Return how many errors are within the stated deviations, and places within the stated regions."""
    rows = [
        "| of those named alone and right | n | within 1 deviation | within 2 | wanted |",
        "|:--|---:|---:|---:|:--|",
    ]
    right = [r for r in results if r.outcome in {"right", "alias"}]
    off: dict[str, list[float]] = {}
    for r in right:
        for name, error in r.errors.items():
            if r.deviations.get(name):
                off.setdefault(name, []).append(abs(error) / r.deviations[name])
    for name, values in sorted(off.items()):
        one, two = (100 * np.mean(np.array(values) <= k) for k in (1, 2))
        rows.append(f"| {name} | {len(values)} | {one:.0f} % | {two:.0f} % | 68 %, 95 % |")
    inside = [r.inside for r in right if r.inside is not None]
    if inside:
        rows.append(f"| place in the 95 % region | {len(inside)} | | {100 * np.mean(inside):.0f} % | 95 % |")
    return "\n".join(rows) if rows[2:] else ""


_FIGURES: tuple[tuple[str, str, str, str, Callable[[Result], float | None]], ...] = (
    ("local_stiffness", "place", "mm", "<= 15", lambda r: r.away and 1e3 * r.away),
    ("one_sided", "place", "mm", "<= 15", lambda r: r.away and 1e3 * r.away),
    ("one_sided", "loss about its axis", "%", "", lambda r: _absolute(r, "loss", 100)),
    ("added_mass", "place", "mm", "", lambda r: r.away and 1e3 * r.away),
    ("added_mass", "mass", "%", "", lambda r: _relative(r, "mass")),
    ("support_spring", "place", "mm", "", lambda r: r.away and 1e3 * r.away),
    ("distributed_mass", "place of its middle", "mm", "", lambda r: r.away and 1e3 * r.away),
    ("sensor_gain", "gain", "%", "<= 2", lambda r: _relative(r, "gain")),
    ("sensor_delay", "delay", "ms", "<= 0.05", lambda r: _absolute(r, "delay", 1e3)),
    ("sensor_orientation", "angle", "degrees", "<= 1", lambda r: _absolute(r, "angle", 180 / np.pi)),
    ("sensor_position", "shift", "mm", "", lambda r: _absolute(r, "shift", 1e3)),
    ("turned_device", "angle", "degrees", "<= 1", lambda r: _absolute(r, "angle", 180 / np.pi)),
    ("attached_oscillator", "place", "mm", "<= 15", lambda r: r.away and 1e3 * r.away),
    ("attached_oscillator", "frequency", "%", "<= 0.1", lambda r: _relative(r, "frequency")),
    ("axial_force", "force", "%", "<= 2", lambda r: _relative(r, "force")),
)


def _relative(r: Result, name: str) -> float | None:
    return 100 * abs(r.errors[name] / r.true[name]) if name in r.errors else None


def _absolute(r: Result, name: str, unit: float) -> float | None:
    return unit * abs(r.errors[name]) if name in r.errors else None


def _accuracies(results: Sequence[Result]) -> str:
    rows = ["| of those named alone | n | median | 90 % within | wanted |", "|:--|---:|---:|---:|---:|"]
    for cell, what, unit, wanted, figure in _FIGURES:
        reported = [figure(r) for r in results if r.cell == cell and r.outcome in {"right", "misplaced", "alias"}]
        off = [x for x in reported if x is not None]
        if off:
            median, most = np.median(off), np.quantile(off, 0.9)
            rows.append(f"| {cell}: {what} | {len(off)} | {median:.3g} {unit} | {most:.3g} {unit} | {wanted} |")
    gained = [r for r in results if r.outcome == "right" and r.before and r.after and r.before >= 1.0]
    if gained:
        ratio = [r.before / r.after for r in gained if r.before and r.after]
        left = [r.after / r.floor for r in gained if r.after and r.floor]
        if left:
            rows.append(
                f"| the same after, over what noise alone leaves | {len(left)} | {np.median(left):.2f} | "
                f"{np.quantile(left, 0.9):.2f} | <= 1.5 |"
            )
        rows.append(
            f"| error of held-out changes of frequency where it was 1 % or more: before over after | {len(ratio)} | "
            f"{np.median(ratio):.1f} | {np.quantile(ratio, 0.1):.1f} (90 % above) | >= 8 |"
        )
    for what, kinds, wanted in _TIMES:
        seconds = [r.seconds for r in results if r.kind in kinds and r.seconds]
        if seconds:
            rows.append(
                f"| processor time, {what} | {len(seconds)} | {np.median(seconds):.2f} s | "
                f"{np.quantile(seconds, 0.9):.2f} s | {wanted} |"
            )
    return "\n".join(rows)


def _misses(results: Sequence[Result]) -> str:
    lines = [
        f"- {r.cell}, seed {r.seed}: {r.outcome}: {r.reported}" + (f" (was {r.done})" if r.done else "")
        for r in sorted(results, key=lambda r: (_TASKS.index(r.kind), r.cell, r.seed))
        if r.outcome not in {"right", "alias"}
    ]
    return "\n".join(["Misses:", "", *lines]) if lines else "No misses."
