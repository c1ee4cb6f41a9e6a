"""Increments of the one-step update and a diagnosis, made up to be drawn."""

from typing import Any

import numpy as np

from monitor.results.comparison import DiagnosisAnswer, RejectedCause
from monitor.results.windows import FlaggedDof, IncrementPlace, Interval, MassIncrements
from tests.support.monitor import results as made
from updater import Cause, Gain
from updater.diagnosis import FrequencyFit, ModeFit, Pair
from updater.quantities import Quantity, Where

DIRECTIONS = ("x", "y", "z")


def increments(site: made.Site, n_windows: int = 3) -> MassIncrements:
    """Return increments that spread the site's mass about its position, in y and z; none in x, none in z at low
    positions.
    """
    nodes = site.model.nodes
    near = np.exp(-((np.linalg.norm(nodes - site.place, axis=1) / 0.25) ** 2))
    raw = site.mass * near[:, None] / near.sum() * (0.02, 0.5, 0.3)
    raw[:, 0] -= 2e-4
    std = np.full(raw.shape, 8e-4)
    normalised: list[tuple[float | None, float | None, float | None]] = [
        (float(4 * x), float(2 * y), float(3 * z) if at[2] > 1.0 else None)
        for (x, y, z), at in zip(raw, nodes, strict=True)
    ]
    score = raw / std
    flagged = [
        FlaggedDof.model_validate({"node": int(n), "direction": DIRECTIONS[d], "z": float(score[n, d])})
        for n, d in zip(*np.nonzero(np.abs(score) > 4.0), strict=True)
    ]
    return MassIncrements(
        place=IncrementPlace(
            located=True,
            fits=True,
            member="crossbeam",
            position=site.place,
            radius=0.03,
            region=[Interval(member="crossbeam", start=site.place, end=site.place)],
            mass=site.mass,
            p_value=0.4,
        ),
        increment=[made.vector(v) for v in raw],
        increment_std=[made.vector(v) for v in std],
        normalised=normalised,
        normalised_std=[(2e-3, 2e-3, None if z is None else 2e-3) for _, _, z in normalised],
        totals=(0.01, 0.9 * site.mass, 1.1 * site.mass),
        totals_std=(0.01, 0.02, 0.03),
        z_limit=4.0,
        flagged=flagged,
        n_windows=n_windows,
    )


def diagnosis() -> DiagnosisAnswer:
    """Return an explained diagnosis with every possible part; a text that must be escaped among it."""
    return DiagnosisAnswer(
        verdict="explained",
        causes=(
            Cause(
                cause="added_mass",
                probability=0.973,
                where=Where(
                    member="crossbeam",
                    position=(0.25, 0.0, 1.48),
                    position_std=0.004,
                    region=(((0.242, 0.0, 1.48), (0.258, 0.0, 1.48)),),
                ),
                parameters={"mass": Quantity(value=0.302, std=0.005, unit="kg")},
                cannot_be_told_from=("attached_oscillator",),
            ),
            Cause(
                cause="sensor_gain",
                probability=0.91,
                where=Where(channels=("col_037_x",)),
                parameters={"gain": Quantity(value=1.0312, std=0.0021, unit="-")},
            ),
        ),
        rejected=(
            RejectedCause(cause="global_stiffness", log_evidence=-41.3, why="shifts all modes alike <unlike these>"),
        ),
        modes=(
            ModeFit(
                frequency=FrequencyFit(measured=10.504, std=0.012, before=10.81, after=10.507),
                mac=Pair(before=0.9812, after=0.9996),
            ),
            ModeFit(
                frequency=FrequencyFit(measured=None, std=None, before=38.4, after=None),
                mac=Pair(before=None, after=None),
            ),
        ),
        gain=Gain(
            heldout=True,
            frequency_error_percent=Pair(before=1.92, after=0.04),
            one_minus_mac=Pair(before=0.0121, after=0.0004),
            log_likelihood=Pair(before=-812.0, after=-31.5),
        ),
        extended_model="extended/t_structure.toml",
        next_measurement="A sensor in y at (0.2, 0, 1.48) m would tell the mass from an attached oscillator.",
    )


def with_findings(site: made.Site, run: dict[str, Any]) -> dict[str, Any]:
    """Return the run with increments and a diagnosis in every window that locates a mass."""
    found = {"increments": increments(site), "diagnosis": diagnosis()}
    return run | {"windows": [w.model_copy(update=found) if w.answer else w for w in run["windows"]]}
