"""The alarm as a state machine: every transition, and results that no sequence may have."""

from dataclasses import replace

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from monitor.detection.alarm import Alarm, AlarmRules, Change, Condition

MINUTE = 60 * 10**9
OVER, BETWEEN, CALM, UNKNOWN = 1.5, 0.9, 0.2, float("nan")
RULES = AlarmRules(
    hold_windows=2,
    clear_windows=3,
    clear_below=0.8,
    cooldown=60 * MINUTE,
    flapping_changes=4,
    flapping_span=999 * MINUTE,
)
LATCHING = replace(RULES, latched=True)


def play(rules: AlarmRules, levels: list[float | str], step: int = 10 * MINUTE) -> tuple[Alarm, list[Change]]:
    """Return the alarm after windows of these levels, one every `step`, and acknowledgements ("ack")."""
    alarm = Alarm(rules=rules)
    reported: list[Change] = []
    for i, level in enumerate(levels, 1):
        alarm, changes = alarm.acknowledge(i * step) if isinstance(level, str) else alarm.evaluate(i * step, level)
        reported += changes
    return alarm, reported


RAISED: list[float | str] = [OVER, OVER]
LATCHED: list[float | str] = [*RAISED, CALM, CALM, CALM]


@pytest.mark.parametrize(
    ("rules", "levels", "condition", "run"),
    [
        (RULES, [], "normal", 0),
        (RULES, [CALM], "normal", 0),
        (RULES, [BETWEEN], "normal", 0),
        (RULES, [UNKNOWN], "normal", 0),
        (RULES, ["ack"], "normal", 0),
        (RULES, [OVER], "watch", 1),
        (RULES, [OVER, "ack"], "watch", 1),
        (RULES, [OVER, CALM], "normal", 0),
        (RULES, [OVER, BETWEEN], "watch", 0),
        (RULES, [OVER, UNKNOWN], "watch", 0),
        (RULES, [OVER, BETWEEN, OVER], "watch", 1),
        (RULES, [OVER, BETWEEN, CALM], "normal", 0),
        (RULES, RAISED, "alarm", 0),
        (RULES, [OVER, BETWEEN, OVER, OVER], "alarm", 0),
        (RULES, [*RAISED, OVER], "alarm", 0),
        (RULES, [*RAISED, CALM, CALM], "alarm", 2),
        (RULES, [*RAISED, CALM, CALM, BETWEEN], "alarm", 0),
        (RULES, [*RAISED, CALM, CALM, UNKNOWN], "alarm", 0),
        (RULES, [*RAISED, CALM, CALM, OVER, CALM], "alarm", 1),
        (RULES, [*RAISED, CALM, CALM, CALM], "normal", 0),
        (RULES, [*RAISED, "ack"], "acknowledged", 0),
        (RULES, [*RAISED, CALM, "ack", CALM], "acknowledged", 2),
        (RULES, [*RAISED, "ack", "ack"], "acknowledged", 0),
        (RULES, [*RAISED, "ack", CALM, CALM, BETWEEN], "acknowledged", 0),
        (RULES, [*RAISED, "ack", CALM, CALM, CALM], "normal", 0),
        (LATCHING, [*RAISED, "ack", CALM, CALM, CALM], "normal", 0),
        (LATCHING, LATCHED, "latched", 0),
        (LATCHING, [*LATCHED, CALM, BETWEEN, UNKNOWN], "latched", 0),
        (LATCHING, [*LATCHED, OVER], "latched", 1),
        (LATCHING, [*LATCHED, OVER, BETWEEN], "latched", 0),
        (LATCHING, [*LATCHED, OVER, OVER], "alarm", 0),
        (LATCHING, [*LATCHED, "ack"], "normal", 0),
        (replace(RULES, hold_windows=1), [OVER], "alarm", 0),
        (replace(RULES, clear_windows=1), [*RAISED, CALM], "normal", 0),
    ],
)
def test_every_state_transition(rules: AlarmRules, levels: list[float | str], condition: Condition, run: int) -> None:
    alarm, _ = play(rules, levels)
    assert (alarm.condition, alarm.run) == (condition, run)


