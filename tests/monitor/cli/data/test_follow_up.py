"""Options `--effort` and `--follows` of `diagnose`: their texts, and what an earlier diagnosis left open."""

from pathlib import Path

import pytest

from monitor.cli.data.diagnose.arguments import effort_of
from monitor.cli.data.diagnose.follow_up import earlier_diagnosis, follow_up
from monitor.cli.output import write_json
from monitor.errors import ArgumentError
from monitor.text.diagnosis import diagnosis_answer, follow_text, plan_rows
from tests.support.updater.diagnosis_data import COLUMN, Change, MeasuredAgain
from updater import Body, DiagnosisResult
from updater.diagnosis import Measurement, Separation
from updater.modal_data import Effort

SEED = 1
BODY = Body(at=(0.25, 0.0, 1.48), mass=0.3)


@pytest.fixture(scope="module", params=[("added_mass",), pytest.param((), marks=pytest.mark.thorough)])
def site(request: pytest.FixtureRequest) -> MeasuredAgain:
    return MeasuredAgain(SEED, Change((BODY,)), COLUMN, only=request.param)


@pytest.fixture(scope="module")
def left_open(site: MeasuredAgain) -> DiagnosisResult:
    """Body left or right, which the sensors of the column see alike."""
    return site.answer()


@pytest.mark.parametrize("text", ["sensor", "sensor=-1", "sensor=inf", "ladder=2", "record=2", "sensor=two"])
def test_text_that_is_no_effort_is_refused(text: str) -> None:
    with pytest.raises(ArgumentError, match=r"^--effort: expected KIND=HOURS with one of sensor, known_mass"):
        effort_of([text])


def test_effort_is_that_of_the_options() -> None:
    assert effort_of(["known mass=3", "sensor=0.25"]) == Effort(sensor=0.25, known_mass=3.0)


def of_kind(found: DiagnosisResult, kind: str) -> Measurement:
    assert isinstance(found.next_measurement, Separation)
    return next(one for one in found.next_measurement.measurements if one.kind == kind)


@pytest.mark.parametrize("kind", ["known_mass", "sensor"])
def test_measurement_that_is_advised_decides(
    site: MeasuredAgain, left_open: DiagnosisResult, kind: str, tmp_path: Path
) -> None:
    """Two places were open, and one is left, as was expected."""
    advice = of_kind(left_open, kind)
    assert advice.position
    write_json(tmp_path / "first.json", diagnosis_answer(left_open).model_dump(mode="json"))
    earlier = earlier_diagnosis(tmp_path / "first.json")
    assert earlier
    at = advice.position
    now = site.with_mass(at, advice.mass) if kind == "known_mass" else site.with_sensor(at, advice.axis)
    found = follow_up(earlier, diagnosis_answer(now), kind)
    assert found
    assert found.expected == advice.leaves < 1.3
    assert found.now < 1.7 < found.before
    assert follow_text(found).startswith(f"The earlier diagnosis left {found.before:.1f} causes open; ")


def test_rows_of_the_plan_are_in_the_order_of_information_per_hour(left_open: DiagnosisResult) -> None:
    separation = left_open.next_measurement
    assert isinstance(separation, Separation)
    gained = [m.information_per_hour for m in separation.measurements]
    assert gained == sorted(gained, reverse=True)
    rows = plan_rows(separation)
    assert [left for _, left, _ in rows] == [
        f"{m.leaves:.1f} of {separation.open:.1f}" for m in separation.measurements
    ]


def test_diagnosis_that_left_nothing_open_cannot_be_followed(left_open: DiagnosisResult, tmp_path: Path) -> None:
    path = tmp_path / "first.json"
    with pytest.raises(ArgumentError, match=r"^--follows: .*first.json.*cannot be read"):
        earlier_diagnosis(path)
    write_json(path, diagnosis_answer(left_open).model_copy(update={"separation": None}).model_dump(mode="json"))
    with pytest.raises(ArgumentError, match=r"^--follows: .*first.json: no causes were left open \(ambiguous\)"):
        earlier_diagnosis(path)
    path.write_text("{}")
    with pytest.raises(ArgumentError, match=r"^--follows: .*first.json.*is no diagnosis"):
        earlier_diagnosis(path)
