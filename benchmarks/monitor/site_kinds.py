"""False alarms per year and detection delays by kind of site: the table of the documentation.

The sites are those of the tests' examiner (tests/examiner/sites.py), which shares nothing with the detectors.

    python benchmarks/monitor/site_kinds.py [--sites 40] [--days 365] [--baseline-hours 24] [--seed 1] [KIND ...]
"""

import argparse
import time
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.monitor.watched_sites import Batch, WatchedSites, hours_text, poisson_interval
from monitor.detection import CHUNK, DETECTORS
from tests.examiner.sites import KINDS, SimulatedSites, SiteKind

_SETTLED_DAYS = 30  # watched before the change
_LOOK_DAYS = 14  # that a change is looked for


@dataclass
class KindSource:
    """Simulated windows as the detectors take them."""

    sites: SimulatedSites
    time: float = 0.0

    @property
    def step(self) -> float:
        """Seconds from one window to the next."""
        return self.sites.kind.step

    def batch(self, n_windows: int) -> Batch:
        """Return the next windows."""
        w = self.sites.windows(n_windows)
        seconds = np.diff(w.time, prepend=self.time)
        self.time = float(w.time[-1])
        return Batch(
            log_frequency=np.log(w.frequency),
            std=w.frequency_std / w.frequency,
            rms=w.rms,
            temperature=w.temperature,
            seconds=seconds,
        )


def started(kind: SiteKind, n_sites: int, baseline_hours: float, seed: int) -> WatchedSites:
    """Return sites with a learned baseline."""
    source = KindSource(SimulatedSites(kind, n_sites, seed))
    return WatchedSites(source, round(baseline_hours * 3600 / kind.step))


def false_alarms(sites: WatchedSites, days: float) -> str:
    """Return the table's columns of false alarms after so many days."""
    for _ in range(round(days * 86400 / sites.source.step / CHUNK)):
        sites.watch()
    n, years = len(sites.raised), sites.years
    low, high = poisson_interval(n, years)
    by = Counter(detector for _, _, detector in sites.raised)
    parts = ", ".join(str(by[d]) for d in DETECTORS)
    places = len({site for site, _, _ in sites.raised})
    share = sites.in_alarm / (len(sites.alarms) * sites.window)
    return f"{years:.0f} | {n} ({parts}) | {places} | {n / years:.2f} | {low:.2f} to {high:.2f} | {100 * share:.2f} %"


def trend_columns(sites: WatchedSites) -> str:
    """Return the table's columns of slow trends that are significant at the end."""
    found = [watch.present for watch in sites.trends if watch.present]
    if not found:
        return f"0 | {sites.trend_events} | "
    rate = 100 * np.median([t.common_rate for t in found])
    std = 100 * np.median([t.common_std for t in found])
    return f"{len(found)} of {len(sites.trends)} | {sites.trend_events} | {rate:+.3f} ± {std:.3f}"


def delay(kind: SiteKind, n_sites: int, baseline_hours: float, seed: int) -> str:
    """Return the table's columns of delays until a change is found."""
    size = 1e-3 if kind.name == "quiet" else 3e-3
    sites = started(kind, n_sites, baseline_hours, seed + 1000)
    for _ in range(round(_SETTLED_DAYS * 86400 / kind.step / CHUNK)):
        sites.watch()
    standing = np.array([a.state == "alarm" for a in sites.alarms])
    source = sites.source
    assert isinstance(source, KindSource)
    source.sites.damage(size)
    sites.raised.clear()
    began = sites.window
    for _ in range(round(_LOOK_DAYS * 86400 / kind.step / CHUNK)):
        sites.watch()
    first = np.full(n_sites, np.inf)
    for site, window, _ in sites.raised:
        first[site] = min(first[site], window - began + 1)
    found = first[~standing] * kind.step / 3600
    spread = " / ".join(hours_text(v) for v in np.quantile(found, [0.5, 0.9], method="higher"))
    return f"{100 * size:g} % | {100 * np.isfinite(found).mean():.0f} % | {spread}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sites", type=int, default=40)
    parser.add_argument("--days", type=float, default=365.0)
    parser.add_argument("--baseline-hours", type=float, default=24.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step", type=float, help="seconds from one window to the next; the kind's own unless given")
    parser.add_argument("--without-delays", action="store_true")
    parser.add_argument("kinds", nargs="*", metavar="KIND")
    a = parser.parse_args()
    head = "| kind of site | years | false alarms (jump, quick, slow) | sites | per year | 95 % | in alarm "
    head += "| trend reported | reports | median rate, % per year "
    print(head + "| change | found | delay, median / 9 of 10 | CPU |")
    print("|---" * 14 + "|")
    for own in KINDS:
        if a.kinds and not any(part in own.name for part in a.kinds):
            continue
        kind = own if a.step is None else replace(own, step=a.step)
        began = time.process_time()
        sites = started(kind, a.sites, a.baseline_hours, a.seed)
        alarms = false_alarms(sites, a.days)
        trends = trend_columns(sites)
        late = " | | " if a.without_delays else delay(kind, a.sites, a.baseline_hours, a.seed)
        print(f"| {kind.name} | {alarms} | {trends} | {late} | {time.process_time() - began:.0f} s |", flush=True)


if __name__ == "__main__":
    main()
