"""Live results and signals, served to any viewer."""

import math
import os
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

import rerun as rr

from daq import Block, Item
from monitor.analysis.temperature import TOPIC_TEMPERATURE
from monitor.results.innovations import TOPIC_INNOVATIONS, ModeInnovations
from monitor.results.residuals import TOPIC_RESIDUALS, ChannelResiduals
from monitor.results.run_results import RunResults, standing_answer
from monitor.results.windows import AlarmResult, ReferenceResult, Result, WindowResult, event_result
from monitor.settings import Settings, attached_structure, parse_attached
from monitor.views.viewer.cards import write_cards, write_reference
from monitor.views.viewer.increments import draw_increments
from monitor.views.viewer.layout.blueprint import Live, layout
from monitor.views.viewer.layout.view_specs import BlockPlot
from monitor.views.viewer.modes.mac_matrix import draw_auto_mac
from monitor.views.viewer.modes.shapes import draw_shapes, draw_window_shapes
from monitor.views.viewer.modes.trends import draw_legend, draw_trends
from monitor.views.viewer.posterior import draw_answers
from monitor.views.viewer.primitives import APPLICATION, at
from monitor.views.viewer.scene import draw_bare_structure, draw_place
from monitor.views.viewer.signals.channels import (
    clear_innovations,
    draw_innovations,
    draw_residuals,
    draw_rms,
    draw_temperature,
    name_thermometers,
)
from monitor.views.viewer.signals.traces import SignalStream
from monitor.views.viewer.spectrum import draw_spectra
from monitor.views.viewer.state_lanes import (
    events,
    log_state,
    name_states,
    state_changes,
    write_event,
    write_event_list,
)

_HOST = "127.0.0.1"
_SIGNALS_MB = 32  # a ring: the newest signals, for a viewer that comes late
_BASELINES, _MIN_WINDOWS = 2.0, 12  # range of a live view's trends
_KEPT_WINDOWS = 2  # with their spectra and profiles, which are large
_KEPT_ALARMS = 50
_RESIDUAL_BLOCKS = 60  # lengths of a block that are drawn
_TEMPERATURE_SECONDS = 10.0  # between readings that are drawn


def serve(structure: str, site: str, items: Iterable[Item]) -> None:
    """Serve items until there are no more; to be called in a process of its own.

    Parameters
    ----------
    structure, site : texts of the structure's TOML, empty for none, and of the site's
    items : blocks and events as they are logged
    """
    os.nice(10)  # acquisition and analysis come first
    settings = parse_attached(site)
    if settings.viewer is None:
        raise ValueError("site: expected a [viewer] section, found none")
    described, identity = attached_structure(structure), f"live-{os.getpid()}"
    name = described.name if described else settings.history.site or "measured modes"
    port, limit = settings.viewer.port, settings.viewer.memory_mb
    with _server(identity, port, limit) as trend, _server(identity, port + 1, _SIGNALS_MB) as raw:
        trend.send_recording_name(name)
        results, signals = LiveResults(trend, name, settings), SignalStream(raw, settings.channels)
        for item in items:
            if isinstance(item, Block):
                signals.add(item)
                results.add_temperature(item.device, item.arrival_time, item.temperature)
                continue
            if item.topic == TOPIC_TEMPERATURE:
                results.add_temperature("site", item.time, float(item.payload["celsius"]))
            if item.topic == TOPIC_RESIDUALS:
                results.add_residuals(ChannelResiduals.model_validate(item.payload))
                continue
            if item.topic == TOPIC_INNOVATIONS:
                results.add_innovations(ModeInnovations.model_validate(item.payload))
                continue
            result = event_result(item)
            results.add(result)
            if isinstance(result, ReferenceResult):
                signals.know(result)


@contextmanager
def _server(identity: str, port: int, megabytes: int) -> Iterator[rr.RecordingStream]:
    """Open a server; two with the same identity are one recording to a viewer that opens both."""
    recording = rr.RecordingStream(APPLICATION, recording_id=identity, send_properties=False)
    recording.set_sinks(rr.GrpcServerSink(_HOST, port, server_memory_limit=f"{megabytes}MB"))
    rr.set_log_time_enabled(False, recording=recording)
    rr.set_log_tick_enabled(False, recording=recording)
    try:
        yield recording
    finally:
        with suppress(RuntimeError):  # a server whose port was taken has reported it, and has nothing to send
            recording.flush(timeout_sec=2.0)
        recording.disconnect()


