"""Modes as a table and as JSON."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from rich.markup import escape
from rich.table import Table

from daq import AnyLog
from monitor.analysis.states.stationarity import FrequencyChange
from monitor.cli.data.identify.amplitude_output import dependence_json
from monitor.cli.terminal import console, new_table
from monitor.text.quantities import aligned_numbers
from oma import ModalEstimate, mpc, mpd
from oma.preparation import ALIAS_FREE
from oma.windows import Windows, are_near
from updater.modal_data import LOW_MPC, Asynchrony, FusedModes

if TYPE_CHECKING:
    from oma import AmplitudeDependence
    from updater.quantities import ExchangedSections
    from updater.validation import ModelPartner

_SAME_SHAPE = 0.9  # MAC above which a mode is the model's, whatever its frequency [-]
_FAR_PERCENT = 30.0  # frequencies further apart are not paired
LOW_MAC = 0.7  #: MAC with the model's mode below which it is marked [-]


@dataclass(frozen=True, eq=False, kw_only=True)
class Findings:
    """Modes of windows, with remarks."""

    windows: Windows
    fused: FusedModes
    partners: "Sequence[ModelPartner | None]"  #: the model's mode of each mode, if any
    nearest: "Mapping[int, ModelPartner]"  #: for modes without a partner: the model's most similar mode
    asynchrony: Asynchrony | None  #: delays between the channels, if the shapes show any
    change: FrequencyChange | None  #: change of the structure within the records, if the frequencies show any
    #: (n_modes,) dependence of each mode on its amplitude, None if it cannot be tested; None if it was not requested
    amplitude: "Sequence[AmplitudeDependence | None] | None" = None
    exchanged: "ExchangedSections | None" = None  #: sections that fit far better with exchanged dimensions

    @property
    def may_be_tone(self) -> npt.NDArray[np.bool_]:
        """Modes that may also be tones in these records (n_modes,)."""
        return are_near(self.fused.estimate.frequency, self.windows.may_be_tones)

    @property
    def may_be_alias(self) -> npt.NDArray[np.bool_]:
        """Modes so near half the rate that they may be aliases of higher frequencies (n_modes,)."""
        return np.asarray(self.fused.estimate.frequency > ALIAS_FREE * self.windows.rate)

    @property
    def is_complex(self) -> npt.NDArray[np.bool_]:
        """Modes whose channels do not move in phase (n_modes,)."""
        return np.asarray(mpc(self.fused.estimate.shape) < LOW_MPC)


def as_json(found: Findings) -> dict[str, Any]:
    """Return the output for other programs, without the method."""
    windows, late = found.windows, found.asynchrony.delays if found.asynchrony else {}
    return {
        "modes": [_mode_json(found, i) for i in range(found.fused.estimate.n_modes)],
        "harmonics": windows.harmonics.tolist(),
        "channels": windows.channels,
        "window": {
            "start": windows.start,
            "end": windows.end,
            "rate": windows.rate,
            "band": windows.band,
            "change": _change_json(found.change) if found.change else None,
            "delays": {channel: {"value": value, "std": std} for channel, (value, std) in late.items()},
            "quality": asdict(windows.worst_quality) | {"remarks": windows.worst_quality.remarks},
        },
    }


def _change_json(change: FrequencyChange) -> dict[str, Any]:
    sides = {
        name: [
            {"value": value, "std": std}
            for value, std in zip(side.frequency.tolist(), side.frequency_std.tolist(), strict=True)
        ]
        for name, side in (("before", change.before), ("after", change.after))
    }
    return {"time": change.time, "time_std": change.time_std, "frequencies": sides}


def _mode_json(found: Findings, i: int) -> dict[str, Any]:
    seen = {
        "windows": int(found.fused.n[i]),
        "may_be_tone": bool(found.may_be_tone[i]),
        "may_be_alias": bool(found.may_be_alias[i]),
    }
    mode = mode_json(found.fused.estimate, i, found.partners[i], seen)
    if found.amplitude is not None:
        mode["amplitude"] = dependence_json(found.amplitude[i])
    return mode


def mode_json(estimate: ModalEstimate, i: int, partner: "ModelPartner | None", seen: dict[str, Any]) -> dict[str, Any]:
    """Return one mode for other programs; `seen` is added to its quality."""
    shape = dict(zip(estimate.channels, ([z.real, z.imag] for z in estimate.shape[i].tolist()), strict=True))
    quality: dict[str, Any] = {
        "support": float(estimate.support[i]),
        "law_ratio": float(estimate.law_ratio[i]),
        "mpc": float(mpc(estimate.shape[i])),
        "mpd": float(mpd(estimate.shape[i])),
    } | seen
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


def say_modes(logs: Sequence[AnyLog], found: Findings, *, setups: bool) -> None:
    """Print the table and the notes."""
    windows, fused = found.windows, found.fused
    n, first = len(windows.estimates), windows.estimates[0]
    seconds = f"{(first.end - first.start) * 1e-9:.6g} s"
    what = f"{n} set-ups" if setups else f"{n} windows of {seconds}" if n > 1 else f"one window of {seconds}"
    title = f"{', '.join(log.name for log in logs)}: {what}"
    console.print(_table(title, found))
    for remark in _marks(found):
        console.print(remark)
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
        console.print(f"scatter of the frequencies between windows: {fused.scatter:.2f} times the stated deviations")


def _marks(found: Findings) -> Iterator[str]:
    """Yield the meaning of the marks in the table, and delays of channels."""
    if found.may_be_tone.any():
        yield "? possibly the tone of a machine: the record is too short to distinguish it from a lightly damped mode"
    if found.may_be_alias.any():
        yield (
            f"~ above {ALIAS_FREE:g} of the rate: may be an alias of vibration above half the rate; left out by "
            "`diagnose` and the monitor unless the band is set"
        )
    if found.is_complex.any():
        yield (
            f"! MPC below {LOW_MPC:g}: the channels do not move in phase, as where they are not synchronous, "
            "modes are close or noise is strong"
        )
    if any(p and p.mac < LOW_MAC for p in found.partners):
        yield f"! MAC below {LOW_MAC:g}: not the shape of the model's mode"
    yield from _without_partner(found)
    if found.exchanged:
        from monitor.text.diagnosis import exchanged_text  # slow to import

        yield escape(exchanged_text(found.exchanged))
    if found.asynchrony:
        from monitor.text.sensors import asynchrony_text  # slow to import

        yield escape(asynchrony_text(found.asynchrony))
    if found.change:
        yield found.change.words


def _without_partner(found: Findings) -> Iterator[str]:
    """Yield the nearest mode of the model for each mode that has no partner, and what that means."""
    if not found.nearest:
        return
    yield (
        "without a partner in the model (partners have a MAC of 0.5 or more and frequencies at most 30 % apart; "
        "each mode of the model is the partner of one measured mode at most):"
    )
    same_shape = False
    for i, near in found.nearest.items():
        off = 100 * (near.frequency / float(found.fused.estimate.frequency[i]) - 1)
        yield f"- mode {i + 1}: the most similar one has {near.frequency:.4g} Hz ({off:+.0f} %), MAC {near.mac:.3f}"
        same_shape |= near.mac > _SAME_SHAPE and abs(off) > _FAR_PERCENT
    if same_shape:
        yield "a high MAC far off in frequency: feet or joints are not as stiff as in the file; `diagnose` fits them"


def _table(title: str, found: Findings) -> Table:
    fused, partners = found.fused, found.partners
    estimate, compared = fused.estimate, any(partners)
    uncertain, complex_shape = found.may_be_tone, found.is_complex
    shaped = len(estimate.channels) > 1  # one channel has no shapes
    names = ["mode", "frequency [Hz]", "damping [%]", "MPC"]
    names += ["windows", "model", "MAC"] if compared else ["MPD [°]", "windows"]
    table = new_table(right=names, no_wrap=True, title=title)
    frequencies = aligned_numbers(zip(estimate.frequency, estimate.frequency_std, strict=True))
    dampings = aligned_numbers(zip(100 * estimate.damping, 100 * estimate.damping_std, strict=True))
    for i, partner in enumerate(partners):
        cells = [
            f"{'? ' if uncertain[i] else ''}{'~ ' if found.may_be_alias[i] else ''}{i + 1}",
            frequencies[i],
            dampings[i],
            f"{'! ' if complex_shape[i] else ''}{float(mpc(estimate.shape[i])):.3f}" if shaped else "-",
            *([] if compared else [f"{np.degrees(float(mpd(estimate.shape[i]))):.1f}" if shaped else "-"]),
            str(int(fused.n[i])),
        ]
        if compared and partner:
            assurance = f"{'! ' if partner.mac < LOW_MAC else ''}{partner.mac:.3f}"
            cells += [f"{partner.frequency:.3f}", assurance if shaped else "-"]
        elif compared:
            cells += ["-", "-"]
        table.add_row(*cells)
    return table
