"""From blocks to answers: a deterministic function of what the log holds, the same live and in replay."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from daq import Assembler, Block, Event, FloatArray, Recording
from monitor.alarm_words import acknowledged_said, change_said
from monitor.alarms import Alarm, Change
from monitor.describe import (
    increment_result,
    mass_answer,
    mode_results,
    reference_result,
    spectrum_result,
)
from monitor.explaining import Seen, explain_windows, seen_in, sensors_seen
from monitor.fusion import choose_tracks
from monitor.inbox import TOPIC_ACKNOWLEDGE
from monitor.lateness import InTime, in_time, without_known
from monitor.novelty import Detector
from monitor.results import AlarmResult, MassIncrements, Phase, ReferenceResult, WindowResult
from monitor.settings import Settings
from monitor.words import is_one_mass
from oma import Identification, IdentificationError, ModalEstimate, Tracker, identify_all
from updater import (
    NO_DELAYS,
    MassUpdater,
    ModalMean,
    PairingError,
    Reference,
    Structure,
    estimate_delays,
    learn_reference,
    locate_and_sharpen,
    mean_modes,
    remove_delays,
    stack_tracks,
)

Result = WindowResult | ReferenceResult | AlarmResult


@dataclass(frozen=True, eq=False)
class _Window:
    index: int
    recording: Recording
    identification: Identification
    estimate: ModalEstimate  #: with the devices' delays removed
    removed: Mapping[str, float]  #: device -> what that was in all [s]


@dataclass(frozen=True, eq=False)
class _Watch:
    """What watching needs once a baseline is learnt."""

    tracker: Tracker
    reference: Reference
    updater: MassUpdater
    detector: Detector


class Pipeline:
    """The monitoring loop without clocks, ports and files.

    Parameters
    ----------
    structure : of the site
    settings : of the site
    """

    def __init__(self, structure: Structure, settings: Settings) -> None:
        analysis = settings.analysis
        self._settings, self._structure = settings, structure
        self._devices = {channel.name: channel.device for channel in settings.channels}
        self._assembler = Assembler(
            settings.channels,
            {device.name: device.rate for device in settings.device},
            window_seconds=analysis.window_seconds,
            step_seconds=settings.step_seconds,
        )
        self._alarm = Alarm(rules=settings.alarm.rules)
        self._n_windows = 0
        self._baseline: list[_Window] = []
        self._watch: _Watch | None = None
        self._before: Seen = seen_in([])  # what went with the baseline's windows
        self._out: list[_Window] = []  # windows over the limit, without a break
        self._calm: list[_Window] = []  # windows under it since the sensors were last looked at

    def push(self, item: Block | Event) -> Iterator[Result]:
        """Take one item in the log's order; yield what it lets be said."""
        if isinstance(item, Event) and item.topic == TOPIC_ACKNOWLEDGE:
            yield from self._acknowledge(item)
        windows = self._assembler.push(item) if isinstance(item, Block) else self._assembler.push_event(item)
        for recording in windows:
            yield from self._analyse(recording)

    def _analyse(self, recording: Recording) -> Iterator[Result]:
        index = self._n_windows
        self._n_windows += 1
        try:
            found = identify_all(recording, band=self._settings.analysis.band)
        except IdentificationError as error:
            yield self._bare(index, recording, str(error))
            return
        own, seen = without_known(found.estimate, found.delays, self._devices, self._structure.delays)
        found = replace(found, estimate=own, delays=seen)
        known = self._watch.reference.delays.beyond(seen) if self._watch else NO_DELAYS
        late = estimate_delays(own, self._devices, known)
        removed = {device: seen[device] + tau for device, tau in late.items()}
        window = _Window(index, recording, found, remove_delays(own, self._devices, late), removed)
        yield from self._learn(window) if self._watch is None else self._judge(window, self._watch)

    def _bare(self, index: int, recording: Recording, problem: str) -> WindowResult:
        return WindowResult(
            index=index,
            start=recording.start,
            end=recording.end,
            phase=self._phase(),
            channels=[channel.name for channel in recording.channels],
            modes=[],
            rms=_rms(recording),
            problem=problem,
        )

    def _phase(self) -> Phase:
        return "learning" if self._watch is None else "alarm" if self._alarm.state == "alarm" else "watching"

    def _result(self, window: _Window, watch: _Watch | None) -> WindowResult:
        track = np.arange(window.estimate.n_modes) if watch is None else watch.tracker.assign(window.estimate)
        return self._bare(window.index, window.recording, "").model_copy(
            update={
                "channels": list(window.estimate.channels),
                "modes": mode_results(window.estimate, track, watch.reference if watch else None),
                "spectrum": spectrum_result(window.recording, window.identification.poles),
                "problem": None,
            }
        )

    def _learn(self, window: _Window) -> Iterator[Result]:
        self._baseline.append(window)
        yield self._result(window, None)
        if len(self._baseline) < self._settings.analysis.baseline_windows:
            return
        try:
            found = [w.identification for w in self._baseline]
            self._before = seen_in([(w.recording, w.identification) for w in self._baseline])
            tracker, reference = learn_baseline(self._structure, found, self._devices)
        except PairingError as error:
            self._baseline.pop(0)  # go on learning: the oldest window makes room
            yield self._said(window, str(error))
            return
        recordings = [w.recording for w in self._baseline]
        detector = Detector(reference.windows, recordings, self._settings)
        self._watch = _Watch(tracker, reference, MassUpdater(reference), detector)
        yield reference_result(reference, window.recording.end)
        yield self._said(window, f"baseline learnt from {len(self._baseline)} windows")

    def _judge(self, window: _Window, watch: _Watch) -> Iterator[Result]:
        score = watch.detector.consider(window.recording, window.estimate, watch.tracker.assign(window.estimate))
        over = score.t2 > score.limit
        level = score.t2 / score.limit if score.modes else math.nan
        self._alarm, changes = self._alarm.consider(window.recording.end, level)
        watch.detector.settle(calm=self._alarm.state == "normal")
        self._out = [*self._out, window] if over else []
        self._calm = [] if over else [*self._calm, window]
        result = self._result(window, watch).model_copy(update={"novelty": score, "phase": self._phase()})
        if self._alarm.state == "alarm" and over:
            result = result.model_copy(update=self._explain(watch))
        if len(self._calm) >= self._settings.analysis.baseline_windows:
            calm, self._calm = self._calm, []
            lateness = InTime(tuple(w.estimate for w in calm), self._devices, tuple(w.removed for w in calm))
            tracks = [watch.tracker.assign(w.estimate) for w in calm]
            result = result.model_copy(update={"sensors": sensors_seen(watch.reference, lateness, tracks)})
        yield result
        nodes = watch.reference.calibration.model.nodes
        yield from (self._changed(window.recording.end, c, change_said(c, result, nodes)) for c in changes)

    def _acknowledge(self, event: Event) -> Iterator[Result]:
        """Obey a person who knows of the alarm."""
        self._alarm, changes = self._alarm.acknowledge(event.time)
        yield from (self._changed(event.time, change, acknowledged_said(change, event.payload)) for change in changes)

    def _changed(self, time: int, change: Change, text: str) -> AlarmResult:
        return AlarmResult(
            time=time,
            state=change.state,
            text=text,
            window=max(0, self._n_windows - 1),
            kind=change.kind,
            lasted=None if change.lasted is None else change.lasted * 1e-9,
            quiet=change.quiet,
        )

    def _explain(self, watch: _Watch) -> dict[str, Any]:
        """Explain by the windows that begin after the first one over the limit: that one may hold both states.

        A mass is claimed only where the diagnosis says that one mass, and nothing else, explains them.
        """
        pure = [w for w in self._out if w.recording.start >= self._out[0].recording.end]
        if not pure:
            return {}
        tracks = [watch.tracker.assign(w.estimate) for w in pure]
        event = watch.reference.mean_of(stack_tracks([w.estimate for w in pure], tracks))
        found: dict[str, Any] = {"increments": _increments(watch, event, len(pure))}
        lateness = InTime(tuple(w.estimate for w in pure), self._devices, tuple(w.removed for w in pure))
        now = seen_in([(w.recording, w.identification) for w in pure])
        try:
            diagnosis, beside = explain_windows(watch.reference, self._before, now, lateness, tracks)
        except ValueError:
            return found  # fewer than three modes left to compare: there is an alarm, but no cause
        found |= {"diagnosis": diagnosis, "discrepancy": beside}
        if is_one_mass(diagnosis):
            change, outlook = locate_and_sharpen(watch.reference, event)
            found["answer"] = mass_answer(self._structure, change, len(pure), outlook.said)
        return found

    def _said(self, window: _Window, text: str) -> AlarmResult:
        return AlarmResult(time=window.recording.end, state=self._alarm.state, text=text, window=window.index)


