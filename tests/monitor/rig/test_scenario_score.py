"""Score of a shipped scenario: each cause of the last diagnosis belongs to one event."""

import numpy as np
import pytest

from monitor.cli.demo.course_score import score_course
from monitor.cli.demo.scenario_score import score_events
from monitor.results.comparison import ChangeRate, WithinRecord
from monitor.results.windows import Result
from monitor.rig import load_scenario, shipped_scenarios
from tests.support.monitor import answers
from tests.support.monitor import results as made
from updater import Cause, parse_structure, t_structure_toml
from updater.quantities import Breathing, Opening, Opens, Quantity, Where

SITE = made.Site()
STRUCTURE = parse_structure(t_structure_toml())


def mass(x: float, z: float, value: float) -> Cause:
    """Return an added mass with a deviation of 10 g and 1 cm."""
    where = Where(member="column", position=(x, 0.0, z), position_std=0.01)
    parameters = {"mass": Quantity(value=value, std=0.01, unit="kg")}
    return Cause(cause="added_mass", probability=0.9, where=where, parameters=parameters)


def loss(z: float, p_value: float) -> Cause:
    """Return a crack of the column that closes to 90 %."""
    share = Quantity(value=0.9, std=0.1, unit="-")
    return Cause(
        cause="local_stiffness",
        probability=0.9,
        where=Where(member="column", position=(0.0, 0.0, z), position_std=0.01),
        parameters={},
        breathing=Breathing(share=share, open_time=None, p_value=p_value),
    )


def play(flexibility: float = 0.0148, opens: Opens = "within", *, stated: bool = True) -> Cause:
    """Return play in the foot of the column, with deviations of 1 mm and 1 mN m."""

    def found(value: float, unit: str) -> Quantity:
        return Quantity(value=value, std=1e-3, unit=unit)

    opening = Opening(
        member="column",
        position=(0.0, 0.0, 0.0),
        axis="y",
        flexibility=found(flexibility, "m"),
        closed=found(1e-3, "m"),
        mean=found(0.01, "m"),
        moment=found(5.8e-3, "N m"),
        opens=opens,
    )
    share = Quantity(value=0.9, std=0.05, unit="-")
    breathing = Breathing(share=share, open_time=share, p_value=1e-9, opening=opening if stated else None)
    return Cause(
        cause="support_stiffness",
        probability=0.9,
        where=Where(name="foot of the column", position=(0.0, 0.0, 0.0)),
        parameters={},
        breathing=breathing,
    )


def right(name: str, *causes: Cause) -> list[bool]:
    """Return whether each event, and each cause without one, is right."""
    window = SITE.window(0, "alarm", np.zeros(SITE.n_modes))
    answer = answers.diagnosis().model_copy(update={"causes": causes})
    found: list[Result] = [window.model_copy(update={"diagnosis": answer})] if causes else [window]
    return [one.right for one in score_events(STRUCTURE, load_scenario(shipped_scenarios()[name]).event, found)]


@pytest.mark.parametrize(
    ("name", "causes", "expected"),
    [
        ("two-bodies", (mass(0.0, 0.86, 0.17), mass(0.22, 1.48, 0.26)), [True, True]),
        ("two-bodies", (mass(0.22, 1.48, 0.26),), [True, False]),
        ("two-bodies", (mass(0.0, 0.86, 0.30), mass(0.22, 1.48, 0.26)), [True, False]),
        ("added-mass", (mass(0.22, 1.48, 0.26), mass(0.0, 0.86, 0.17)), [True, False]),
        ("added-mass", (), [False]),
        ("breathing-crack", (loss(0.32, 1e-9),), [True]),
        ("breathing-crack", (loss(0.32, 0.2),), [False]),
        ("breathing-crack", (loss(0.6, 1e-9),), [False]),
        ("play-in-foot", (play(),), [True]),
        ("play-in-foot", (play(flexibility=0.0185),), [False]),
        ("play-in-foot", (play(opens="beyond"),), [False]),
        ("play-in-foot", (play(stated=False),), [False]),
        ("quiet", (), [True]),
    ],
)
def test_causes_are_compared_with_the_events(name: str, causes: tuple[Cause, ...], expected: list[bool]) -> None:
    assert right(name, *causes) == expected


def test_alarm_without_an_event_is_wrong() -> None:
    window = SITE.window(0, "watching", np.zeros(SITE.n_modes))
    raised = made.alarm(window, "alarm", "ALARM")
    assert [one.right for one in score_events(STRUCTURE, (), [window, raised])] == [False]


RATE = 0.4 / 960 * 3600  # kg/h of the scenario


def course(per_hour: float, std: float = 0.02, x: float = 0.22) -> WithinRecord:
    """Return a gradual change by one body on the crossbeam."""
    rate = ChangeRate(cause="added_mass", parameter="mass", per_hour=per_hour, std=std, unit="kg")
    return WithinRecord(
        kind="gradual",
        start=0,
        end=640 * 10**9,
        of_all=False,
        verdict="explained",
        causes=(mass(x, 1.48, 0.27),),
        rates=(rate,),
        step=None,
        course=(),
        p_value=1e-9,
    )


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (course(RATE), True),
        (course(1.1 * RATE), True),
        (course(1.3 * RATE), False),
        (course(1.3 * RATE, std=0.2), True),
        (course(RATE, x=-0.22), False),
        (course(RATE).model_copy(update={"causes": ()}), False),
        (course(RATE).model_copy(update={"kind": "sudden", "rates": ()}), False),
        (None, False),
    ],
)
def test_course_is_compared_with_a_gradual_event(found: WithinRecord | None, *, expected: bool) -> None:
    (event,) = load_scenario(shipped_scenarios()["filling-tank"]).event
    assert score_course(event, found).right is expected