@pytest.mark.parametrize(
    ("rules", "levels", "reported"),
    [
        (RULES, [OVER, CALM], [("state", "watch"), ("state", "normal")]),
        (RULES, [OVER, BETWEEN, BETWEEN], [("state", "watch")]),
        (RULES, [*RAISED, OVER, CALM], [("state", "watch"), ("state", "alarm")]),
        (RULES, [*RAISED, "ack", "ack"], [("state", "watch"), ("state", "alarm"), ("acknowledged", "alarm")]),
        (LATCHING, LATCHED, [("state", "watch"), ("state", "alarm"), ("latched", "alarm")]),
        (
            LATCHING,
            [*LATCHED, OVER, OVER],
            [("state", "watch"), ("state", "alarm"), ("latched", "alarm"), ("reopened", "alarm")],
        ),
        (
            LATCHING,
            [*LATCHED, "ack"],
            [("state", "watch"), ("state", "alarm"), ("latched", "alarm"), ("state", "normal")],
        ),
    ],
)
def test_reported_changes(rules: AlarmRules, levels: list[float | str], reported: list[tuple[str, str]]) -> None:
    assert [(change.kind, change.state) for change in play(rules, levels)[1]] == reported


def test_end_of_an_alarm_states_its_duration() -> None:
    """Raised by the second window, cleared by the fifth: three steps later."""
    _, reported = play(RULES, [*RAISED, CALM, CALM, CALM])
    assert reported[-1] == Change(kind="state", state="normal", lasted=30 * MINUTE)


def test_alarm_raised_again_within_the_cooldown_continues() -> None:
    """It ends at 50 min; raised at 70 min it continues from its beginning, without a notice; at 120 min it is new."""
    soon, reported = play(RULES, [*RAISED, CALM, CALM, CALM, OVER, OVER])
    assert (reported[-1], soon.raised) == (Change(kind="reopened", state="alarm", quiet=True), 20 * MINUTE)
    late, reported = play(RULES, [*RAISED, *(8 * [CALM]), OVER, OVER])
    assert (reported[-1], late.raised) == (Change(kind="state", state="alarm"), 120 * MINUTE)


def test_flapping_is_reported_once_and_mutes_later_changes() -> None:
    """Two alarms that come and go are four changes."""
    cycle: list[float | str] = [OVER, OVER, CALM, CALM, CALM]
    rules = replace(RULES, cooldown=0)
    alarm, reported = play(rules, 3 * cycle)
    assert [change.kind for change in reported].count("flapping") == 1
    assert alarm.flapping
    assert [c.quiet for c in reported if c.kind == "state" and c.state != "watch"] == [
        False,
        False,
        False,
        False,
        True,
        True,
    ]
    steady, changes = alarm.evaluate(150 * MINUTE + rules.flapping_span, CALM)
    assert not steady.flapping
    assert changes == (Change(kind="steady", state="normal"),)


@pytest.mark.parametrize(
    ("field", "value"),
    [("hold_windows", 0), ("clear_windows", 0), ("flapping_changes", 0), ("clear_below", 0.0), ("clear_below", 1.1)],
)
def test_invalid_rules_are_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{field}: expected"):
        AlarmRules(**{field: value})  # type: ignore[arg-type]


def test_default_rules() -> None:
    """A window at the limit is neither over nor calm; an alarm at the very end of another is a new one."""
    alarm, _ = play(AlarmRules(), [OVER, 1.0])
    assert alarm.condition == "watch"
    assert play(AlarmRules(), [OVER, 0.999])[0].condition == "normal"
    alarm, reported = play(AlarmRules(), [*RAISED, CALM, CALM, OVER, OVER], step=0)
    assert (reported[-1], alarm.raised) == (Change(kind="state", state="alarm"), 0)
    assert AlarmRules() == AlarmRules(
        hold_windows=2, clear_windows=2, latched=False, flapping_changes=6, flapping_span=0
    )


def test_window_at_the_clearing_level_is_not_calm() -> None:
    assert play(RULES, [OVER, 0.8])[0].condition == "watch"
    assert play(RULES, [*RAISED, 0.8, 0.8, 0.8])[0].condition == "alarm"


