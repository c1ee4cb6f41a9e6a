"""Sequence of the monitoring loop: baseline, score of each window, alarm, commands of operators."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from daq import Event, IndexArray
from monitor.analysis.window import Window
from monitor.detection.alarm import Alarm, Change, Kind
from monitor.optional import OptionalWork
from monitor.results.convert import mode_results, reference_result
from monitor.results.events import TOPIC_ACCEPT, TOPIC_ACKNOWLEDGE, TOPIC_UNDO
from monitor.results.windows import AlarmResult, ModeResult, Phase, ReferenceResult, Result, WindowResult
from monitor.settings import Settings
from monitor.text.alarms import (
    accepted_said,
    acknowledged_said,
    change_said,
    resumed_said,
    seen_again_said,
    undone_said,
)
from monitor.text.detectability import NO_THERMOMETER
from monitor.text.quantities import utc
from monitor.text.trends import trend_text
from monitor.watch.acceptance import MIN_WINDOWS, CannotAcceptError, accept_change, undo_last, watch_again
from monitor.watch.accepted_change import AcceptanceRequest
from monitor.watch.answer import answer, sensors
from monitor.watch.baseline import Watch, learn_watch
from monitor.watch.baseline_checks import (
    MAX_RESTARTS,
    baseline_shortcomings,
    change_in_baseline,
    extended_text,
    longer_baseline,
    too_short_text,
)
from monitor.watch.detector import MAX_OUT
from monitor.watch.memory import Memory, state_fingerprint
from monitor.watch.self_test import NEVER_TESTED, SelfTests
from updater import Structure, UpdaterError
from updater.modal_data import NO_DELAYS, DeviceDelays


class WindowEvaluator:
    """Evaluation of a structure, window by window.

    Parameters
    ----------
    structure : of the site
    settings : of the site
    memory : state of the run before, to be continued; it must belong to the same baseline (see `recall`)
    """

    def __init__(self, structure: Structure, settings: Settings, memory: Memory | None) -> None:
        self._structure, self._settings = structure, settings
        self._devices = settings.device_of
        self._alarm = Alarm(rules=settings.alarm.rules)
        self.n_windows = 0  #: windows so far, including those left out or without a result
        self._baseline: list[Window] = []  # until there are enough
        self._target = settings.analysis.first_windows  # to learn from
        self._restarts = 0  # of learning, by changes of the structure within the baseline
        self._watch: Watch | None = None
        self._out: list[Window] = []  # windows over the limit, without a break
        self._calm: list[Window] = []  # windows under it since the sensors were last looked at
        self._wanted: AcceptanceRequest | None = None
        self._tests = SelfTests(settings, memory.tests if memory else NEVER_TESTED)
        self._extras = OptionalWork()
        if memory is not None:
            self._resume(memory)

    def _resume(self, memory: Memory) -> None:
        self.n_windows = memory.n_windows
        self._alarm = replace(memory.alarm, rules=self._settings.alarm.rules)
        self._out, self._calm, self._wanted = list(memory.out), list(memory.calm), memory.wanted
        if memory.detector is None:
            self._baseline, self._restarts = list(memory.baseline), memory.restarts
            self._target = max(self._target, min(memory.target, self._settings.analysis.most_windows))
        else:
            self._watch = learn_watch(
                self._structure, memory.baseline, self._devices, self._settings, memory.detector, memory.accepted
            )

    @property
    def memory(self) -> Memory:
        """State to continue from after a restart."""
        watch = self._watch
        return Memory(
            state_fingerprint=state_fingerprint(self._structure, self._settings),
            n_windows=self.n_windows,
            baseline=watch.baseline if watch else tuple(self._baseline),
            target=self._target,
            restarts=self._restarts,
            detector=watch.detector.state if watch else None,
            alarm=self._alarm,
            accepted=watch.accepted if watch else (),
            wanted=self._wanted,
            tests=self._tests.state,
            out=tuple(self._out),
            calm=tuple(self._calm),
        )

    @property
    def phase(self) -> Phase:
        """Purpose of a window."""
        return "learning" if self._watch is None else "alarm" if self._alarm.state == "alarm" else "watching"

    @property
    def delays(self) -> DeviceDelays:
        """Of devices, as far as they are known."""
        return self._watch.reference.delays if self._watch else NO_DELAYS

    def modes(self, window: Window) -> list[ModeResult]:
        """Return a window's modes as reported."""
        reference = self._watch.reference if self._watch else None
        return mode_results(window.synchronized, *self._tracked(window), reference)

    def evaluate(self, window: Window, result: WindowResult) -> Iterator[Result]:
        """Evaluate one window; yield the results, first its own."""
        yield from self._learn(window, result) if self._watch is None else self._judge(window, self._watch, result)

    def apply_command(self, event: Event) -> Iterator[Result]:
        """Execute the command of a person; other events have no effect."""
        if event.topic == TOPIC_ACKNOWLEDGE:
            yield from self._acknowledge(event)
        elif event.topic == TOPIC_ACCEPT:
            yield from self._want(event)
        elif event.topic == TOPIC_UNDO:
            yield from self._undo(event)

    def resumed(self, time: int) -> Iterator[Result]:
        """Report the continued reference, so that this log alone has it."""
        watch, alarm = self._watch, self._alarm
        since = alarm.raised if alarm.state == "alarm" else None
        if watch:
            yield self._reference(watch, time)
            text = resumed_said(len(watch.baseline), watch.learnt, since)
        else:
            text = f"learning continues: {len(self._baseline)} of {self._target} windows"
        last = max(0, self.n_windows - 1)
        yield AlarmResult(time=time, state=alarm.state, text=text, window=last, kind="resumed", quiet=True, since=since)

    def _tracked(self, window: Window) -> tuple[IndexArray, IndexArray]:
        """Return the window's modes, or -1, and the tracks that they are on; all of them while a baseline is learnt."""
        if self._watch:
            return self._watch.modes_of(window.synchronized), self._watch.watched
        return np.arange(window.synchronized.n_modes), np.arange(window.synchronized.n_modes)

    def _learn(self, window: Window, result: WindowResult) -> Iterator[Result]:
        self._baseline.append(window)
        yield result
        if len(self._baseline) < self._target:
            return
        try:
            watch = learn_watch(self._structure, self._baseline, self._devices, self._settings)
        except (UpdaterError, np.linalg.LinAlgError) as error:
            self._baseline.pop(0)  # learning continues: the oldest window makes room
            yield self._said(window, str(error))
            return
        change = change_in_baseline(watch.baseline, watch.reference.windows)
        if change and self._restarts < MAX_RESTARTS:
            self._restarts += 1
            self._baseline = self._baseline[change[0] :]
            self._target = self._settings.analysis.first_windows
            yield self._said(window, change[1])
            return
        lacking = baseline_shortcomings(watch.baseline, watch.reference.windows, self._settings.step_seconds)
        longer = longer_baseline(len(watch.baseline), lacking, self._settings.analysis.most_windows)
        if longer > len(watch.baseline) and not change:
            said, self._target = self._target == self._settings.analysis.first_windows, longer
            if said:
                yield self._said(window, extended_text(len(watch.baseline), lacking, longer, self._settings))
            return
        self._watch, self._baseline, self._restarts = watch, [], 0
        yield self._reference(watch, window.end)
        though = f", though {change[1].partition(';')[0]}" if change else ""
        though += f"; {too_short_text(lacking)}" if lacking else ""
        warning = "" if watch.detector.has_thermometer else f"; {NO_THERMOMETER}"
        yield self._said(window, f"baseline learnt from {len(watch.baseline)} windows{though}{warning}")

    def _judge(self, window: Window, watch: Watch, result: WindowResult) -> Iterator[Result]:
        score = watch.judge(window)
        over = score.t2 > score.limit
        self._alarm, changes = self._alarm.evaluate(window.end, score.level)
        trending = watch.detector.settle(calm=self._alarm.state == "normal")
        self._out = [*self._out, window][-MAX_OUT:] if over else []
        self._calm = [] if over else [*self._calm, window]
        result = result.model_copy(update={"novelty": score, "phase": self.phase})
        if self._alarm.state == "alarm" and over:
            found = self._extras.found("the diagnosis", lambda: self._answer(watch)) or {}
            result = result.model_copy(update=found)
        calm: list[Window] = []
        if len(self._calm) >= self._settings.analysis.first_windows:
            calm, self._calm = self._calm, []
            health = self._extras.found("the look at the sensors", lambda: sensors(watch, calm, self._devices))
            result = result.model_copy(update={"sensors": health or {}})
        yield result
        yield from (self._changed(window.end, c, change_said(c, result)) for c in changes)
        if trending:
            yield self._trend(window.end, watch)
        yield from self._accept(window.end, watch)
        yield from self._extras.found("the self-test", lambda: self._test(watch, window, over=over)) or ()
        yield from (self._notice(window.end, "failed", text) for text in self._extras.failed())
        if calm and self._alarm.state == "normal":
            yield from self._watch_again(window.end, watch, calm)

    def _answer(self, watch: Watch) -> dict[str, Any]:
        return answer(watch, self._changed_windows(), self._devices, self._structure, self._extras)

    def _test(self, watch: Watch, window: Window, *, over: bool) -> tuple[Result, ...]:
        return tuple(self._tests.after(watch, self._alarm, window, over=over))

    def _acknowledge(self, event: Event) -> Iterator[Result]:
        """Record the acknowledgement of the alarm."""
        self._alarm, changes = self._alarm.acknowledge(event.time)
        yield from (self._changed(event.time, change, acknowledged_said(change, event.payload)) for change in changes)

    def _want(self, event: Event) -> Iterator[Result]:
        """Take a change as the new normal as soon as there are enough windows of it."""
        said, raised = event.payload, self._alarm.raised
        if self._watch is None or self._alarm.state != "alarm" or not self._out:
            yield self._notice(event.time, "refused", "not accepted: no alarm is active")
        elif said["alarm"] is not None and said["alarm"] != raised:
            stands = utc(raised) if raised is not None else "none"
            yield self._notice(event.time, "refused", f"not accepted: the active alarm is of {stands}")
        else:
            self._wanted = AcceptanceRequest(cause=said["cause"], by=said["by"])
            yield from self._accept(event.time, self._watch)
            if self._wanted:
                text = f"to be accepted as {said['cause']!r} once there are {MIN_WINDOWS} windows since the change"
                yield self._notice(event.time, "accepting", f"{text}; there are {len(self._changed_windows())}")

    def _accept(self, time: int, watch: Watch) -> Iterator[Result]:
        """Make the changed structure the reference, if that is wanted and there are enough windows of it."""
        changed_windows, wanted = self._changed_windows(), self._wanted
        if wanted is not None and self._alarm.state != "alarm":
            self._wanted = None
            yield self._notice(time, "refused", f"{wanted.cause!r} is not accepted: the change has disappeared")
            return
        if wanted is None or len(changed_windows) < MIN_WINDOWS:
            return
        self._wanted = None
        raised = self._alarm.raised or time
        try:
            watch = accept_change(
                self._structure, watch, changed_windows, self._devices, self._settings, wanted, raised
            )
        except CannotAcceptError as error:
            yield self._notice(time, "refused", f"{wanted.cause!r} cannot be accepted: {error}")
            return
        self._watch, self._out, self._calm = watch, [], []
        self._alarm, change = self._alarm.accept(time)
        yield self._reference(watch, time)
        yield self._changed(time, change, accepted_said(watch.accepted[-1].result))

    def _watch_again(self, time: int, watch: Watch, calm: list[Window]) -> Iterator[Result]:
        """Watch modes again that an accepted change hid, if as many windows as a baseline has show them."""
        again = self._extras.found(
            "the look for hidden modes",
            lambda: watch_again(self._structure, watch, calm, self._devices, self._settings),
        )
        if again is None:
            return
        self._watch = again
        self._tests.forget()
        yield self._reference(again, time)
        yield self._notice(time, "seen_again", seen_again_said(watch.accepted[-1].result, again.accepted[-1].result))

    def _undo(self, event: Event) -> Iterator[Result]:
        """Return to the reference before the last acceptance; or cancel one that waits for windows."""
        watch, wanted = self._watch, self._wanted
        if wanted is not None:
            self._wanted = None
            yield self._notice(event.time, "undone", f"{wanted.cause!r} is not to be accepted any more")
            return
        if watch is None or not watch.accepted:
            yield self._notice(event.time, "refused", "nothing is undone: no change has been accepted")
            return
        self._watch = undo_last(self._structure, watch, self._devices, self._settings)
        self._out, self._calm = [], []
        self._tests.forget()
        yield self._reference(self._watch, event.time)
        yield self._notice(event.time, "undone", undone_said(watch.accepted[-1].result, event.payload))

    def _reference(self, watch: Watch, time: int) -> ReferenceResult:
        return reference_result(watch.reference, time, watch.watched, [change.result for change in watch.accepted])

    def _notice(self, time: int, kind: Kind, text: str) -> AlarmResult:
        """Return a message without a change of the alarm."""
        last = max(0, self.n_windows - 1)
        return AlarmResult(time=time, state=self._alarm.state, text=text, window=last, kind=kind, quiet=True)

    def _trend(self, time: int, watch: Watch) -> AlarmResult:
        """Return the event of a slow trend that has begun, changed or ended: the alarm's state stays as it is."""
        trend = watch.detector.trend
        notice = self._notice(time, "trend" if trend else "trend_over", trend_text(trend))
        return notice.model_copy(update={"quiet": self._settings.alarm.trend != "notify"})

    def _changed(self, time: int, change: Change, text: str) -> AlarmResult:
        return AlarmResult(
            time=time,
            state=change.state,
            text=text,
            window=max(0, self.n_windows - 1),
            kind=change.kind,
            lasted=None if change.lasted is None else change.lasted * 1e-9,
            quiet=change.quiet,
        )

    def _changed_windows(self) -> list[Window]:
        """Return the windows over the limit that begin after the first of them, which may hold both states."""
        return [w for w in self._out if w.start >= self._out[0].end]

    def _said(self, window: Window, text: str) -> AlarmResult:
        return AlarmResult(time=window.end, state=self._alarm.state, text=text, window=window.index)
