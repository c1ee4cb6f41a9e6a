"""Predictions for a rig before any measurement, compared with closed forms, simulated errors and the estimator."""

import itertools
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom, chi2

from daq import FloatArray
from tests.support.updater.frames import beam, clamped, t_frame
from tests.support.updater.planned_records import TrueRig, away
from updater import Body, ModelError, Record, Structure, build_model, parse_structure, study_detectability
from updater.inference import SHAPE_BIAS, PositionPosterior, likeliest_place
from updater.planning import (
    DetectabilityStudy,
    LocalizationSimulation,
    Target,
    backward_elimination,
    best_additional_sensor,
    mean_position_std,
    seen_by,
)
from updater.structure import Sensor

MINUTE = Record(seconds=60.0)


@cache
def t_outlook() -> DetectabilityStudy:
    return study_detectability(t_frame(), MINUTE)


def steel_beam() -> Structure:
    """Return a cantilever of 1 m, E I / (rho A L^4) = 1e4 / s2, with a sensor at half of it and at the tip."""
    plain = beam(
        length=1.0,
        elements=40,
        support=clamped(),
        modulus=1e12,
        shear_modulus=4e11,
        density=1.0,
        area=1.0,
        second_moment=(1e-8, 4e-8),
        torsion_constant=1e-3,
    )
    ways = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    sensors = [Sensor(channel=f"{x}{way}", at=(x, 0, 0), direction=way) for x in (0.5, 1.0) for way in ways]
    return plain.model_copy(update={"sensor": tuple(sensors)})


def test_shape_error_along_another_mode_matches_the_leakage_formula() -> None:
    """Two modes forced alike: the part of the second in the estimate of the first, by least squares in its band.

    400 windows estimate a standard deviation to 3.5 %; a band of sixteen half widths leaves out 8 % of the power,
    glimpses that scatter themselves and leakage add 4 %: 6 % more in all.
    """
    random, rate, seconds, damping = np.random.default_rng(8), 50.0, 240.0, 0.005
    frequency = np.array([8.0, 10.0])
    n, windows = round(rate * seconds), 400
    response = [_oscillator(f, damping, rate, random.standard_normal(n * windows)) for f in frequency]
    spectra = [np.fft.rfft(x.reshape(windows, n), axis=1) for x in response]
    band = np.abs(np.fft.rfftfreq(n, 1 / rate) - frequency[0]) < 8 * damping * frequency[0]
    own, other = (s[:, band] for s in spectra)
    share = np.real((own.conj() * other).sum(1)) / (np.abs(own) ** 2).sum(1)
    leak = Record(seconds=seconds, damping=damping).leaks(frequency, np.array([0]))
    assert leak[0, 0] == 0
    assert np.std(share) == pytest.approx(1.06 * leak[0, 1], rel=0.1)


def _oscillator(frequency: float, damping: float, rate: float, force: FloatArray) -> FloatArray:
    """Return the displacement of an oscillator under forces held between samples."""
    omega = 2 * np.pi * frequency
    pole = np.exp((-damping + 1j * np.sqrt(1 - damping**2)) * omega / rate)
    return np.asarray(lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], force))


def test_errors_fall_with_the_square_root_of_record_length() -> None:
    long, frequency = Record(seconds=6000.0), np.array([10.0, 10.3, 40.0])
    measured = np.arange(3)
    np.testing.assert_allclose(MINUTE.log_frequency_std(frequency), 10 * long.log_frequency_std(frequency))
    np.testing.assert_allclose(MINUTE.leaks(frequency, measured), 10 * long.leaks(frequency, measured))
    np.testing.assert_allclose(MINUTE.blur(frequency), 10 * long.blur(frequency))


