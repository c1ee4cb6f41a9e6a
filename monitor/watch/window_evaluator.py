"""Sequence of the monitoring loop: baseline, score of each window, alarm, commands of operators."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from daq import Event, IndexArray, Recording
from monitor.analysis.states.present_state import PresentState, present_state
from monitor.analysis.window import Window
from monitor.detection.alarm import Alarm, Change, Kind
from monitor.optional import OptionalWork
from monitor.results.convert import mode_results, reference_result
from monitor.results.service_events import AcceptanceUndone, Acknowledged, ChangeAccepted
from monitor.results.windows import AlarmResult, ModeResult, Phase, ReferenceResult, Result, WindowResult
from monitor.settings import Settings
from monitor.text.alarms import (
    acceptance_text,
    acknowledged_text,
    alarm_change_text,
    change_ended_text,
    changed_again_text,
    changing_text,
    location_text,
    model_added_text,
    restored_text,
    resumed_text,
    undone_text,
    waiting_text,
)
from monitor.text.detection import trend_text
from monitor.text.quantities import utc
from monitor.watch.acceptance import MIN_WINDOWS, CannotAcceptError, accept_change, restore_hidden_modes, undo_last
from monitor.watch.accepted_change import AcceptanceRequest
from monitor.watch.answer import answer, sensors
from monitor.watch.baseline.learned_baseline import LearnedBaseline, learn_baseline
from monitor.watch.baseline.learning import BaselineLearning
from monitor.watch.detector import MAX_OUT
from monitor.watch.memory import CalmSignals, Memory, MidLogState, state_fingerprint
from monitor.watch.self_test import NEVER_TESTED, SelfTests
from updater import Reference, Structure, UpdaterError
from updater.modal_data import NO_DELAYS, DeviceDelays, Signals

MakeSignals = Callable[[], Recording]  #: makes the signals of a window


class WindowEvaluator:
    """Evaluation of a structure, window by window.

    Parameters
    ----------
    structure : of the site; None if it has none
    settings : of the site
    memory : state of the run before, to be continued; it must belong to the same baseline (see `recall`)
    """

    def __init__(self, structure: Structure | None, settings: Settings, memory: Memory | None) -> None:
        self._structure, self._settings = structure, settings
        self._alarm = Alarm(rules=settings.alarm.rules)
        self.n_windows = 0  #: windows so far, including those left out or without a result
        self._learning = BaselineLearning(structure, settings, memory)
        self._learned: LearnedBaseline | None = None
        self._out: list[Window] = []  # windows over the limit, without a break
        self._calm: list[Window] = []  # windows under it since the sensors were last looked at
        self._before: CalmSignals | None = None  # of the first calm window of the reference
        self._requested: AcceptanceRequest | None = None
        self._tests = SelfTests(settings, memory.tests if memory else NEVER_TESTED)
        self._extras = OptionalWork()
        self._changing = False  # whether the change that raised the alarm goes on
        self._added = ""  # message on a structure file that was added since the baseline was learned
        if memory is not None:
            self._resume(memory)

    def _resume(self, memory: Memory) -> None:
        self.n_windows = memory.n_windows
        self._alarm = replace(memory.alarm, rules=self._settings.alarm.rules)
        self._out, self._calm, self._requested = list(memory.out), list(memory.calm), memory.wanted
        self._before = memory.signals
        if memory.detector is None:
            return
        rest = memory.baseline, self._settings, memory.detector, memory.accepted
        if self._structure is None or not memory.without_model:
            self._learned = learn_baseline(self._structure, *rest)
            return
        try:
            self._learned = learn_baseline(self._structure, *rest)
            shown = memory.accepted[-1].hides if memory.accepted else np.empty(0, np.intp)
            shown = np.union1d(self._learned.watched, shown)
            self._added = model_added_text(np.setdiff1d(np.arange(memory.detector.n_tracks), shown).tolist())
        except (UpdaterError, np.linalg.LinAlgError) as error:
            self._structure, self._added = None, f"the structure file is not used: {error}"
            self._learned = learn_baseline(None, *rest)

    def begin_log(self) -> None:
        """Drop what no saved state has."""
        self._tests.forget()
        self._extras = OptionalWork()
        self._changing = False

    @property
    def mid_log(self) -> MidLogState:
        """State that is dropped when a log begins."""
        noted, failed = self._extras.state
        return MidLogState(
            recent=self._tests.recent, changing=self._changing, added=self._added, noted=noted, failed=failed
        )

    def continue_log(self, state: MidLogState) -> None:
        """Continue in the middle of a log, after the state of the run before was continued."""
        self._tests.restore(state.recent)
        self._extras.restore(state.noted, state.failed)
        self._changing, self._added = state.changing, state.added

    @property
    def memory(self) -> Memory:
        """State to continue from after a restart."""
        learned = self._learned
        return Memory(
            state_fingerprint=state_fingerprint(self._structure, self._settings),
            n_windows=self.n_windows,
            baseline=learned.baseline if learned else tuple(self._learning.windows),
            target=self._learning.target,
            restarts=self._learning.restarts,
            detector=learned.detector.state if learned else None,
            alarm=self._alarm,
            accepted=learned.accepted if learned else (),
            wanted=self._requested,
            tests=self._tests.state,
            out=tuple(self._out),
            calm=tuple(self._calm),
            signals=self._before,
        )

    @property
    def phase(self) -> Phase:
        """Purpose of a window."""
        return "learning" if self._learned is None else "alarm" if self._alarm.state == "alarm" else "watching"

    @property
    def reference(self) -> Reference | None:
        """Reference of the baseline; None before it is learned, and without a model."""
        return self._learned.model.reference if self._learned and self._learned.model else None

    @property
    def delays(self) -> DeviceDelays:
        """Of devices, as far as they are known."""
        return self._learned.modes.delays if self._learned else NO_DELAYS

    def modes(self, window: Window) -> list[ModeResult]:
        """Return a window's modes as reported."""
        baseline = self._learned.modes if self._learned else None
        return mode_results(window.synchronized, *self._tracked(window), baseline)

    def evaluate(self, window: Window, result: WindowResult, signals: MakeSignals | None = None) -> Iterator[Result]:
        """Evaluate one window; yield the results, first its own.

        Parameters
        ----------
        window : its modes
        result : to be completed
        signals : makes those of the window, which few windows need; None: a loss of stiffness is not tested for opening
            and closing
        """
        if self._learned is None:
            yield from self._learn(window, result)
        else:
            yield from self._judge(window, self._learned, result, signals)

    def apply_command(self, event: Event) -> Iterator[Result]:
        """Execute the command of a person; other events have no effect."""
        if event.topic == Acknowledged.topic:
            yield from self._acknowledge(event.time, Acknowledged.read(event))
        elif event.topic == ChangeAccepted.topic:
            yield from self._request_acceptance(event.time, ChangeAccepted.read(event))
        elif event.topic == AcceptanceUndone.topic:
            yield from self._undo(event.time, AcceptanceUndone.read(event))

    def resumed(self, time: int) -> Iterator[Result]:
        """Report the continued reference, so that this log alone has it."""
        learned, alarm = self._learned, self._alarm
        since = alarm.raised if alarm.state == "alarm" else None
        if learned:
            yield self._reference(learned, time)
            text = resumed_text(len(learned.baseline), learned.learnt, since)
            text, self._added = f"{text}; {self._added}" if self._added else text, ""
        else:
            text = f"learning continues: {len(self._learning.windows)} of {self._learning.target} windows"
        last = max(0, self.n_windows - 1)
        yield AlarmResult(time=time, state=alarm.state, text=text, window=last, kind="resumed", quiet=True, since=since)

    def _tracked(self, window: Window) -> tuple[IndexArray, IndexArray]:
        """Return the window's modes, or -1, and their tracks; all of them while a baseline is learned."""
        if self._learned:
            return self._learned.modes_of(window.synchronized), self._learned.watched
        return np.arange(window.synchronized.n_modes), np.arange(window.synchronized.n_modes)

    def _learn(self, window: Window, result: WindowResult) -> Iterator[Result]:
        yield result.model_copy(update={"learning": self._learning.progress})
        self._learned, text = self._learning.add(window)
        if self._learned:
            yield self._reference(self._learned, window.end)
        if text:
            yield self._message(window, text)

    def _judge(
        self, window: Window, learned: LearnedBaseline, result: WindowResult, signals: MakeSignals | None
    ) -> Iterator[Result]:
        score = learned.judge(window)
        over = score.t2 > score.limit
        self._alarm, changes = self._alarm.evaluate(window.end, score.level)
        trending = learned.detector.settle(calm=self._alarm.state == "normal")
        self._out = [*self._out, window][-MAX_OUT:] if over else []
        self._calm = [] if over else [*self._calm, window]
        if self._before is None and signals and not over and self._alarm.state == "normal":
            make = partial(_calm_signals, signals)  # of a later window, they may hold a change that is not detected yet
            self._before = self._extras.found("the selection of signals", make)
        result = result.model_copy(update={"novelty": score, "phase": self.phase})
        notice = None
        if self._alarm.state == "alarm" and over:
            present, notice = self._present(window, learned)
            found = self._extras.found(
                "the diagnosis",
                lambda: answer(learned, present, self._structure, self._extras, self._before_and_now(signals)),
            )
            result = result.model_copy(update=found or {})
        calm: list[Window] = []
        if len(self._calm) >= self._settings.analysis.first_windows:
            calm, self._calm = self._calm, []
            health = self._extras.found("the look at the sensors", lambda: sensors(learned, calm))
            result = result.model_copy(update={"sensors": health or {}})
        yield result
        yield from (self._alarm_result(window.end, c, alarm_change_text(c, result)) for c in changes)
        if notice is not None:
            yield notice.model_copy(update={"text": f"{notice.text}{location_text(result)}"})
        if trending:
            yield self._trend(window.end, learned)
        yield from self._accept(window.end, learned)
        tested = self._extras.found(
            "the self-test", lambda: tuple(self._tests.after(learned, self._alarm, window, over=over))
        )
        yield from tested or ()
        yield from (self._notice(window.end, "failed", text) for text in self._extras.failed())
        if calm and self._alarm.state == "normal":
            yield from self._restore_hidden_modes(window.end, learned, calm)

    def _before_and_now(self, signals: MakeSignals | None) -> Signals | None:
        """Return the signals before a change, and of the present window; None if either are missing."""
        return Signals(now=signals(), before=self._before.recording) if self._before and signals else None

    def _present(self, window: Window, learned: LearnedBaseline) -> tuple[Sequence[Window], AlarmResult | None]:
        """Return the windows of the present state, and a message if the structure has changed once more, or changes."""
        changed = self._changed_windows()
        look = self._state(changed, learned) if changed else None
        if look is None:
            return changed, None
        was_changing, self._changing = self._changing, look.gradual
        first = look.windows[0].start
        if look.before:
            self._out = [changed[look.before - 1], *look.windows]  # the first may hold both states
        if look.since == "step":
            text = changed_again_text(changed[look.before - 1].start, first)
            return look.windows, self._notice(window.end, "changed_again", text).model_copy(update={"quiet": False})
        if look.since == "end":
            return look.windows, self._notice(window.end, "change_ended", change_ended_text(first))
        if look.gradual and not was_changing:
            return look.windows, self._notice(window.end, "changing", changing_text(len(look.windows)))
        return look.windows, None

    def _state(self, changed: Sequence[Window], learned: LearnedBaseline) -> PresentState | None:
        """Return the present state of the structure by the windows since the change; None if it cannot be found."""
        return self._extras.found("the look for further changes", lambda: present_state(changed, learned.devices))

    def _acknowledge(self, time: int, request: Acknowledged) -> Iterator[Result]:
        """Record the acknowledgement of the alarm."""
        self._alarm, changes = self._alarm.acknowledge(time)
        yield from (self._alarm_result(time, change, acknowledged_text(change, request)) for change in changes)

    def _request_acceptance(self, time: int, request: ChangeAccepted) -> Iterator[Result]:
        """Take a change as the new normal as soon as there are enough windows of it."""
        raised = self._alarm.raised
        if self._learned is None or self._alarm.state != "alarm" or not self._out:
            yield self._notice(time, "refused", "not accepted: no alarm is active")
        elif request.alarm is not None and request.alarm != raised:
            active = utc(raised) if raised is not None else "none"
            yield self._notice(time, "refused", f"not accepted: the active alarm is of {active}")
        else:
            self._requested = AcceptanceRequest(cause=request.cause, by=request.by)
            yield from self._accept(time, self._learned)
            if self._requested:
                n = len(self._changed_windows())
                text = waiting_text(request.cause, MIN_WINDOWS, n, gradual=n >= MIN_WINDOWS)
                yield self._notice(time, "accepting", text)

    def _accept(self, time: int, learned: LearnedBaseline) -> Iterator[Result]:
        """Make the changed structure the reference, if that is wanted and there are enough windows of it."""
        changed_windows, wanted = self._changed_windows(), self._requested
        if wanted is not None and self._alarm.state != "alarm":
            self._requested = None
            yield self._notice(time, "refused", f"{wanted.cause!r} is not accepted: the change has disappeared")
            return
        if wanted is None or len(changed_windows) < MIN_WINDOWS:
            return
        look = self._state(changed_windows, learned)
        if look is not None and look.gradual:
            return
        self._requested = None
        raised = self._alarm.raised or time
        try:
            learned = accept_change(self._structure, learned, changed_windows, self._settings, wanted, raised)
        except CannotAcceptError as error:
            yield self._notice(time, "refused", f"{wanted.cause!r} cannot be accepted: {error}")
            return
        self._learned, self._out, self._calm, self._before = learned, [], [], None
        self._alarm, change = self._alarm.accept(time)
        yield self._reference(learned, time)
        yield self._alarm_result(time, change, acceptance_text(learned.accepted[-1].result))

    def _restore_hidden_modes(self, time: int, learned: LearnedBaseline, calm: list[Window]) -> Iterator[Result]:
        """Watch modes again that an accepted change hid, if as many windows as a baseline has show them."""
        again = self._extras.found(
            "the look for hidden modes",
            lambda: restore_hidden_modes(self._structure, learned, calm, self._settings),
        )
        if again is None:
            return
        self._learned = again
        self._tests.forget()
        yield self._reference(again, time)
        yield self._notice(time, "seen_again", restored_text(learned.accepted[-1].result, again.accepted[-1].result))

    def _undo(self, time: int, request: AcceptanceUndone) -> Iterator[Result]:
        """Return to the reference before the last acceptance; or cancel one that waits for windows."""
        learned, wanted = self._learned, self._requested
        if wanted is not None:
            self._requested = None
            yield self._notice(time, "undone", f"{wanted.cause!r} is not to be accepted any more")
            return
        if learned is None or not learned.accepted:
            yield self._notice(time, "refused", "nothing is undone: no change has been accepted")
            return
        self._learned = undo_last(self._structure, learned, self._settings)
        self._out, self._calm, self._before = [], [], None
        self._tests.forget()
        yield self._reference(self._learned, time)
        yield self._notice(time, "undone", undone_text(learned.accepted[-1].result, request))

    def _reference(self, learned: LearnedBaseline, time: int) -> ReferenceResult:
        reference = learned.model.reference if learned.model else None
        accepted = [change.result for change in learned.accepted]
        geometry = self._settings.sensor_geometry
        return reference_result(learned.modes, reference, time, learned.watched, accepted, geometry)

    def _notice(self, time: int, kind: Kind, text: str) -> AlarmResult:
        """Return a message without a change of the alarm."""
        last = max(0, self.n_windows - 1)
        return AlarmResult(time=time, state=self._alarm.state, text=text, window=last, kind=kind, quiet=True)

    def _trend(self, time: int, learned: LearnedBaseline) -> AlarmResult:
        """Return the event of a slow trend that has begun, changed or ended: the alarm's state stays as it is."""
        trend = learned.detector.trend
        notice = self._notice(time, "trend" if trend else "trend_over", trend_text(trend))
        return notice.model_copy(update={"quiet": self._settings.alarm.trend != "notify"})

    def _alarm_result(self, time: int, change: Change, text: str) -> AlarmResult:
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

    def _message(self, window: Window, text: str) -> AlarmResult:
        return AlarmResult(time=window.end, state=self._alarm.state, text=text, window=window.index)


def _calm_signals(signals: MakeSignals) -> CalmSignals | None:
    return CalmSignals.of(signals())