def test_alarm_at_the_end_of_the_cooldown_is_new() -> None:
    """It ends at 50 min, the cooldown of 60 min at 110."""
    at, reported = play(RULES, [*RAISED, CALM, CALM, CALM, *(4 * [CALM]), OVER, OVER])
    assert (reported[-1], at.raised) == (Change(kind="state", state="alarm"), 110 * MINUTE)


def test_alarm_reopened_while_latched_is_quiet() -> None:
    alarm, reported = play(LATCHING, [*LATCHED, OVER, OVER])
    assert reported[-1] == Change(kind="reopened", state="alarm", quiet=True)
    assert (alarm.run, alarm.raised) == (0, 20 * MINUTE)


class AnySequence(RuleBasedStateMachine):
    """An alarm compared with its definition by the whole past, through any windows and acknowledgements."""

    def __init__(self) -> None:
        super().__init__()
        self.alarm = Alarm(rules=LATCHING)
        self.now = 0
        self.levels: list[float] = []

    @rule(level=st.sampled_from([OVER, BETWEEN, CALM, UNKNOWN]), step=st.integers(1, 100))
    def window(self, level: float, step: int) -> None:
        self.now += step * MINUTE
        self.levels.append(level)
        before = self.alarm
        self.alarm, changes = before.evaluate(self.now, level)
        if before.condition != "alarm" and self.alarm.condition == "alarm":
            assert self.levels[-2:] == 2 * [OVER]
        if before.state == "alarm" and self.alarm.condition in ("latched", "normal") and before.condition != "latched":
            assert self.levels[-3:] == 3 * [CALM]
        if before.state == "alarm" and self.alarm.state == "normal":
            assert before.condition == "acknowledged"  # a latching alarm never ends by itself
        reported = [change for change in changes if change.kind not in ("flapping", "steady")]
        assert len(reported) == (before.condition != self.alarm.condition)

    @rule()
    def acknowledge(self) -> None:
        before = self.alarm
        self.alarm, changes = before.acknowledge(self.now)
        after = {"alarm": "acknowledged", "latched": "normal"}.get(before.condition, before.condition)
        assert self.alarm.condition == after
        assert bool(changes) == (after != before.condition)

    @precondition(lambda self: self.alarm.state == "alarm")
    @rule()
    def always_a_way_out(self) -> None:
        """Whatever happened, a person and calm windows end it."""
        alarm, _ = self.alarm.acknowledge(self.now)
        for i in range(1, LATCHING.clear_windows + 1):
            alarm, _ = alarm.evaluate(self.now + i * MINUTE, CALM)
        assert alarm.condition == "normal"

    @invariant()
    def counts_stay_below_their_limits(self) -> None:
        limit = {"alarm": 3, "acknowledged": 3}.get(self.alarm.condition, 2)
        assert 0 <= self.alarm.run < limit
        if self.alarm.state == "alarm":
            assert self.alarm.raised is not None
        assert all(self.now - flip < LATCHING.flapping_span for flip in self.alarm.flips)


TestAnySequence = AnySequence.TestCase
TestAnySequence.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)


def test_clock_set_back_does_not_mute_alarms() -> None:
    """A host without a battery may restart with a date years ago: an alarm does not continue or flap then."""
    alarm = Alarm(rules=RULES)
    for minute in range(1000, 1000 + 10 * 15, 10):
        alarm, _ = alarm.evaluate(minute * MINUTE, [OVER, OVER, CALM, CALM, CALM][minute // 10 % 5])
    assert alarm.flapping
    for minute, stated in ((10, ["steady"]), (20, ["state"])):
        alarm, changes = alarm.evaluate(minute * MINUTE, OVER)
        assert [(c.kind, c.quiet) for c in changes if c.state != "watch" or c.kind != "state"] == [
            (k, False) for k in stated
        ]
    assert (alarm.condition, alarm.raised) == ("alarm", 20 * MINUTE)


def test_alarm_ending_before_its_start_has_zero_duration() -> None:
    alarm, _ = play(RULES, RAISED)
    for minute in (3, 2, 1):
        alarm, changes = alarm.evaluate(minute * MINUTE, CALM)
    assert [change.lasted for change in changes] == [0]
