"""Options of the benchmarks of blocks, and rigs to which a body is added."""

import argparse
from collections.abc import Iterator

from monitor.rig import Scenario, draw_t_frame


def options() -> argparse.Namespace:
    """Return the options: number of changes, hours without one, first seed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--changes", type=int, default=9)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=101)
    return parser.parse_args()


def rigs_with_a_change(first: int, number: int, at: float) -> Iterator[tuple[int, Scenario, float]]:
    """Yield the seed, the scenario, and the mass [kg] of the body that is added at a time [s]."""
    for seed in range(first, first + number):
        scenario = draw_t_frame("t_structure", seed, duration=0, between=(at, at))
        body = scenario.event[0].body
        assert body
        yield seed, scenario, body.mass
