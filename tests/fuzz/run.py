"""Runs readers on mutated files, each case in a process of its own with bounded memory and time.

A case fails if it ends in an exit code that is not documented, prints a traceback, control characters or long lines,
needs more than 25 s of processor time or 1 GB, or changes its input. Cases are numbered: `--first 137 --cases 1`
repeats one, `--keep DIR` keeps its files.
"""

import argparse
import hashlib
import json
import os
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.fuzz.readers import READERS, case

CODES = frozenset({0, 1, 2, 3})  # 70 is an error of the program's own
SECONDS = 25.0  # of processor time: a slow machine needs 4 s for the largest sound file
_WALL_SECONDS = 150.0  # on a busy machine
MEGABYTES = 1000.0  # resident
_ADDRESS_SPACE = 3 << 30  # bytes beyond what the parent has: a bound for this machine's sake
LONGEST = 2000  # characters of a line of an error
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome of a case."""

    reader: str
    number: int
    code: int | None  #: None if it was killed
    seconds: float  #: of processor time
    megabytes: float
    faults: tuple[str, ...]


def run_case(reader: str, number: int, keep: Path | None = None) -> Outcome:
    """Run a case in a forked process; the case's folder is kept on request."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz-case-", dir=keep))
    path, random = case(reader, number, folder)
    before = _digest(path)
    out, err = folder.with_suffix(".out"), folder.with_suffix(".err")
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        _child(reader, path, random, out, err)
    killed = not _ended(child, _WALL_SECONDS)
    if killed:
        os.kill(child, signal.SIGKILL)
    _, status, used = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    seconds, megabytes = used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3
    reported = [file.read_bytes() if file.exists() else b"" for file in (out, err)]
    faults = [*_faults(*reported)]
    if code not in CODES:
        faults.append(f"exit code {code}{' (killed)' if killed else ''}: {reported[1][-300:]!r}")
    if seconds > SECONDS or killed:
        faults.append(f"{seconds:.1f} s of processor time")
    if megabytes > MEGABYTES:
        faults.append(f"{megabytes:.0f} MB")
    if not path.exists() or _digest(path) != before:
        faults.append("the input was changed")
    if keep is None:
        shutil.rmtree(folder, ignore_errors=True)
        out.unlink(missing_ok=True)
        err.unlink(missing_ok=True)
    return Outcome(
        reader=reader,
        number=number,
        code=None if killed else code,
        seconds=round(seconds, 3),
        megabytes=round(megabytes),
        faults=tuple(faults),
    )


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _child(reader: str, path: Path, random: object, out: Path, err: Path) -> None:
    """Read the file with bounded memory, and end the process."""
    for number, file in ((1, out), (2, err)):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT, 0o600), number)
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + _ADDRESS_SPACE,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.chdir(path.parent)
    code = 99
    try:
        code = READERS[reader].read(path, random)  # type: ignore[arg-type]
    except BaseException as error:  # noqa: BLE001 - nothing may reach the parent's stack
        print(f"left by {type(error).__name__}: {error}", file=sys.stderr)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _ended(child: int, seconds: float) -> bool:
    watched = os.pidfd_open(child)
    try:
        return bool(select.select([watched], [], [], seconds)[0])
    finally:
        os.close(watched)


def _faults(out: bytes, err: bytes) -> Iterator[str]:
    """Yield the faults of a case's output."""
    for name, reported in (("output", out), ("error", err)):
        text = reported.decode("utf-8", "surrogateescape")
        if "Traceback" in text:
            yield f"traceback: {text.strip().splitlines()[-1]:.300}"
        if found := _CONTROL.search(text):
            yield f"{name} has control character {found[0]!r} in {text[max(0, found.start() - 60) : found.end()]!r}"
    longest = max((len(line) for line in err.decode("utf-8", "replace").splitlines()), default=0)
    if longest > LONGEST:
        yield f"a line of {longest} characters: {err[:100]!r}"


def run(readers: Iterable[str], first: int, cases: int, minutes: float | None = None) -> Iterator[Outcome]:
    """Yield the outcomes of numbered cases, readers in turn, until the time is over."""
    end = time.monotonic() + 60 * minutes if minutes else None
    names = list(readers)
    for number in range(first, first + cases):
        for reader in names:
            if end is not None and time.monotonic() > end:
                return
            yield run_case(reader, number)


def main() -> int:
    """Run cases and print those that fail; 1 if there is any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("readers", nargs="*", default=[], help=", ".join(READERS))
    parser.add_argument("--cases", type=int, default=2000, help="of each reader")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--minutes", type=float, default=None)
    parser.add_argument("--file", type=Path, default=None, help="that gets a line of JSON per reader's case")
    parser.add_argument("--keep", type=Path, default=None, help="folder that keeps the files of one case")
    asked = parser.parse_args()
    readers = asked.readers or list(READERS)
    if asked.keep:
        asked.keep.mkdir(parents=True, exist_ok=True)
        found = [run_case(reader, asked.first, asked.keep) for reader in readers]
        print(*found, sep="\n")
        return int(any(outcome.faults for outcome in found))
    done: dict[str, list[Outcome]] = {reader: [] for reader in readers}
    with open(asked.file or os.devnull, "a", encoding="utf-8") as file:
        for outcome in run(readers, asked.first, asked.cases, asked.minutes):
            done[outcome.reader].append(outcome)
            file.write(json.dumps(asdict(outcome)) + "\n")
            for fault in outcome.faults:
                print(f"{outcome.reader} {outcome.number}: {fault}", flush=True)
    for reader, outcomes in done.items():
        failed = sum(bool(outcome.faults) for outcome in outcomes)
        codes = {code: sum(o.code == code for o in outcomes) for code in sorted({o.code or 0 for o in outcomes})}
        worst = max((o.seconds for o in outcomes), default=0.0), max((o.megabytes for o in outcomes), default=0.0)
        print(f"{reader:12} {len(outcomes):5} cases, {failed} failed; exit codes {codes}; {worst[0]} s, {worst[1]} MB")
    return int(any(outcome.faults for outcomes in done.values() for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
