"""The deciding measurement is computed from the predictions of the hypotheses."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from monitor.text.diagnosis import next_text
from oma import ModalEstimate
from tests.support.updater.diagnosis_data import TRACK, Change, learnt
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, Structure, diagnose, learn_reference, matched, stack_tracks
from updater.causes import AddedMass, SelectedCause
from updater.diagnosis import Misfit, Separation
from updater.diagnosis.naming import misfit, named_causes
from updater.diagnosis.next_measurement import next_measurement
from updater.diagnosis.weighing import EvidenceComparison
from updater.inference import compare
from updater.structure import Sensor

AXES = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
COLUMN = tuple(c for c in t_frame().channels if c.startswith("col"))


def on_the_column(estimate: ModalEstimate) -> ModalEstimate:
    """Data of the sensors of the column alone."""
    here = [estimate.channels.index(c) for c in COLUMN]
    return replace(estimate, channels=COLUMN, shape=estimate.shape[:, here], shape_std=estimate.shape_std[:, here])


def with_sensors(structure: Structure, *more: Sensor) -> Structure:
    """Return a frame with the sensors of its column and others."""
    kept = tuple(s for s in structure.sensor if s.channel in COLUMN)
    return structure.model_copy(update={"sensor": kept + more})


def test_proposed_sensor_on_the_crossbeam_separates_left_from_right() -> None:
    """Sensors of the column alone see mirror images alike; what is named must lie on the beam that holds the mass."""
    random, bare = np.random.default_rng(501), true_model(np.random.default_rng(502))
    before = [on_the_column(measure(bare, random, np.ones(12))) for _ in range(8)]
    structure = t_frame()
    structure = with_sensors(structure)
    reference = learn_reference(structure, before, [TRACK] * 8)
    now = [on_the_column(measure(bare, random, np.ones(12))) for _ in range(5)]
    event = matched(reference.baseline, reference.mean_of(stack_tracks(now, [TRACK] * 5)))
    data = compare(reference, event)
    masses = EvidenceComparison(reference, data).causes["added_mass"]
    assert isinstance(masses, AddedMass)
    beam = [m.name for m in structure.member].index("crossbeam")
    rows = [int(np.argmin(np.abs(masses.position - at) + 10 * (masses.member != beam))) for at in (0.2, 0.6)]
    left_or_right = [(SelectedCause(masses, row, np.array([0.15, 0, 0, 0])),) for row in rows]
    equal = np.full(2, 0.5)
    reported = next_measurement(reference, event, data, masses, left_or_right, equal)
    found, known = sorted(reported.measurements, key=lambda one: one.kind, reverse=True)
    assert (found.kind, known.kind) == ("sensor", "known_mass")
    assert found.position is not None
    assert abs(found.position[0]) > 0.1
    assert found.position[1:] == pytest.approx((0.0, 1.48))
    assert found.deviations > 3
    assert reported.measurements[0] is known  # in less time
    assert found.leaves < 1.1 < 1.9 < reported.open
    assert re.match(
        r"A sensor at \(-?[\d.]+, 0.00, 1.48\) m along [yz]: "
        r"expected to separate the alternative places of the added mass by [\d.]+ standard deviations\.$",
        next_text(reported.model_copy(update={"measurements": (found,)})),
    )
    axis = found.axis
    there = Sensor(channel="there", at=(found.position[0] + 0.02, 0.0, 1.48), direction=AXES[axis])
    calibration = replace(reference.calibration, structure=with_sensors(reference.structure, there))
    reported = next_measurement(replace(reference, calibration=calibration), event, data, masses, left_or_right, equal)
    others = [m.position for m in reported.measurements if m.position and m.axis == axis]
    assert all(abs(other[0] - there.at[0]) > 0.03 for other in others), reported


@pytest.mark.thorough
def test_thermometer_tone_and_known_mass_are_proposed_for_common_factor() -> None:
    reference, _, event = learnt(503)
    reported = diagnose(reference, event(Change(stiffness=0.975))).next_measurement  # 36 K of steel
    assert isinstance(reported, Separation)
    (known,) = (one for one in reported.measurements if one.kind == "known_mass")
    assert 1.5 < known.deviations < 6  # the shifts by 4 % of the mass differ by 2.5 % of 2 %, noise is 0.02 %
    assert {one.instrument for one in reported.measurements} - {""} == {
        "A thermometer during both records",
        "A tone of known frequency in both records",
    }
    assert re.search(r"A known mass of [\d.]+ kg at .* stiffness", next_text(reported)), reported


@pytest.mark.thorough
def test_inseparable_causes_are_reported_as_inseparable() -> None:
    """A foot and a joint that both give in torsion alone."""
    reference, _, event = learnt(122)
    found = diagnose(reference, event(Change(foot={"rz": 0.2})))
    assert found.diagnosis.verdict == "ambiguous"
    assert isinstance(found.next_measurement, Separation)
    assert found.next_measurement.inseparable
    assert "None of the measurements considered separates" in next_text(found.next_measurement)


def test_explained_verdict_proposes_no_separating_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    """Open candidates of one name together with a sure cause need no separation."""
    reference, _, event = learnt(504)

    def two_open(*args: Any) -> Any:
        named, sure, left_open = named_causes(*args)
        return named, sure, [left_open[0], left_open[0]]

    monkeypatch.setattr("updater.diagnosis.explanation.named_causes", two_open)
    found = diagnose(reference, event(Change((Body(at=(0.2, 0, 1.48), mass=0.3),))), only=("added_mass",))
    assert found.diagnosis.verdict == "explained"
    advice = "Inspect this place. A sensor there, if there is none yet, would make the estimate more precise."
    assert found.next_measurement == (advice,)


def test_fitting_frequency_is_not_reported_as_outlier() -> None:
    reference, _, event = learnt(505)
    data = compare(reference, event(Change()))
    masses = EvidenceComparison(reference, data).causes["added_mass"]
    assert isinstance(masses, AddedMass)

    def reported(kg: float) -> Misfit:
        bare = replace(data, shaped=np.zeros_like(data.shaped))
        return misfit(reference, bare, [SelectedCause(masses, 5, np.array([kg, 0, 0, 0]))])

    assert (reported(0.0).frequency, reported(0.0).shape) == (None, None)
    assert "no frequency 2 standard deviations off by itself" in next_text(reported(0.0))
    far = reported(3.0).frequency
    assert far is not None
    assert far[1] > 2
    assert next_text(reported(3.0)).endswith(f"{far[1]:.0f} standard deviations off.")


@pytest.mark.parametrize("of_matrices", [True, False])
def test_poor_model_of_members_gets_no_advice_on_solids(of_matrices: bool) -> None:
    found = Misfit(causes=("added_mass",), frequency=None, shape=None, model=0.043, of_matrices=of_matrices)
    text = next_text(found)
    assert text.startswith("The calibrated model's frequencies differ from the baseline's by up to 4.3 %")
    assert ("Solids need elements" in text) == of_matrices
