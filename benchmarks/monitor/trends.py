"""Rates of slow trends and their standard deviations by kind of site: the table of the documentation.

The sites are those of the tests' examiner (tests/examiner/sites.py), with windows of three hours.

    python benchmarks/monitor/trends.py [--sites 20] [--weeks 26,39,52,104] [--drift -0.002] [--seed 1] [KIND ...]
"""

import argparse
from dataclasses import replace

import numpy as np

from monitor.detection.temperature_terms import first_climate, follow, terms
from monitor.detection.trend import SIGNIFICANT, Trend, WeeklyMeans, add_windows, no_weeks, trend_of
from tests.examiner.sites import KINDS, SimulatedSites, SiteKind

_STEP, _PER_WEEK, _PER_ADDITION = 3 * 3600.0, 56, 28
_NORMAL = 1.96  # standard deviations within which 95 % lie


def trends(weekly: WeeklyMeans, n_sites: int) -> list[Trend]:
    """Return the trend of each site."""
    found = []
    for i in range(n_sites):
        own = {name: getattr(weekly, name)[i] for name in ("count", "total", "n_terms", "terms")}
        trend = trend_of(replace(weekly, **own))
        assert trend is not None
        found.append(trend)
    return found


def row(kind: SiteKind, weeks: int, found: list[Trend]) -> str:
    """Return a line of the table."""
    z = np.abs([(t.common_rate - kind.drift) / t.common_std for t in found])
    each = np.abs(np.concatenate([(t.rate - kind.drift) / t.std for t in found]))
    std, own = (100 * float(np.median(s)) for s in ([t.common_std for t in found], [t.std for t in found]))
    reported = sum(t.score > SIGNIFICANT for t in found)
    return (
        f"| {kind.name} | {weeks} | {std:.3f} | {100 * (z < _NORMAL).mean():.0f} % | {own:.3f} "
        f"| {100 * (each < _NORMAL).mean():.0f} % | {reported} of {len(found)} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sites", type=int, default=20)
    parser.add_argument("--weeks", default="26,39,52,104")
    parser.add_argument("--drift", type=float, default=-2e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("kinds", nargs="*", metavar="KIND")
    a = parser.parse_args()
    print("| kind of site | weeks | std, mean over modes | within 1.96 | std, one mode | within 1.96 | significant |")
    print("|---" * 7 + "|")
    looks = [int(week) for week in a.weeks.split(",")]
    for own in KINDS:
        if a.kinds and not any(part in own.name for part in a.kinds):
            continue
        kind = replace(own, drift=a.drift, step=_STEP)
        sites = SimulatedSites(kind, a.sites, a.seed)
        weekly, climate, last = no_weeks((a.sites,), kind.n_modes), None, 0.0
        for week in range(1, looks[-1] + 1):
            for _ in range(_PER_WEEK // _PER_ADDITION):
                w = sites.windows(_PER_ADDITION)
                climate = climate or first_climate(w.temperature)
                known, climate = follow(climate, w.temperature, np.diff(w.time, prepend=last))
                last = float(w.time[-1])
                y = np.log(w.frequency / sites.frequency[:, None, :])
                y = np.where(known.carried[..., None], np.nan, y)
                weekly = add_windows(weekly, w.time, terms(known)[..., 0, :], y, y)
            if week in looks:
                print(row(kind, week, trends(weekly, a.sites)), flush=True)


if __name__ == "__main__":
    main()
