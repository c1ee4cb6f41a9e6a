"""Causes of zero size are not accepted, and one stretch is not reported as two."""

from dataclasses import replace

import numpy as np
import pytest

from monitor.analysis.explanation import explain
from monitor.results.comparison import DiagnosisAnswer
from tests.examiner.cases import N_AFTER, N_BEFORE, draw, specimen
from tests.examiner.models.bar import Zone
from tests.examiner.models.specimen import State
from tests.examiner.path import answer, observation, structure_of, weighing_of
from tests.examiner.signals import estimated
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame
from updater import Body, Reference, build_model, matched, nominal_reference, stack_tracks
from updater.causes import AddedMass, Cause, LocalStiffness, SelectedCause
from updater.causes.stiffness.local_stiffness import LENGTHS, propose_local_stiffness
from updater.causes.stretches import everywhere
from updater.diagnosis import explanation
from updater.diagnosis.case import Case
from updater.diagnosis.combinations import Compositions
from updater.diagnosis.search import fits, with_open_places
from updater.diagnosis.simplification import is_significant, merged, only_needed, significant_only
from updater.diagnosis.weighing import Candidate, EvidenceComparison
from updater.inference import Comparison, Fit, compare

#: causes that such a loss could be taken for
STIFFNESS = (
    "local_stiffness",
    "global_stiffness",
    "support_stiffness",
    "joint_stiffness",
    "added_mass",
    "distributed_mass",
)


def softened(state: State, bar: str, left: float, share: tuple[float, float] = (0.0, 1.0)) -> State:
    """Return a state with that share of a bar's stiffness left, from one share of its length to another."""
    one = state.frame.bar(bar)
    start, end = np.multiply(share, one.length).tolist()
    zone = Zone(start=start, end=end, bend1=left, bend2=left, twist=left)
    return state.of_frame(state.frame.with_bar(bar, zones=(*one.zones, zone)))


def diagnosed(which: str, before: State, after: State, seed: int) -> DiagnosisAnswer:
    random = np.random.default_rng((seed, 6))
    reference = observation(before, estimated(before, N_BEFORE, random, noise="law"))
    now, heldout = (
        observation(after, [estimated(after, 1, random, first=w, noise="law")[0] for w in range(N_AFTER)])
        for _ in range(2)
    )
    return explain(structure_of(f"{which}: "), reference, now, heldout, only=STIFFNESS).diagnosis


@pytest.mark.parametrize(
    ("which", "bar", "seed"), few_of([("frame", "column", 11), ("portal", "left", 5), ("bridge", "girder", 5)])
)
def test_stiffness_loss_over_a_whole_member_is_one_stretch(which: str, bar: str, seed: int) -> None:
    """16 % of a column, a post, a girder; it was two touching stretches, or a factor on all stiffness."""
    print(f"seed {seed}")
    state, _ = specimen(which.removeprefix("frame"), seed)
    length = state.frame.bar(bar).length
    found = diagnosed(which, state, softened(state, bar, 0.84), seed)
    (cause,) = found.causes
    assert (cause.cause, cause.where and cause.where.member) == ("local_stiffness", bar)
    assert abs(cause.parameters["loss"].value - 0.16) < 4 * cause.parameters["loss"].std
    assert cause.parameters["extent"].value == pytest.approx(length, rel=0.05)
    gain = found.gain
    assert gain is not None
    assert gain.change_error_percent is not None
    assert gain.change_error_percent.after is not None
    assert gain.change_error_percent.after < 0.06


def halves_at_most(reference: Reference, comparison: Comparison) -> LocalStiffness | None:
    """Return stretches of no more than half the longest member."""
    cause = propose_local_stiffness(reference, comparison)
    assert cause is not None
    return replace(cause, kinds=LENGTHS, **everywhere(cause.cells, LENGTHS, 4))


@pytest.mark.thorough
def test_adjacent_stretches_of_equal_loss_are_merged() -> None:
    state, _ = specimen("", 12)
    weighing = replace(
        weighing_of(state, softened(state, "column", 0.8, (0.1, 0.9)), 12), instead={"local_stiffness": halves_at_most}
    )
    cause = weighing.causes["local_stiffness"]
    two = Compositions(weighing).coordinate_fit((SelectedCause.begun(cause), SelectedCause.begun(cause)))
    assert two is not None
    one = merged(weighing, two)
    print([(part.hypotheses.where(part), part.hypotheses.parameters(part)) for part in (*two.parts, *one.parts)])
    assert one.log_evidence > two.log_evidence
    (part,) = one.parts
    found = part.hypotheses.parameters(part)
    assert abs(found["loss"].value - 0.2) < 4 * found["loss"].std
    assert abs(found["extent"].value - 0.8 * 1.48) < 4 * found["extent"].std
    elsewhere = replace(two, parts=two.parts[:1], chosen=two.chosen[:1])
    assert merged(weighing, elsewhere) is elsewhere