def test_smallest_detectable_tip_mass_raises_alarm_in_95_per_cent() -> None:
    """All bending modes of a uniform cantilever move its tip by 2 / sqrt(M): each frequency falls by 2 m / M.

    Shear and rotary inertia change that by under 1 % here. 4000 events estimate 95 % to 1.2 % (three deviations).
    """
    record = Record(seconds=600.0)
    outlook = study_detectability(steel_beam(), record)
    tip = int(np.argmax(outlook.point[:, 0]))
    mass = outlook.weakest_mass()[tip]
    n, total = len(outlook.frequency), 1.0
    std = np.sqrt(2) * record.log_frequency_std(outlook.frequency)
    random = np.random.default_rng(2)
    z = (-2 * mass / total + std * random.standard_normal((4000, n))) / std
    alarms = ((z**2).sum(1) > chi2.isf(record.false_alarm_probability, n)).mean()
    assert alarms == pytest.approx(0.95, abs=0.015)
    assert outlook.weakest_mass()[0] == np.inf  # the clamp does not move


def test_longer_record_detects_smaller_masses_and_locates_better() -> None:
    """16 x the time: 4 x less noise; fewer records per year have a lower limit, priors and biases stay."""
    short, long = t_outlook(), t_outlook().lasting(960.0)
    ratio = short.weakest_mass()[20:] / long.weakest_mass()[20:]
    assert (ratio > 3.5).all()
    assert (ratio < 5).all()
    sharper = short.bound(0.05)[0][40:] / long.bound(0.05)[0][40:]
    assert (sharper > 1.2).all()
    assert (sharper < 4.01).all()


@pytest.mark.thorough
def test_simulated_localization_accuracy_holds_for_a_different_frame() -> None:
    """50 g at 0.20 m on the beam, a minute before and after."""
    foresight = LocalizationSimulation(t_outlook(), Target(mass=0.05))
    away_from = np.linalg.norm(t_outlook().point[foresight.places] - (0.2, 0, 1.48), axis=1)
    assert foresight.chance(60.0, foresight.places[[np.argmin(away_from)]])[0] > 0.95
    rig, body = TrueRig(seed=31, record=MINUTE), Body(at=(0.2, 0, 1.48), mass=0.05)
    reference = rig.reference()
    near = [away(rig.located(reference, body, draw), body) <= 0.05 for draw in range(10, 13)]
    assert sum(near) >= binom.ppf(0.005, 3, 0.95)


def test_sensors_on_symmetry_axis_do_not_distinguish_left_from_right() -> None:
    """The T is symmetric: its modes at the column are the same for a body on either arm."""
    plain = t_frame()
    column = tuple(s for s in plain.sensor if s.at[0] == 0 and s.at[2] < 1.4)
    outlook = study_detectability(plain.model_copy(update={"sensor": column}), MINUTE)
    right = int(np.argmin(np.linalg.norm(outlook.point - (0.3, 0, 1.48), axis=1)))
    # every other answer of 200 is on the wrong arm, to three binomial deviations
    assert LocalizationSimulation(outlook, Target(mass=0.1)).chance(600.0, np.array([right]))[0] == pytest.approx(
        0.5, abs=0.11
    )
    assert LocalizationSimulation(t_outlook(), Target(mass=0.1)).chance(600.0, np.array([right]))[0] > 0.99


def test_required_record_length_gives_the_requested_probability() -> None:
    target = Target(mass=0.02)
    foresight = LocalizationSimulation(t_outlook(), target)
    place = foresight.places[[33]]
    seconds = float(foresight.seconds_needed(place)[0])
    assert foresight.records[0] < seconds < foresight.records[-1]
    # interpolated between records of which one is twice the other; the chance climbs by up to 0.5 between them
    assert foresight.chance(seconds, place)[0] == pytest.approx(0.95, abs=0.15)
    assert foresight.chance(2 * seconds, place)[0] > 0.95
    assert foresight.seconds_needed(np.array([0]))[0] == np.inf


def test_position_deviation_grows_with_fewer_sensors_and_falls_with_more() -> None:
    outlook = t_outlook()
    choices = backward_elimination(outlook, 0.075)
    assert [len(choice.sensors) for choice in choices] == list(range(11, 1, -1))
    known = [mean_position_std(outlook, 0.075), *(choice.mean_position_std for choice in choices)]
    assert all(a <= b * (1 + 1e-9) for a, b in itertools.pairwise(known))
    added = best_additional_sensor(outlook, 0.075)
    assert added.mean_position_std < known[0]
    assert added.changed not in t_frame().sensor


