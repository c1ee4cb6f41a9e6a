"""Modes as a table and as JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from daq import AnyLog
from monitor.fusion import FusedModes, Windows
from monitor.model_modes import ModelPartner
from oma import mpc, mpd

console = Console(highlight=False)


def as_json(windows: Windows, fused: FusedModes, partners: Sequence[ModelPartner | None]) -> dict[str, Any]:
    """Return what other programs read, but for the method."""
    return {
        "modes": [_mode_json(fused, i, partner) for i, partner in enumerate(partners)],
        "harmonics": windows.harmonics.tolist(),
        "channels": windows.channels,
        "window": {
            "start": windows.start,
            "end": windows.end,
            "rate": windows.rate,
            "band": windows.band,
            "quality": asdict(windows.worst_quality) | {"remarks": windows.worst_quality.remarks},
        },
    }


def _mode_json(fused: FusedModes, i: int, partner: ModelPartner | None) -> dict[str, Any]:
    estimate = fused.estimate
    shape = dict(zip(estimate.channels, ([z.real, z.imag] for z in estimate.shape[i].tolist()), strict=True))
    quality: dict[str, Any] = {
        "support": float(estimate.support[i]),
        "law_ratio": float(estimate.law_ratio[i]),
        "mpc": float(mpc(estimate.shape[i])),
        "mpd": float(mpd(estimate.shape[i])),
        "windows": int(fused.n[i]),
    }
    if partner:
        quality["model"] = {"frequency": partner.frequency, "mac": partner.mac}
    return {
        "id": i + 1,
        "frequency": {"value": float(estimate.frequency[i]), "std": float(estimate.frequency_std[i])},
        "damping": {"value": float(estimate.damping[i]), "std": float(estimate.damping_std[i])},
        "shape": shape,
        "shape_std": dict(zip(estimate.channels, estimate.shape_std[i].tolist(), strict=True)),
        "quality": quality,
    }


def say_modes(
    logs: Sequence[AnyLog],
    windows: Windows,
    fused: FusedModes,
    partners: Sequence[ModelPartner | None],
    *,
    setups: bool,
) -> None:
    """Print the table and what else there is to know."""
    n, first = len(windows.estimates), windows.estimates[0]
    seconds = f"{(first.end - first.start) * 1e-9:.6g} s"
    what = f"{n} set-ups" if setups else f"{n} windows of {seconds}" if n > 1 else f"one window of {seconds}"
    title = f"{escape(', '.join(log.name for log in logs))}: {what}"
    console.print(_table(title, fused, partners))
    if windows.band:
        low, high = windows.band
        console.print(f"band: {low:.4g} to {high:.4g} Hz ({high / windows.rate:.2f} of the rate)")
    if len(windows.harmonics):
        console.print("tones, no modes: " + ", ".join(f"{tone:.3f}" for tone in windows.harmonics) + " Hz")
    for channel, state in windows.channels.items():
        if state != "ok":
            console.print(f"channel {escape(channel)}: {escape(state)}")
    for remark in windows.worst_quality.remarks:
        console.print(remark)
    if windows.problems:
        console.print(f"{len(windows.problems)} windows gave no modes: {escape(windows.problems[0])}")
    if fused.scatter is not None:
        console.print(f"frequencies scatter {fused.scatter:.2f} times what the windows state")


def _table(title: str, fused: FusedModes, partners: Sequence[ModelPartner | None]) -> Table:
    estimate, compared = fused.estimate, any(partners)
    table = Table(box=SIMPLE_HEAD, title=title)
    for name in (
        "mode",
        "frequency [Hz]",
        "damping [%]",
        "MPC",
        *(() if compared else ("MPD [°]",)),
        "seen",
        *(("model", "MAC") * compared),
    ):
        table.add_column(name, justify="right", no_wrap=True)
    for i, partner in enumerate(partners):
        cells = [
            str(i + 1),
            f"{estimate.frequency[i]:.4f} ± {estimate.frequency_std[i]:.4f}",
            f"{100 * estimate.damping[i]:.3f} ± {100 * estimate.damping_std[i]:.3f}",
            f"{float(mpc(estimate.shape[i])):.3f}",
            *([] if compared else [f"{np.degrees(float(mpd(estimate.shape[i]))):.1f}"]),
            str(int(fused.n[i])),
        ]
        if compared:
            cells += [f"{partner.frequency:.3f}", f"{partner.mac:.3f}"] if partner else ["-", "-"]
        table.add_row(*cells)
    return table