@pytest.mark.thorough
def test_zero_size_model_parameters_are_rejected_with_a_mass() -> None:
    """The file is right and a body is on the structure; significance of parameters, in five draws."""
    structure, track = t_frame(), np.arange(8)
    heavier = structure.with_bodies([Body(at=(0.25, 0.0, 1.48), mass=0.3)])
    zero = 0
    for seed in range(5):
        random = np.random.default_rng((961, seed))
        model = build_model(heavier, shear_flexible=True, mass="consistent")
        windows = stack_tracks(
            [measure(model, random, np.ones(len(structure.channels))) for _ in range(3)], [track] * 3
        )
        reference = nominal_reference(structure, windows)
        data = compare(reference, matched(reference.baseline, reference.mean_of(windows)))
        weighing = EvidenceComparison(reference, data, allowed=(names := ("model_parameters", "added_mass")))
        two = Compositions(weighing).coordinate_fit(tuple(SelectedCause.begun(weighing.causes[n]) for n in names))
        assert two is not None
        parameters = two.parts[two.names.index("model_parameters")]
        found = significant_only(weighing, [two])
        print(seed, parameters.hypotheses.parameters(parameters), [c.names for c in found])
        if not is_significant(parameters):
            zero += 1
            assert [c.names for c in found] == [("added_mass",)]
    assert zero >= 3


@pytest.mark.parametrize("name", few_of(["support_stiffness", "local_stiffness"]))
def test_zero_size_springs_and_stretches_are_rejected_with_a_mass(name: str) -> None:
    """A cause that the data do not need is insignificant, and a needed one is significant."""
    state, do = specimen("", 21)
    done = do["added_mass"](state, np.random.default_rng(3))
    weighing = weighing_of(done.before, done.after, 21)
    two = Compositions(weighing).coordinate_fit(
        tuple(SelectedCause.begun(weighing.causes[n]) for n in (name, "added_mass"))
    )
    assert two is not None
    print({n: part.hypotheses.parameters(part) for n, part in zip(two.names, two.parts, strict=True)})
    significant = dict(zip(two.names, map(is_significant, two.parts), strict=True))
    assert significant == {"added_mass": True, name: False}
    assert [c.names for c in significant_only(weighing, [two])] == [("added_mass",)]


def test_zero_size_body_is_rejected_with_a_loose_foot() -> None:
    state, do = specimen("", 23)
    done = do["support_stiffness"](state, np.random.default_rng(3))
    weighing = weighing_of(done.before, done.after, 23)
    names = ("added_mass", "support_stiffness")
    two = Compositions(weighing).coordinate_fit(tuple(SelectedCause.begun(weighing.causes[n]) for n in names))
    assert two is not None
    significant = dict(zip(two.names, map(is_significant, two.parts), strict=True))
    assert significant == {"added_mass": False, "support_stiffness": True}
    assert [c.names for c in significant_only(weighing, [two])] == [("support_stiffness",)]
    body = two.parts[two.names.index("added_mass")]
    theta, covariance = body.theta.copy(), body.covariance.copy()
    theta[body.best, 0] = 0.3
    std, correlation = np.array([0.2, 0.02, 0.02, 0.001]), np.eye(4)
    correlation[0, 1] = correlation[1, 0] = 0.8
    covariance[body.best] = correlation * np.outer(std, std)
    needed = replace(body, theta=theta, covariance=covariance)  # its mass trades with its offset
    assert isinstance(needed.hypotheses, AddedMass)
    assert needed.hypotheses.deviations(needed) == pytest.approx(0.3 / (0.2 * 0.6))  # sqrt(1 - 0.8^2) is left


@pytest.mark.thorough
def test_body_without_significance_once_places_are_open_is_not_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loose foot alone does not fit: nothing is named."""
    only = ("added_mass", "support_stiffness")
    case = draw("added_mass + support_stiffness", 7)
    assert sorted(cause["cause"] for cause in answer(case, only=only)["causes"]) == sorted(only)

    def vague(part: Fit[Cause]) -> Fit[Cause]:
        return replace(part, covariance=1e4 * part.covariance) if isinstance(part.hypotheses, AddedMass) else part

    def opened(case: Case, found: list[Candidate]) -> list[Candidate]:
        return [replace(c, parts=tuple(map(vague, c.parts))) for c in with_open_places(case, found)]

    monkeypatch.setattr(explanation, "with_open_places", opened)
    assert answer(case, only=only)["verdict"] == "unexplained"


def test_third_cause_that_was_needed_next_to_another_one_is_left_out() -> None:
    """A gain was needed next to a distributed mass and a loss, and remained where a body replaced that mass."""
    state, do = specimen("", 21)
    heavier = do["added_mass"](state, np.random.default_rng(3)).after
    weighing = weighing_of(state, softened(heavier, "crossbeam", 0.5, (0.2, 0.3)), 21)
    names = ("sensor_gain", "local_stiffness", "added_mass")
    three = Compositions(weighing).coordinate_fit(tuple(SelectedCause.begun(weighing.causes[n]) for n in names))
    assert three is not None
    needed = only_needed(weighing, three, fits)
    print([(part.hypotheses.name, part.hypotheses.parameters(part)) for part in (*three.parts, *needed.parts)])
    assert sorted(needed.names) == ["added_mass", "local_stiffness"]
    assert needed.log_evidence > three.log_evidence
    assert only_needed(weighing, needed, fits) is needed
    assert only_needed(weighing, three, lambda _: False) is three