def test_additional_sensor_measures_the_unmeasured_direction() -> None:
    """Sensors across the beam in y only: the one more measures z."""
    bar = steel_beam()
    in_y = tuple(Sensor(channel=f"y{x}", at=(x, 0, 0), direction=(0, 1, 0)) for x in (0.3, 0.5, 0.8, 1.0))
    outlook = study_detectability(bar.model_copy(update={"sensor": in_y}), Record(highest=2000.0))
    assert best_additional_sensor(outlook, 0.01).changed.direction == (0, 0, 1)


def test_a_target_as_heavy_as_the_structure_is_refused() -> None:
    with pytest.raises(ModelError, match=r"expected a target of at most 1\.5 kg, found 20 kg"):
        LocalizationSimulation(t_outlook(), Target(mass=20.0))


@pytest.mark.parametrize("sensors", [0, 1])
def test_too_few_sensors_are_refused(sensors: int) -> None:
    few = t_frame().model_copy(update={"sensor": t_frame().sensor[:sensors]})
    with pytest.raises(
        ModelError, match=f"expected at least two sensors that measure three modes .* found {sensors} that"
    ):
        study_detectability(few, MINUTE)


@pytest.mark.parametrize(
    ("field", "value"), [("seconds", 0.0), ("damping", -0.1), ("highest", np.nan), ("false_alarms_per_year", np.inf)]
)
def test_invalid_record_is_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{field}: expected a positive number"):
        Record(**{field: value})


@pytest.mark.parametrize(("field", "value"), [("mass", 0.0), ("within", -1.0), ("chance", 1.0)])
def test_invalid_target_is_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{field}: expected"):
        Target(**({"mass": 0.05} | {field: value}))


def test_most_likely_position_matches_the_localization_posterior() -> None:
    """Posteriors of two to three bumps over two members, against the one-at-a-time places of the real posterior."""
    random, grid = np.random.default_rng(4), np.linspace(0, 1, 101)
    member, position = np.repeat([0, 1], 101), np.tile(grid, 2)
    bumps = [(random.uniform(0, 2, 3), random.uniform(0.02, 0.04, 3), random.dirichlet(np.ones(3))) for _ in range(50)]
    line = member + position
    density = np.array([(w * np.exp(-0.5 * ((line[:, None] - c) / s) ** 2)).sum(1) for c, s, w in bumps])
    probability = density / density.sum(1, keepdims=True)
    mean = likeliest_place(member, probability) @ line
    for k in range(50):
        posterior = PositionPosterior(
            members=(), member=member, position=position, probability=probability[k], length=np.ones(len(member))
        )
        best = posterior.places[0]
        assert best.member + best.start <= mean[k] <= best.member + best.stop


def test_position_spacing_is_fine_enough_or_refused() -> None:
    """A beam of 1 km: 600 places, 2400 at most."""
    bar = steel_beam()
    member = bar.member[0].model_copy(update={"end": (1000.0, 0.0, 0.0)})
    sensors = tuple(s.model_copy(update={"at": (1000 * s.at[0], 0.0, 0.0)}) for s in bar.sensor)
    long = bar.model_copy(update={"member": (member,), "sensor": sensors})
    slow = Record(highest=100.0)
    assert len(study_detectability(long, slow).member) == pytest.approx(600, abs=2)
    assert len(study_detectability(long, slow, within=2.5).member) == pytest.approx(1000, abs=2)
    assert len(study_detectability(bar, Record(highest=2000.0), within=0.005).member) == 501
    with pytest.raises(ModelError, match=r"0\.05 m on 1000 m of members are too many places; expected 1 m or more"):
        study_detectability(long, slow, within=0.05)