class LiveResults:
    """Draws each result when it comes.

    Parameters
    ----------
    recording : that is served
    name : of the structure
    settings : of the site
    """

    def __init__(self, recording: rr.RecordingStream, name: str, settings: Settings) -> None:
        self._recording, self._name = recording, name
        analysis = settings.analysis
        self._most = int(_BASELINES * max(analysis.most_windows, _MIN_WINDOWS))  # windows that are kept
        shown = self._most * analysis.window_seconds
        channels = tuple(channel.name for channel in settings.channels)
        self._live = Live(seconds=shown, channels=channels)
        self._reference: ReferenceResult | None = None
        self._windows: list[WindowResult] = []  # the first one, and the newest
        self._alarms: deque[AlarmResult] = deque(maxlen=_KEPT_ALARMS)
        self._states: dict[str, tuple[int, str]] = {}  # lane -> time [ns UTC] and state of its last change
        self._told: set[tuple[int, str, str]] = set()  # events that are kept
        self._shown: set[str] = set()
        self._temperatures: dict[str, int] = {}  # thermometer -> time of the last reading that was drawn [ns UTC]
        self._answered: WindowResult | None = None  # window whose answer holds
        name_states(recording)

    def add(self, result: Result | None) -> None:
        """Take one result; None is none, and a self-test is nothing to draw."""
        if isinstance(result, ReferenceResult):
            self._reference = result
            at(self._recording, result.time)
            clear_innovations(self._recording)
            if result.has_geometry:
                draw_bare_structure(self._recording, result, result.time)
            write_reference(self._recording, result)
            draw_auto_mac(self._recording, result, static=False)
            draw_shapes(self._recording, result, result.time)
        elif isinstance(result, AlarmResult):
            self._alarms.append(result)
        elif isinstance(result, WindowResult):
            self._window(result)
        if result and self._windows:
            self._tell()
            self._lay_out()

    def add_temperature(self, name: str, time: int, celsius: float) -> None:
        """Draw a reading [degC] of the site or a device, unless the last one is too recent."""
        if math.isfinite(celsius) and abs(time - self._temperatures.get(name, 0)) >= _TEMPERATURE_SECONDS * 1e9:
            is_new = name not in self._temperatures
            self._temperatures[name] = time
            number = list(self._temperatures).index(name)
            if is_new:
                at(self._recording, time)
                name_thermometers(self._recording, list(self._temperatures), static=False)
            draw_temperature(self._recording, name, number, [time], [celsius])

    def add_residuals(self, residuals: ChannelResiduals) -> None:
        """Draw the residuals of a block."""
        draw_residuals(self._recording, residuals)
        if not self._live.residuals:
            plot = BlockPlot(seconds=_RESIDUAL_BLOCKS * residuals.seconds, limit=residuals.limit)
            self._show(replace(self._live, residuals=plot))

    def add_innovations(self, innovations: ModeInnovations) -> None:
        """Draw the innovations about the modes, of a block."""
        draw_innovations(self._recording, innovations)
        if not self._live.innovations:
            plot = BlockPlot(seconds=_RESIDUAL_BLOCKS * innovations.seconds, limit=innovations.limit)
            self._show(replace(self._live, innovations=plot))

    def _show(self, live: Live) -> None:
        self._live = live
        if self._windows:
            self._lay_out()

    def _results_of(self, windows: list[WindowResult]) -> RunResults:
        return RunResults(
            name=self._name,
            reference=self._reference,
            windows=tuple(windows),
            alarms=tuple(self._alarms),
            temperatures=dict.fromkeys(self._temperatures, ([], [])),
        )

    def _window(self, window: WindowResult) -> None:
        self._windows = [*self._windows, window]
        older = self._windows[:-_KEPT_WINDOWS]
        self._windows[: len(older)] = [
            w.model_copy(update={"spectrum": None, "answer": None, "increments": None, "diagnosis": None})
            for w in older
        ]
        del self._windows[1 : max(1, len(self._windows) - self._most)]
        run_results = self._results_of([window])
        at(self._recording, window.end)  # axes too: what is logged before any time would hide those of later windows
        if run_results.geometry:
            draw_place(self._recording, run_results.geometry, window, run_results.mass_unit, self._answered)
        if self._reference:
            draw_window_shapes(self._recording, self._reference, run_results.watched)
        draw_spectra(self._recording, run_results, static=False)
        draw_trends(self._recording, run_results)
        draw_legend(self._recording, run_results, static=False)
        draw_rms(self._recording, run_results)
        draw_answers(self._recording, run_results, static=False)
        draw_increments(self._recording, run_results, static=False)
        write_cards(self._recording, run_results, self._answered)
        self._answered = standing_answer(window, self._answered)

    def _tell(self) -> None:
        """Log the changes of state and the events that were not logged yet."""
        run_results = self._results_of(self._windows)
        for lane, time, state in state_changes(run_results):
            last = self._states.get(lane)
            if last is None or (time > last[0] and state != last[1]):
                self._states[lane] = time, state
                log_state(self._recording, lane, time, state)
        happened = sorted(events(run_results), key=lambda event: event[0])
        new = [event for event in happened if event not in self._told]
        for event in new:
            write_event(self._recording, *event)
        if new:
            write_event_list(self._recording, happened)
        self._told = set(happened)

    def _lay_out(self) -> None:
        """Send the layout again when there is something new to show; changes by a user are kept until then."""
        run_results = self._results_of(self._windows)
        last = self._windows[-1]
        has = {
            "reference": self._reference,
            "judged": last.novelty,
            "answer": last.answer,
            "increments": last.increments,
            "diagnosis": last.diagnosis,
            "rms": last.rms,
            "temperatures": self._temperatures,
            "residuals": self._live.residuals,
            "innovations": self._live.innovations,
        }
        grown = self._shown | {name for name, value in has.items() if value} | {"window", *map(str, run_results.tracks)}
        if grown != self._shown:
            self._shown = grown
            self._recording.send_blueprint(layout(run_results, self._live))
