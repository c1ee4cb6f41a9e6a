"""Runs the tests of a module on mutants of it, and lists the mutants that no test noticed.

    python tests/mutants/run.py [MODULE ...] [--sample 40] [--seed 0] [--minutes 10] [--again] [--report]

or `make mutants ARGUMENTS="oma/tracking/tracker.py --sample 60"`. Modules, their tests and the mutants that change no
behaviour are in tests/mutants/mutants.toml. The tree is copied; each mutant is run in a forked process, by the test
files that run its line, the quickest first, until one fails. Outcomes are appended to a file of JSON lines, from which
a later run continues; `--again` repeats the survivors, `--report` prints the table without running anything.
"""

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.mutants.made import Mutant, mutants, mutated

ROOT = Path(__file__).parents[2]
TABLE = ROOT / "tests" / "mutants" / "mutants.toml"
_PACKAGES = ("daq", "oma", "updater", "monitor")
_COPIED = (*_PACKAGES, "tests", "docs", "examples", "replay_data", "benchmarks")
_LIBRARIES = "coverage hypothesis numpy pydantic pytest scipy.linalg scipy.optimize scipy.signal scipy.sparse.linalg"
_PYTEST = (
    *("-p", "no:randomly", "-p", "no:cacheprovider", "-p", "no:cov", "-p", "no:xdist", "--hypothesis-seed=0"),
    *("-W", "ignore::pytest.PytestAssertRewriteWarning", "-x", "-q", "-m", "not live and not thorough and not soak"),
)
_SLOWEST = 20.0  # seconds that the machine may add to a test run before it counts as endless
_PAUSE = 0.01  # seconds between two looks at a test process


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """A test file without a mutant."""

    path: str
    seconds: float
    lines: frozenset[int]  #: of the module that it runs


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of the tests on a mutant."""

    mutant: Mutant
    outcome: str  #: killed, endless, survived
    by: str = ""  #: the test that failed

    def row(self) -> dict[str, object]:
        module, text, change = self.mutant.key
        return {"module": module, "text": text, "change": change, "outcome": self.outcome, "by": self.by}


def main() -> int:
    """Run the requested mutants and print the table."""
    table = tomllib.loads(TABLE.read_text())
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="*", default=list(table["tests"]))
    parser.add_argument("--sample", type=int, default=40, help="mutants of each module, 0: all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="no mutant is begun after that")
    parser.add_argument("--results", type=Path, default=ROOT / "mutants.jsonl")
    parser.add_argument("--again", action="store_true", help="repeat survivors")
    parser.add_argument("--report", action="store_true", help="run nothing")
    asked = parser.parse_args()
    equivalent = {(e["module"], e["text"], e["change"]) for e in table["equivalent"]}
    chosen = {module: sample(module, asked.sample, asked.seed) for module in asked.modules}
    known = outcomes(asked.results)
    if not asked.report:
        end = time.monotonic() + 60 * asked.minutes
        with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
            copied(Path(folder))
            for module, picked in chosen.items():
                left = [
                    m
                    for m in picked
                    if m.key not in equivalent and (m.key not in known or (asked.again and known[m.key] == "survived"))
                ]
                for outcome in run(module, left, table["tests"][module], end) if left else ():
                    known[outcome.mutant.key] = outcome.outcome
                    with asked.results.open("a") as file:
                        file.write(json.dumps(outcome.row()) + "\n")
    return report(chosen, known, equivalent)


def sample(module: str, n: int, seed: int) -> list[Mutant]:
    """Return n mutants of a module in the order of its lines, or all if n is 0."""
    every = list(mutants(module, (ROOT / module).read_text()))
    if not n or n >= len(every):
        return every
    picked = random.Random(f"{seed} {module}").sample(range(len(every)), n)
    return [every[i] for i in sorted(picked)]


def outcomes(results: Path) -> dict[tuple[str, str, str], str]:
    """Return the last outcome of each mutant in a file of results."""
    rows = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    return {(row["module"], row["text"], row["change"]): row["outcome"] for row in rows}


def copied(folder: Path) -> None:
    """Copy the tree, go there and import from there."""
    for name in _COPIED:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for path in ROOT.iterdir():
        if path.is_file() and path.suffix in {".toml", ".md", ""}:
            shutil.copy2(path, folder)
    os.chdir(folder)
    os.environ["PYTHONPATH"] = str(folder)  # for the processes that tests start
    sys.path[:] = [str(folder), *(p for p in sys.path if Path(p).resolve() not in (ROOT, ROOT / "tests"))]
    for library in _LIBRARIES.split():
        __import__(library)
    import hypothesis

    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)  # a failing example need not be made small
    hypothesis.settings.register_profile("mutants", phases=phases, database=None, deadline=None)
    hypothesis.settings.load_profile("mutants")


def run(module: str, left: list[Mutant], files: list[str], end: float) -> Iterator[Outcome]:
    """Yield the outcomes of mutants until the time is over."""
    path = Path(module)
    source, times = path.read_text(), path.stat()
    before = sorted((baseline(file, module) for file in files), key=lambda f: f.seconds)
    for file in before:
        print(f"{module}: {file.path}: {file.seconds:.1f} s, {len(file.lines)} lines", flush=True)
    for mutant in left:
        if time.monotonic() > end:
            return
        fit = [file for file in before if file.lines & mutant.lines]
        path.write_text(mutated(source, mutant.number))
        limit = _SLOWEST + 4 * sum(f.seconds for f in fit)
        code, by = run_tests([f.path for f in fit], limit, None) if fit else (0, "not run")
        path.write_text(source)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # as it was, so that it is not compiled again
        outcome = "survived" if code == 0 else "endless" if code is None else "killed"
        print(f"{outcome:9}{mutant.line:4}  {mutant.change}  {by}", flush=True)
        yield Outcome(mutant=mutant, outcome=outcome, by=by)


def baseline(file: str, module: str) -> Baseline:
    """Run a test file without a mutant and return its duration and the lines of the module that it runs."""
    found = Path(tempfile.mkstemp(suffix=".json")[1])
    begun = time.monotonic()
    code, by = run_tests([file], 600.0, (module, found))
    seconds, lines = time.monotonic() - begun, json.loads(found.read_text() or "[]")
    found.unlink()
    if code != 0:
        raise SystemExit(f"{file}: expected to pass without a mutant, got code {code} {by}")
    return Baseline(path=file, seconds=seconds, lines=frozenset(lines))


def run_tests(files: list[str], limit: float, covered: tuple[str, Path] | None) -> tuple[int | None, str]:
    """Run test files in a forked process; return its exit code, None if it does not end, and the test that failed.

    `covered` is a module, and a file into which the lines of it that are run are written.
    """
    failed = Path(tempfile.mkstemp(suffix=".txt")[1])
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        os.setsid()
        silent = os.open(os.devnull, os.O_RDWR)
        for descriptor in range(3):
            os.dup2(silent, descriptor)
        code = 99
        try:
            code = _pytest(files, failed, covered)
        except BaseException as error:
            failed.write_text(repr(error))
            raise
        finally:
            os._exit(code)
    ended = _exit_code(child, limit)
    by = failed.read_text()
    failed.unlink()
    return ended, by


def _exit_code(child: int, limit: float) -> int | None:
    """Wait for a process; return its exit code, None if it had to be ended after `limit` [s]."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(_PAUSE)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def _pytest(files: list[str], failed: Path, covered: tuple[str, Path] | None) -> int:
    """Run test files in this process; write the first failed test, and the lines of a module that were run."""
    import coverage
    import pytest

    class Noting:
        def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
            if report.failed:
                failed.write_text(report.nodeid)

    sys.dont_write_bytecode = covered is None  # what is not mutated is compiled once
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1" if covered is None else ""
    if covered is None:
        return int(pytest.main([*_PYTEST, *files], plugins=[Noting()]))
    module = str(Path(covered[0]).resolve())
    measured = coverage.Coverage(include=[module], data_file=None, config_file=False)
    measured.start()
    code = int(pytest.main([*_PYTEST, *files], plugins=[Noting()]))
    measured.stop()
    covered[1].write_text(json.dumps(sorted(measured.get_data().lines(module) or [])))
    return code


def report(
    chosen: dict[str, list[Mutant]], known: dict[tuple[str, str, str], str], equivalent: set[tuple[str, str, str]]
) -> int:
    """Print the table and the survivors; return 1 if less than nine in ten are killed."""
    rows, survivors = [], []
    for module, picked in chosen.items():
        every = sum(1 for _ in mutants(module, (ROOT / module).read_text()))
        same = sum(m.key in equivalent for m in picked)
        found = [m for m in picked if m.key in known and m.key not in equivalent]
        alive = [m for m in found if known[m.key] == "survived"]
        survivors += alive
        rows.append([every, len(found) + same, same, len(alive)])
    total = [sum(row[k] for row in rows) for k in range(4)]
    print("\n| module | mutants | run | equivalent | killed | share |\n|---|---|---|---|---|---|")
    for name, (every, n, same, left) in zip([*chosen, "all"], [*rows, total], strict=True):
        print(f"| {name} | {every} | {n} | {same} | {n - same - left} | {(n - same - left) / max(1, n - same):.0%} |")
    for m in survivors:
        print(f"{m.module}:{m.line}: {m.text}\n    {m.change}")
    return int(10 * len(survivors) > total[1] - total[2])


if __name__ == "__main__":
    sys.exit(main())