def test_modes_of_equal_frequency_and_sensor_shape_count_as_one() -> None:
    """A bar of square section bends alike both ways; sensors at 45 degrees see only one mode of each pair."""
    bar = steel_beam()
    square = bar.section["s"].model_copy(update={"second_moment": (1e-8, 1e-8)})
    aslant = tuple(Sensor(channel=f"{x}", at=(x, 0, 0), direction=(0, 1, 1)) for x in (0.3, 0.5, 1.0))
    round_bar = bar.model_copy(update={"section": {"s": square}})
    record = Record(highest=2000.0)
    frequency = study_detectability(round_bar.model_copy(update={"sensor": aslant}), record).frequency
    both = study_detectability(round_bar, record).frequency
    np.testing.assert_allclose(frequency, both[::2], rtol=1e-6)
    np.testing.assert_allclose(both[::2], both[1::2], rtol=1e-6)


def test_torsion_of_a_bar_is_not_observable_on_its_axis() -> None:
    """The torsion measured by sensors on the axis is rounding, and so is the motion of the axis: no share of it is
    seen.
    """
    bar = parse_structure(BAR)
    model = build_model(bar, shear_flexible=True, mass="consistent")
    modes = model.modes(8)
    seen = seen_by(model, modes)
    shear, length = 80e9, 1.0
    torsion = np.sqrt(shear * 0.2811 * 0.04 * 0.01**3 / (7850 * 0.04 * 0.01 * (0.04**2 + 0.01**2) / 12)) / (4 * length)
    twists = np.abs(modes.frequency / torsion - 1) < 0.1
    assert twists.sum() == 1
    assert seen[twists].max() < 1e-3  # rounding, over a millionth of a typical motion
    assert seen[~twists].min() > 0.5
    study_detectability(bar, Record())


BAR = """
name = "bar"
mesh = {element_length = 0.05}
material = {steel = {youngs_modulus = 205e9, shear_modulus = 80e9, density = 7850}}
section = {bar = {shape = "rectangle", width = 0.04, height = 0.01}}
member = [{name = "bar", from = [0, 0, 0], to = [1, 0, 0], material = "steel", section = "bar"}]
support = [{at = [0, 0, 0], fixed = ["x", "y", "z", "rx", "ry", "rz"]}]
sensor = [
    {channel = "y5", at = [0.5, 0, 0], direction = [0, 1, 0]},
    {channel = "z5", at = [0.5, 0, 0], direction = [0, 0, 1]},
    {channel = "y8", at = [0.8, 0, 0], direction = [0, 1, 0]},
    {channel = "z8", at = [0.8, 0, 0], direction = [0, 0, 1]},
    {channel = "y10", at = [1, 0, 0], direction = [0, 1, 0]},
    {channel = "z10", at = [1, 0, 0], direction = [0, 0, 1]},
]
"""


@pytest.mark.parametrize("n_sensors", [20, 60])
def test_reduced_rows_keep_the_information_of_all_channels(n_sensors: int) -> None:
    """Of more channels than modes fewer rows are kept: the information is that of the covariances of all channels."""
    random = np.random.default_rng(4)
    ways = np.eye(3).tolist()
    at = np.sort(random.uniform(0.05, 1.45, n_sensors)).tolist()
    sensors = tuple(
        Sensor(channel=f"s{k}", at=(0.0, 0.0, z), direction=(way[0], way[1], way[2]))
        for k, (z, way) in enumerate(zip(at, itertools.cycle(ways[:2]), strict=False))
    )
    outlook = study_detectability(t_frame().model_copy(update={"sensor": sensors}), MINUTE)
    paired, modes = outlook.reference.paired, outlook.reference.at_channels(outlook.reference.baseline.channels)
    unit = modes[:, paired] / np.linalg.norm(modes[:, paired], axis=0)
    rows = outlook._of_modes
    assert rows.shape[1] == min(n_sensors, modes.shape[1])
    for i, mode in enumerate(paired):
        error = np.sqrt(2) * outlook.shape_error[i]
        blur = 2 * outlook.record.blur(outlook.frequency)[i] ** 2 + SHAPE_BIAS**2
        covariance = error.T @ error + blur * np.eye(n_sensors)
        moved = (modes - np.outer(unit[:, i], unit[:, i] @ modes)) / np.linalg.norm(modes[:, mode])
        expected = moved.T @ np.linalg.solve(covariance, moved)
        np.testing.assert_allclose(rows[i].T @ rows[i], expected, atol=1e-8 * np.abs(expected).max())
