"""Logs of set-ups measured one after the other, as one estimate."""

from collections.abc import Sequence

import numpy as np

from oma import merge
from oma.windows import Windows, common_band
from updater.modal_data.averaging import FusedModes

_SAME_TONE = 2e-3  # relative difference of frequencies up to which tones of two set-ups are the same one


def merge_setups(parts: Sequence[tuple[Windows, FusedModes]], references: Sequence[str]) -> tuple[Windows, FusedModes]:
    """Merge the results of set-ups; a set-up takes the place of a window.

    Raises
    ------
    ValueError
        If a set-up lacks a reference, or two of them share another channel.
    NoCommonModes
        If no mode is identified in all set-ups.
    """
    windows = [part for part, _ in parts]
    estimates = tuple(fused.estimate for _, fused in parts)
    merged = merge(estimates, references)
    faults = {channel: fault for part in reversed(windows) for channel, fault in part.faults.items()}
    tones = np.sort(np.concatenate([w.harmonics for w in windows]))
    new = np.diff(np.log(tones), prepend=-np.inf) > _SAME_TONE
    return (
        Windows(
            estimates=estimates,
            harmonics=tones[new],
            channels={c: str(faults.get(c, "ok")) for w in windows for c in w.channels},
            quality=tuple(quality for w in windows for quality in w.quality),
            problems=tuple(problem for w in windows for problem in w.problems),
            start=min(w.start for w in windows),
            end=max(w.end for w in windows),
            rate=windows[0].rate,
            may_be_tones=np.concatenate([w.may_be_tones for w in windows]),
            band=common_band([w.band for w in windows if w.band]),
            faults=faults,
        ),
        FusedModes(estimate=merged, n=np.full(merged.n_modes, len(parts), np.intp), scatter=None),
    )