def _increments(watch: _Watch, event: ModalMean, n_windows: int) -> MassIncrements | None:
    try:
        return increment_result(watch.updater.update(event), n_windows)
    except (PairingError, ValueError):
        return None  # no modes left to compare, or a channel is missing: there is an alarm, but no increments


def _rms(recording: Recording) -> dict[str, float]:
    power: FloatArray = np.nanmean(np.where(np.isfinite(recording.data).any(0), recording.data, 0.0) ** 2, axis=0)
    return {c.name: float(np.sqrt(p)) for c, p in zip(recording.channels, power, strict=True)}


def learn_baseline(
    structure: Structure, found: list[Identification], devices: Mapping[str, str]
) -> tuple[Tracker, Reference]:
    """Choose the modes to track and learn the reference, the devices' delays first.

    The window with the most modes names the tracks; those present in 70 % of the windows and paired with a model mode
    stay.

    Raises
    ------
    PairingError
        If fewer than three stay.
    """
    lateness = in_time([f.estimate for f in found], [f.delays for f in found], devices)
    estimates = list(lateness.estimates)
    seed, often, tracks = choose_tracks(estimates)
    if len(often) < 3:
        raise PairingError(f"only {len(often)} modes are seen in 70 % of the windows, at least 3 are needed")
    reference = learn_reference(structure, estimates, tracks, lateness.delays)
    chosen = reference.calibration.tracks
    kept = often[chosen]
    mean = mean_modes(stack_tracks(estimates, [track[chosen] for track in tracks]))
    fields = {name: getattr(seed, name)[kept] for name in _MODAL_FIELDS}
    fields |= {"frequency": np.exp(mean.log_frequency), "damping": mean.damping, "shape": mean.shape.astype(complex)}
    tracker = Tracker(reference=replace(seed, channels=mean.channels, **fields))
    return tracker, reference


_MODAL_FIELDS = ("frequency_std", "damping_std", "shape_std", "support", "law_ratio")
