"""Layout of the views; views without content are left out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb

from monitor.results.run_results import RunResults
from monitor.views.member_axis import has_profile
from monitor.views.viewer.layout import view_specs as views
from monitor.views.viewer.modes.trends import damping_span, frequency_span, shift_span
from monitor.views.viewer.posterior import mass_span
from monitor.views.viewer.primitives import TIME
from monitor.views.viewer.signals.channels import channels_with_rms
from monitor.views.viewer.signals.traces import SECONDS, signal_span

_Part = rrb.View | rrb.Container
_PLOTS_A_COLUMN = 6


@dataclass(frozen=True, kw_only=True)
class Live:
    """Settings for following a running monitor."""

    seconds: float  #: time shown by the trends [s]
    channels: tuple[str, ...]  #: channels whose signals are streamed
    residuals: views.BlockPlot | None = None  #: of the residuals of channels; None before there are any
    innovations: views.BlockPlot | None = None  #: of the innovations of modes; None before there are any


def layout(run_results: RunResults, live: Live | None = None) -> rrb.Blueprint:
    """Return the blueprint: the overview in front, then one tab a subject.

    Parameters
    ----------
    run_results : content to show
    live : how a running monitor is followed; None for a run that has ended
    """
    trends = views.TrendViews(run_results, live.seconds if live else None)
    tabs: list[rrb.Container] = [_overview(run_results, trends, live)]
    if run_results.reference and run_results.reference.has_shapes:
        shapes = views.mode_shapes if run_results.geometry else views.shape_bars
        tabs.append(shapes(run_results.reference))
    if run_results.spectra or run_results.reference:
        tabs.append(_identification(run_results, trends))
    if run_results.answers or _has_increments(run_results) or _has_diagnosis(run_results):
        tabs.append(_change(run_results, trends))
    if live:
        tabs.append(_signals(live.channels, views.following(SECONDS)))
    elif run_results.signals:
        signals = run_results.signals
        span, values = views.last_seconds(signals), signal_span(signals)
        tabs.append(_signals([c.name for c in signals.channels], span, values))
    channels = _channels(run_results, trends, drawn_once=not live)
    if channels:
        tabs.append(channels)
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TopPanel(state="expanded"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _stack(*parts: tuple[_Part, float]) -> rrb.Vertical:
    return rrb.Vertical(*[part for part, _ in parts], row_shares=[share for _, share in parts])


def _beside(name: str, *parts: tuple[_Part, float]) -> rrb.Horizontal:
    return rrb.Horizontal(*[part for part, _ in parts], column_shares=[share for _, share in parts], name=name)


def _overview(run_results: RunResults, trends: views.TrendViews, live: Live | None) -> rrb.Horizontal:
    left = _structure(run_results, 4.4, aspect=1.25)
    left.append((views.card("Now", "/now"), 5.0))
    right: list[tuple[_Part, float]] = [(views.singular_values(), 4.2)] if run_results.spectra else []
    if live and live.residuals:
        right.append((views.residuals(live.residuals), 2.6))
    if live and live.innovations:
        right.append((views.innovations(live.innovations), 2.6))
    right.append((views.card("Events", "/event_list"), 4.0))
    return _beside("Overview", (_stack(*left), 3.3), (_trends(run_results, trends), 4.0), (_stack(*right), 4.2))


def _structure(run_results: RunResults, share: float, *, aspect: float) -> list[tuple[_Part, float]]:
    """Return the view of the structure with its share of the room; none if there is nothing to draw."""
    if run_results.geometry is None:
        return []
    return [(views.structure(run_results.geometry, [answer for _, answer in run_results.answers], aspect), share)]


def _trends(run_results: RunResults, trends: views.TrendViews) -> rrb.Container:
    parts: list[tuple[_Part, float]] = []
    if any(m.shift_percent is not None for w in run_results.watched for m in w.modes):
        parts.append(
            (
                trends.series(
                    "Frequency shift from the baseline [its standard deviation]",
                    "/trend/shift",
                    values=shift_span(run_results),
                ),
                4.0,
            )
        )
        legend, rows = views.legend("Colours of the modes", "/legend", len(run_results.tracks) + 2)
        parts.append((legend, 0.3 + 0.4 * rows))
    elif any(w.modes for w in run_results.learning):
        parts.append((trends.series("Frequencies found while learning [Hz]", "/trend/found"), 4.0))
    if any(w.novelty for w in run_results.watched):
        parts.append((trends.series("Novelty, log10(T² / limit); above 0: over the limit", "/novelty"), 2.4))
    return _stack(*parts, (trends.lanes(), 1.7))


def _identification(run_results: RunResults, trends: views.TrendViews) -> rrb.Horizontal:
    left: list[tuple[_Part, float]] = [(views.singular_values(), 5.0)] if run_results.spectra else []
    if run_results.reference:
        has_model = run_results.structure is not None
        modes = (views.card("Baseline and model" if has_model else "Baseline", "/reference/modes"), 5.6)
        model = [(views.card("Calibration", "/reference/model"), 4.4)] if has_model else []
        shaped = run_results.reference.has_shapes
        auto_mac = [(views.mac("Auto-MAC", "/auto_mac"), 3.4)] if shaped else []
        left.append((_beside("Reference", modes, *model, *auto_mac), 4.0))
    return _beside("Identification", (_stack(*left), 5.6), (_over_time(run_results, trends), 3.4))


def _over_time(run_results: RunResults, trends: views.TrendViews) -> rrb.Container:
    """One small plot a mode, each with an axis of its own, so that a shift far smaller than the whole band is seen."""
    numbers = run_results.tracks
    if not numbers:
        return rrb.Vertical(trends.series("Frequencies found while learning [Hz]", "/trend/found"))
    frequency = [
        trends.small(f"Mode {n} [Hz]", f"/trend/frequency/mode_{n}", frequency_span(run_results, n)) for n in numbers
    ]
    damping = [trends.small(f"Mode {n} [%]", f"/trend/damping/mode_{n}", damping_span(run_results, n)) for n in numbers]
    return rrb.Tabs(
        _grid(frequency, name="Natural frequencies, ± 2σ"), _grid(damping, name="Damping, ± 2σ"), active_tab=0
    )


def _has_increments(run_results: RunResults) -> bool:
    return run_results.reference is not None and any(w.increments for w in run_results.windows)


def _has_diagnosis(run_results: RunResults) -> bool:
    return any(w.diagnosis for w in run_results.windows)


def _change(run_results: RunResults, trends: views.TrendViews) -> rrb.Container:
    """Return the likelihood's pictures, with the one-step update's and the diagnosis, if there are any."""
    evidence = _posterior(run_results, trends)
    if not _has_increments(run_results) or run_results.reference is None:
        card = [(views.card("Diagnosis", "/diagnosis"), 2.4)] if _has_diagnosis(run_results) else []
        return _beside("Change", *_structure(run_results, 3.0, aspect=0.82), *evidence, *card)
    scenes = [(view, 2.0) for view in views.increments(run_results.reference)]
    above = _beside("Where", *_structure(run_results, 2.6, aspect=1.0), *scenes)
    card = [(views.card("Diagnosis", "/diagnosis"), 2.6)] if _has_diagnosis(run_results) else []
    below = _beside("Evidence", *evidence, (views.increment_curves(), 4.0), *card)
    return rrb.Vertical(above, below, row_shares=[1.0, 1.05], name="Change")


def _posterior(run_results: RunResults, trends: views.TrendViews) -> list[tuple[_Part, float]]:
    """Return the profile of the likelihood with the answer's sharpening under it; nothing without an answer."""
    if not run_results.answers:
        return []
    mass = trends.series(f"Mass, ± 2σ [{run_results.mass_unit[1]}]", "/answer/mass", values=mass_span(run_results))
    place = trends.series("Place, standard deviation [mm]", "/answer/place")
    parts: list[tuple[_Part, float]] = [(_beside("Sharpening", (mass, 1.0), (place, 1.0)), 3.4)]
    if any(has_profile(answer) for _, answer in run_results.answers):
        parts.insert(0, (views.posterior(), 5.6))
    return [(_stack(*parts), 4.2)]


