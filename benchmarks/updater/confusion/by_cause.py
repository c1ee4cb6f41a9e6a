"""Loop of benchmarks on single cells of the confusion matrix: draw, diagnose, count, print one row per cell."""

import argparse
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol

from tests.examiner.cases import draw
from tests.examiner.draws import Hidden
from tests.examiner.path import answer


class Tally(Protocol):
    """Counts of one cause."""

    def count(self, found: dict[str, Any], hidden: Hidden) -> None:
        """Add one answer."""
        ...

    def cells(self, name: str) -> Iterator[str]:
        """Return them as cells of a table."""
        ...


def print_rows(what: str | None, cells: Iterable[str], tally: Callable[[], Tally], *, head: str, seed: int) -> None:
    """Draw and print; `what` is the title, `seed` the first one unless the command line has another."""
    parser = argparse.ArgumentParser(description=what, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20, help="of each cause")
    parser.add_argument("--seed", type=int, default=seed)
    given = parser.parse_args()
    print(head)
    for cell in cells:
        seen = tally()
        for number in range(given.seed, given.seed + given.draws):
            case = draw(cell, number)
            seen.count(answer(case), case.done.hidden[0])
        print("| " + " | ".join(seen.cells(cell)) + " |", flush=True)
