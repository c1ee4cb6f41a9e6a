"""Logs of set-ups measured one after the other, as one estimate."""

from collections.abc import Sequence

import numpy as np

from monitor.fusion import FusedModes, Windows, common_band
from oma import merge

_SAME_TONE = 2e-3  # relative difference of frequencies up to which tones of two set-ups are the same one


def merge_setups(parts: Sequence[tuple[Windows, FusedModes]], references: Sequence[str]) -> tuple[Windows, FusedModes]:
    """Merge what was found in each set-up; a set-up stands in the place of a window.

    Raises
    ------
    ValueError
        If a set-up lacks a reference, or two of them share another channel.
    NoCommonModes
        If no mode is seen in all set-ups.
    """
    windows = [part for part, _ in parts]
    estimates = tuple(fused.estimate for _, fused in parts)
    merged = merge(estimates, references)
    tones = np.sort(np.concatenate([w.harmonics for w in windows]))
    new = np.diff(np.log(tones), prepend=-np.inf) > _SAME_TONE
    return (
        Windows(
            estimates=estimates,
            harmonics=tones[new],
            channels=_states(windows),
            quality=tuple(quality for w in windows for quality in w.quality),
            problems=tuple(problem for w in windows for problem in w.problems),
            start=min(w.start for w in windows),
            end=max(w.end for w in windows),
            rate=windows[0].rate,
            band=common_band([w.band for w in windows if w.band]),
        ),
        FusedModes(estimate=merged, n=np.full(merged.n_modes, len(parts), np.intp), scatter=None),
    )


def _states(windows: Sequence[Windows]) -> dict[str, str]:
    """Return what is wrong with each channel, in any of the set-ups."""
    states: dict[str, str] = {}
    for part in windows:
        for channel, state in part.channels.items():
            if states.get(channel, "ok") == "ok":
                states[channel] = state
    return states