def _signals(channels: Sequence[str], span: rr.TimeRange, values: tuple[float, float] | None = None) -> rrb.Grid:
    return _grid([views.signal(channel, span, values) for channel in channels], name="Signals")


def _channels(run_results: RunResults, trends: views.TrendViews, *, drawn_once: bool) -> rrb.Horizontal | None:
    """Return spectra and figures of the channels; None if there are none.

    Parameters
    ----------
    drawn_once : with the parts that are drawn at the end of a run
    """
    right: list[tuple[_Part, float]] = []
    if drawn_once and run_results.spectra:
        right.append((views.spectrogram(), 3.6))
    if names := channels_with_rms(run_results):
        right.append((trends.series("RMS of each channel [m/s²]", "/channels/rms"), 2.0))
        colours, rows = views.legend("Colours of the channels", "/channels/legend", len(names))
        right.append((colours, 0.35 + 0.6 * rows))
    if run_results.temperatures:
        right.append((trends.series("Temperature [°C]", "/channels/temperature"), 1.6))
        colours, rows = views.legend(
            "Colours of the thermometers", "/channels/thermometers", len(run_results.temperatures)
        )
        right.append((colours, 0.35 + 0.6 * rows))
    parts: list[tuple[_Part, float]] = []
    if drawn_once and run_results.signals:
        right.insert(0, (views.card("Last seconds", "/channels/table"), 5.2))
        parts.append((views.channel_spectra(len(run_results.signals.channels)), 1.2))
    parts += [(_stack(*right), 1.0)] if right else []
    return _beside("Channels", *parts) if parts else None


def _grid(plots: Sequence[rrb.View], name: str) -> rrb.Grid:
    return rrb.Grid(*plots, grid_columns=math.ceil(len(plots) / _PLOTS_A_COLUMN), name=name)
