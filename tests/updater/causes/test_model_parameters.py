"""A structure file with small errors everywhere, and modes of the real structure."""

from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray
from monitor.analysis.explanation import explain
from tests.examiner.cases import draw
from tests.examiner.designs import DESIGNS
from tests.examiner.path import after, answer, structure_of
from tests.support.thorough import few_of
from tests.support.updater.moved_parameters import Differenced, Moved
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import Body, Reference, build_model, diagnose, learn_reference, matched, nominal_reference, stack_tracks
from updater.causes import Cause, SelectedCause, prediction, propose_model_parameters
from updater.inference import Comparison, Fit, compare, fit, linearised
from updater.inference.sensor_errors import without_sensor_errors
from updater.structure import Structure, model_parameters_of

TRACK = np.arange(8)
OF_FILES = ("model_parameters", "support_stiffness", "joint_stiffness")
OTHERS = ("added_mass", "global_stiffness")


def _asked(structure: Structure, random: np.random.Generator) -> tuple[Reference, Comparison]:
    """Return the file as a reference, and modes that are its own."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    gain = np.ones(len(structure.channels))
    windows = stack_tracks([measure(model, random, gain) for _ in range(3)], [TRACK] * 3)
    reference = nominal_reference(structure, windows)
    return reference, compare(reference, matched(reference.baseline, reference.mean_of(windows)))


@pytest.mark.parametrize("name", ["frame", "portal", "grid", "bridge", "mast"])
def test_prediction_of_all_parameters_matches_the_extended_structure(name: str) -> None:
    """E off by 4 %, feet and joints that yield up to 0.1 L / (E I), half a weld, masses: all at once."""
    random = np.random.default_rng(951)
    reference, data = _asked(structure_of(f"{name}: "), random)
    cause = propose_model_parameters(reference, data)
    assert cause is not None
    theta = cause.prior_std * random.uniform(-0.8, 0.8, len(cause.knobs))
    theta = np.maximum(np.where(cause.lower[0] > -0.5 * cause.prior_std, np.abs(theta), theta), cause.lower[0])
    extended = cause.extend(reference.structure, 0, theta)
    exact = build_model(extended, shear_flexible=True, mass="consistent").modes(40).frequency
    found = data.frequency[data.paired] * np.exp(prediction(data, [SelectedCause(cause, 0, theta)]).log_ratio[0])
    assert np.abs(np.log(found / data.frequency[data.paired])).max() > 0.005
    assert np.abs(np.log(found[:, None] / exact)).min(1).max() < 2e-3


def test_zones_of_a_joint_are_predicted_as_the_file_has_them() -> None:
    """A through beam with a body at the joint: its moments jump there, inside the zone of the weld."""
    loaded = t_frame().with_bodies([Body(at=(0.0, 0.0, 1.48), mass=1.0, inertia=(0.01, 0.01, 0.01))])
    reference, data = _asked(loaded, np.random.default_rng(959))
    cause = propose_model_parameters(reference, data)
    assert cause is not None
    theta = np.zeros(len(cause.knobs))
    keys = [knob.key for knob in cause.knobs]
    theta[keys.index("crossbeam.weld")], theta[keys.index("crossbeam.block")] = 0.8, 2.0
    written = build_model(cause.extend(reference.structure, 0, theta), shear_flexible=True, mass="consistent")
    shift = prediction(data, [SelectedCause(cause, 0, theta)]).log_ratio[0]
    found = data.frequency[data.paired] * np.exp(shift)
    print("shifts, %:", (100 * shift).round(2))
    assert np.abs(shift).max() > 0.01
    assert np.abs(np.log(found[:, None] / written.modes(40).frequency)).min(1).max() < 3e-4


def test_members_at_one_point_share_one_bounded_weld() -> None:
    """The fitted values are the written ones, also where a fit has gone beyond the range of a weld."""
    frame = t_frame()
    column, beam = (frame.member_named(name) for name in ("column", "crossbeam"))
    prop = beam.model_copy(update={"name": "prop", "start": column.end, "end": (0.0, 0.4, column.end[2])})
    ends = {"start": column.end, "end": (0.45, 0.0, column.end[2])}
    tee = frame.model_copy(update={"member": (column, beam.model_copy(update=ends), prop), "sensor": frame.sensor[:6]})
    assert sum(knob.kind == "weld" for knob in model_parameters_of(tee)) == 1
    reference, data = _asked(structure_of("frame: "), np.random.default_rng(958))
    cause = propose_model_parameters(reference, data)
    assert cause is not None
    theta = np.zeros((2, len(cause.knobs)))
    weld = [knob.kind for knob in cause.knobs].index("weld")
    theta[:, weld] = cause.knobs[weld].upper + np.array([0.0, 0.4])
    compliance = cause.effect(theta, np.zeros(2, np.intp)).compliance
    np.testing.assert_array_equal(compliance[0], compliance[1])
    assert cause.compliance_increments(theta)[weld][1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("name", ["frame", "grid"])
def test_exact_derivatives_match_finite_differences(name: str) -> None:
    """Statically determinate, and nineteen times not.

    Of a prior deviation of each parameter: in its own unit, a bearing's flexibility has 10 000 times the effect.
    """
    reference, data = _asked(structure_of(f"{name}: "), np.random.default_rng(956))
    cause = propose_model_parameters(reference, data)
    assert cause is not None
    assert len(cause.compliance_increments(cause.start)) == sum(not knob.has_mass for knob in cause.knobs)
    (rest, exact), (same, differenced) = (linearised(data, of(**vars(cause))) for of in (Moved, Differenced))
    np.testing.assert_array_equal(rest, same)
    exact, differenced = exact * cause.prior_std, differenced * cause.prior_std
    assert np.abs(exact).max() > 1
    np.testing.assert_allclose(exact, differenced, rtol=2e-4, atol=1e-3)  # differences over a factor of e^2


@pytest.mark.parametrize(("seed", "more"), few_of([(953, OTHERS), (953, None), (955, None)]))
def test_file_errors_are_diagnosed_and_corrected(seed: int, more: tuple[str, ...] | None) -> None:
    """E and density off by per cents, a flexible foot and joint: the answer names these, and corrects the file.

    Among the errors of files and two other causes; `make thorough`: among all.
    """
    random = np.random.default_rng(952)
    truth = true_model(np.random.default_rng(seed))
    windows, others = (
        stack_tracks([measure(truth, random, np.ones(12)) for _ in range(5)], [TRACK] * 5) for _ in range(2)
    )
    reference = nominal_reference(t_frame(), windows)
    only = () if more is None else (*OF_FILES, *more)
    found = diagnose(reference, matched(reference.baseline, reference.mean_of(windows)), only=only)
    stated = {cause.cause: cause for cause in found.diagnosis.causes}
    print(found.diagnosis.verdict, sorted(stated))
    assert set(stated) <= {"model_parameters", "support_stiffness", "joint_stiffness"}
    if "model_parameters" in stated and "steel.E" in stated["model_parameters"].parameters:  # significantly off
        stiffness = stated["model_parameters"].parameters["steel.E"]
        steel, filed = truth.structure.material["steel"], t_frame().material["steel"]
        expected = steel.youngs_modulus / filed.youngs_modulus * filed.density / steel.density
        assert abs(stiffness.value / filed.youngs_modulus - expected) < 3 * stiffness.std / filed.youngs_modulus
    assert found.extended is not None
    again = nominal_reference(found.extended, others)
    event = matched(again.baseline, again.mean_of(others))
    reported = diagnose(again, event, only=OF_FILES).diagnosis
    assert reported.verdict == "nothing_to_explain"


@pytest.mark.thorough
def test_body_is_found_in_addition_to_file_errors() -> None:
    """414 g on a frame whose file is 1.5 % off in frequency without it; a body alone would be an oscillator."""
    case = draw("built frame: added_mass", 1)
    [true] = case.done.hidden
    assert true.position is not None
    found = {cause["cause"]: cause for cause in answer(case)["causes"]}
    assert set(found) == {"model_parameters", "added_mass"}
    body = found["added_mass"]
    assert np.linalg.norm(np.subtract(body["where"]["position"], true.position)) < 0.1
    assert abs(body["parameters"]["mass"]["value"] - true.parameters["mass"]) < 3 * body["parameters"]["mass"]["std"]


@pytest.mark.thorough
def test_masses_that_the_file_has_wrong_are_not_a_body() -> None:
    """A mast with walls up to 0.8 % off, a density 1 % off, housings of 0.35 to 0.63 kg: 2 kg at its top fit as well.

    No body is named, and the stated masses are within three deviations of the true ones.
    """
    case = draw("built mast: nothing", 2962373416000)
    random = np.random.default_rng((case.seed, 6))
    found = explain(structure_of(case.cell), None, after(case, random), only=("model_parameters", "added_mass"))
    diagnosis = found.diagnosis
    assert [cause.cause for cause in diagnosis.causes] == ["model_parameters"]
    stated = {change.name: change for change in diagnosis.causes[0].changes}
    nominal, true = DESIGNS["mast"], case.done.before.frame
    for name in ("low", "mid", "top"):
        own, filed = true.bar(name), next(bar for bar in nominal.bars if bar.name == name)
        area = own.density * own.area / (filed.density * filed.area)  # masses, as bodies are relative to them
        print(name, area, stated[f"{name}.A"].after, stated[f"{name}.A"].std)
        assert abs(stated[f"{name}.A"].after - area) < 3 * stated[f"{name}.A"].std
    housing = np.mean([lump.mass for lump in true.lumps[1:]])
    assert abs(stated["sensors.mass"].after - housing) < 3 * stated["sensors.mass"].std


def test_parameters_that_are_only_together_off_are_significant() -> None:
    """Two springs of which either may be as in the file, if the other one takes its part: the sum is known."""
    reference, data = _asked(structure_of("portal: "), np.random.default_rng(959))
    cause = propose_model_parameters(reference, data)
    assert cause is not None
    found: Fit[Cause] = fit(data, cause)
    n, std = len(cause.knobs), cause.prior_std
    information = np.diag(std**-2.0)
    information[:2, :2] += 400 / np.outer(std[:2], std[:2])  # of theta_0 / std_0 + theta_1 / std_1: to a twentieth
    covariance: FloatArray = np.linalg.inv(information).astype(np.float64)
    theta = np.zeros(n)
    theta[:2] = 0.2 * std[:2]
    together = replace(found, theta=theta[None], covariance=covariance[None])
    assert (np.abs(theta) < 2 * np.sqrt(np.diag(covariance))).all()
    assert cause.deviations(together) == pytest.approx(8.0, abs=0.1)  # 0.4 / (1 / 20), one degree of freedom
    assert cause.deviations(replace(together, theta=0.1 * theta[None])) < 2


def test_weight_of_the_files_shapes_is_not_that_of_correlated_noise() -> None:
    """Noise of windows that errs as one along the sensors says nothing about the errors of the file at each."""
    random = np.random.default_rng(960)
    model = build_model(t_frame(), shear_flexible=True, mass="consistent")
    windows = stack_tracks([measure(model, random, np.ones(12)) for _ in range(3)], [TRACK] * 3)
    reference = nominal_reference(t_frame(), windows)
    event = matched(reference.baseline, reference.mean_of(windows))
    plain, correlated = (
        compare(replace(reference, scatter=replace(reference.scatter, shape_overdispersion=o)), event)
        for o in (1.0, 20.0)
    )
    own = without_sensor_errors(reference, np.arange(len(reference.paired)), reference.baseline)
    noise, of_file = (float(np.mean(one.shape_std**2)) for one in (event, own))
    share = noise / (noise + of_file)
    assert correlated.overdispersion - plain.overdispersion == pytest.approx(19 * share**2)
    assert correlated.overdispersion < 1.1 * plain.overdispersion
    measured = replace(reference, of_file=False)
    kept = compare(replace(measured, scatter=replace(measured.scatter, shape_overdispersion=20.0)), event)
    assert kept.overdispersion == 20.0


@pytest.mark.parametrize("name", ["frame", "bridge", "grid"])
def test_connections_confirmed_as_rigid_are_not_reported(name: str) -> None:
    """For correct files, data state that feet, bearings and joints are rigid: no error."""
    reference, data = _asked(structure_of(f"{name}: "), np.random.default_rng(957))
    cause = propose_model_parameters(reference, data)
    assert cause is not None
    found: Fit[Cause] = fit(data, cause)
    stays = (found.theta[0] <= cause.lower[0]) & np.array([not knob.mean for knob in cause.knobs])
    known = np.sqrt(np.diag(found.covariance[0])) < 0.7 * cause.prior_std
    stated = cause.parameters(found)
    assert (stays & known).any()
    assert not {cause.knobs[k].key for k in np.flatnonzero(stays).tolist()} & set(stated)


def test_model_parameters_are_not_proposed_for_a_calibrated_reference() -> None:
    random = np.random.default_rng(954)
    bare = true_model(np.random.default_rng(955))
    reference = learn_reference(t_frame(), [measure(bare, random, np.ones(12)) for _ in range(5)], [TRACK] * 5)
    assert propose_model_parameters(reference, compare(reference, reference.baseline)) is None
