"""Measured against simulated values in the report: plain values and pictures for the template."""

from functools import partial
from typing import Any

from daq.notebook import number_text, rounded_text
from monitor.results.comparison import DiscrepancyResult, ModeComparison, SensorComparison
from monitor.results.state_comparison import StateComparison
from monitor.results.windows import ReferenceResult
from monitor.text.causes import CLEAR_ODDS, MARK, NOT_COMPARED, missed_text, unmeasured_text
from monitor.text.quantities import optional
from monitor.text.sensors import health_rows, worst_sensor_text
from monitor.views.report import comparison_figures as beside
from monitor.views.report.fit_figures import density_figure
from monitor.views.report.structure_figure import states_figure
from monitor.views.report.svg import picture
from updater.quantities import plain


def measured_content(
    found: DiscrepancyResult, reference: ReferenceResult | None, states: StateComparison | None = None
) -> dict[str, Any]:
    """Return the template's values; drawings of the structure need one, those of mode shapes also the states."""
    return {
        "modes": [_mode(m) for m in found.listed],
        "measured_before": found.measured_before,
        "shapes": picture(
            lambda: states_figure(reference, states) if reference and states else None, "Mode shapes before and now"
        ),
        "not_compared": "" if all(m.compared for m in found.listed) else f"{MARK} {NOT_COMPARED}.",
        "unmeasured": _sentence(unmeasured_text(found)),
        "after": any(m.off_percent_after is not None for m in found.modes),
        "offsets": picture(
            lambda: beside.offsets_figure(found), "Measured frequencies against simulated ones, in per cent"
        ),
        "mac": picture(lambda: beside.mac_figure(found), "MAC of simulated with measured modes"),
        "sensors": picture(lambda: beside.sensors_figure(found), "Residual, prediction error and COMAC of each sensor"),
        "worst": _worst(found.sensors),
        "missed": missed_text(found.sensors),
        "health": health_rows({s.channel: s.health for s in found.sensors if s.health}),
        "balance": _balance(found, reference),
        "signals": [
            (
                picture(partial(beside.signal_figure, signal), f"{signal.channel}: signal in time"),
                picture(partial(beside.spectrum_figure, signal), f"{signal.channel}: spectrum"),
            )
            for signal in found.signals
        ],
        "trends": [
            picture(partial(beside.trends_figure, found.trends, over), f"Frequencies over {over}")
            for over in dict.fromkeys(t.over for t in found.trends)
        ],
        "places": [
            picture(partial(density_figure, reference, p), f"Where along the structure {plain(p.cause)} may be")
            for p in found.places
            if reference
        ],
        "note": found.note,
    }


def _mode(mode: ModeComparison) -> dict[str, str]:
    row = {"simulated": _hertz(mode, mode.simulated), "measured": _hertz(mode, mode.measured)}
    row |= {"off": "", "sigmas": "", "mac": optional(mode.mac, ".4f"), "mac_after": optional(mode.mac_after, ".4f")}
    row["off_after"] = ""
    if mode.off_percent_after is not None:
        row["off_after"] = rounded_text(mode.off_percent_after, mode.std_percent or 0.0, sign=True)
    if mode.off_percent is not None and mode.std_percent is not None:
        row["off"] = number_text(mode.off_percent, mode.std_percent, sign=True)
        row["sigmas"] = f"{mode.off_percent / mode.std_percent:+.1f}"
    if mode.measured is None:
        row["measured"] = "not identified"
    elif mode.simulated is None:
        row["simulated"] = "none"
    if not mode.compared:
        row["simulated"] = f"{MARK} {row['simulated']}"
    return row


def _hertz(mode: ModeComparison, value: float | None) -> str:
    """Return a frequency with the digits of the measured one; empty for none."""
    return "" if value is None else rounded_text(value, 0.01 * (mode.std_percent or 0.0) * (mode.measured or 0.0))


def _worst(sensors: tuple[SensorComparison, ...]) -> str:
    """Return which sensor has the largest residual, if any is significant."""
    if not sensors:
        return ""
    return _sentence(worst_sensor_text(sensors)) or "No sensor deviates significantly from the shapes compared."


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def _balance(found: DiscrepancyResult, reference: ReferenceResult | None) -> list[dict[str, Any]]:
    if found.balance is None or reference is None or len(found.balance.loss) != len(reference.nodes):
        return []
    readings = {"added": "excess mass", "loss": "missing stiffness"}
    if abs(found.balance.log_odds) > CLEAR_ODDS:  # one interpretation explains all modes together far better
        readings.pop("loss" if found.balance.log_odds > 0 else "added")
    parts = []
    for reading, name in readings.items():
        text = beside.balance_text(reference, found.balance, reading)
        if text:
            odds = f" (log evidence {abs(found.balance.log_odds):.0f} over the other interpretation)"
            title = f"Residual forces as {name}{odds * (len(readings) == 1)}: {text}"
            drawn = picture(partial(beside.balance_figure, reference, found.balance, reading), title)
            parts.append({"picture": drawn, "text": title + "."})
    return parts
