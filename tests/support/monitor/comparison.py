"""Measured and simulated modes of the tests' T-frame, made up: the content of report and viewer."""

from typing import Any

import numpy as np

from monitor.results.comparison import (
    BalanceResult,
    DiscrepancyResult,
    FrequencyTrend,
    ModeComparison,
    PlaceDensity,
    SensorComparison,
    SignalComparison,
)
from tests.support.monitor import results as made
from updater import build_model

SITE = made.Site()
STRUCTURE = SITE.model.structure
NODES = build_model(STRUCTURE).nodes


def shown(log_odds: float = 40.0, peak: int = 7) -> DiscrepancyResult:
    """Two pairs, one mode that was not seen and one that is extra; a peak of the forces at an element."""
    values = np.full(len(NODES), 0.001)
    values[[peak, peak + 1]] = 0.12, 0.119
    line = tuple(values.tolist())
    signal = SignalComparison(
        channel="beam_left_z",
        start=1.0,
        step=1e-3,
        measured=(0.0, 1.0, 0.0, -1.0),
        predicted=(0.0, 0.9, 0.0, -0.9),
        frequency=(10.0, 11.0, None, 20.0, 21.0),
        spectrum=(1e-6, 1e-4, None, 1e-5, 1e-6),
        missed=(1e-7, 1e-6, None, 1e-7, 1e-7),
        missed_after=(1e-8, 1e-7, None, 1e-8, 1e-8),
    )
    pair: dict[str, Any] = {"off_percent_after": 0.01, "mac_after": 0.9999}
    return DiscrepancyResult(
        modes=(
            ModeComparison(simulated=10.8, measured=10.4, off_percent=-3.7, std_percent=0.1, mac=0.98, **pair),
            ModeComparison(simulated=38.6, measured=37.2, off_percent=-3.6, std_percent=0.05, mac=0.99, **pair),
            ModeComparison(simulated=60.0, measured=None, off_percent=None, std_percent=None, mac=None),
            ModeComparison(simulated=None, measured=71.5, off_percent=None, std_percent=None, mac=None),
        ),
        rows=(10.8, 38.6, 60.0),
        columns=(10.4, 37.2, 71.5),
        mac=((0.98, 0.01, 0.2), (0.0, 0.99, 0.1), (0.1, 0.0, None)),
        sensors=(
            SensorComparison(
                channel="beam_left_z", comac=0.99, residual=0.08, noise=0.01, missed=0.1, missed_least=0.02
            ),
            SensorComparison(
                channel="col_037_x", comac=0.999, residual=0.01, noise=0.01, missed=0.03, missed_least=0.02
            ),
        ),
        balance=BalanceResult(
            loss=line, loss_std=(0.002,) * len(NODES), added=line, added_std=(0.002,) * len(NODES), log_odds=log_odds
        ),
        signals=(signal,),
        trends=(
            FrequencyTrend(
                mode=10.4, over="temperature", unit="K", at=(10.0, 20.0), change_percent=(0.1, -0.1),
                std_percent=(0.02, 0.02), slope=-0.02, slope_std=0.003,
            ),
        ),
        places=(
            PlaceDensity(
                cause="added_mass", member=("crossbeam",) * 3,
                position=((-0.1, 0.0, 1.48), (0.0, 0.0, 1.48), (0.1, 0.0, 1.48)), density=(0.1, 1.0, 8.0),
            ),
        ),
    )  # fmt: skip
