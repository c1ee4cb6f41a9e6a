"""A foot that has come loose: two modes are then close, or modes move so far that tracking loses them.

Records of portals under white forces: the stiffness of the right foot falls from 2000 to 120 N m/rad. Two modes are
then some tenths of a per cent apart, and three minutes mix their shapes.

Modes of portals with the noise of an identification: a clamped foot becomes nearly a hinge. Both feet are rigid in the
owner's file; the left one yields a little. The right one then turns about two axes on springs up to a hundred times as
soft as the post: the frequencies hardly depend on the stiffness about the stronger axis.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import firwin, lfilter, upfirdn

from daq import Channel, Recording
from monitor.analysis.explanation import explain
from monitor.analysis.observation import Observation, observe, window_seconds
from tests.support.portals import measured_modes
from tests.support.portals.tube_portal import LEFT, Portal
from tests.support.thorough import few_of
from updater import Cause, Diagnosis, Structure, parse_structure

RATE, SECONDS, OVER = 500, 180, 4
RIGHT = 120.0  # N m/rad


def record(portal: Portal, foot: float, seed: int) -> Recording:
    """Return accelerations under eight white forces, damping 0.4 %, with noise and gains 0.3 % off."""
    frequency, at_sensors, everywhere = portal.modes(foot)
    random = np.random.default_rng((seed, int(foot)))
    places = np.random.default_rng(5).choice(np.arange(4, len(everywhere) - 4), 8, replace=False)
    at_forces = everywhere[places, np.arange(8) % 3]
    fine, settling = RATE * OVER, 20 * RATE * OVER
    force = random.standard_normal((8, settling + (SECONDS + 1) * fine))
    motion = np.zeros((len(at_sensors), force.shape[1]))
    for k in np.flatnonzero(frequency < 0.24 * fine):
        omega, damping = 2 * np.pi * frequency[k], 0.004
        pole = omega * (-damping + 1j * np.sqrt(1 - damping**2))
        step = np.exp(pole / fine)
        state = lfilter([0.0, (step - 1) / pole], [1.0, -step], (at_forces[:, k] @ force).astype(complex))
        acceleration = (pole**2 * state).imag / pole.imag + at_forces[:, k] @ force
        motion += np.outer(at_sensors[:, k], acceleration)
    filtered = upfirdn(firwin(513, 0.88 / OVER, window=("kaiser", 9.0)), motion[:, settling:], down=OVER, axis=1)
    data = filtered[:, 64 : 64 + SECONDS * RATE].T
    gain = 1 + 0.003 * np.random.default_rng((seed, 7)).standard_normal(len(at_sensors))
    data = 0.05 * (data / np.sqrt(np.mean(data**2)) * gain + 5e-3 * random.standard_normal(data.shape))
    channels = tuple(Channel(name=c, device="daq", axis=axis) for c, (_, axis) in portal.sensors().items())
    start = 1_767_225_600_000_000_000 + (3600 * 10**9 if foot == RIGHT else 0)
    return Recording(channels=channels, data=data, rate=float(RATE), start=start, temperature=np.nan)


def observed(portal: Portal, foot: float, seed: int) -> Observation:
    """Return the modes of the windows of a record."""
    whole = record(portal, foot, seed)
    n = round(window_seconds(portal.file(), SECONDS) * RATE)
    parts = range(len(whole.data) // n)
    return observe(
        replace(whole, data=whole.data[k * n : (k + 1) * n], start=whole.start + round(k * n / RATE * 1e9))
        for k in parts
    )


def of_right_foot(found: Diagnosis, portal: Portal) -> Cause:
    """Return the only cause, which must be the right foot."""
    assert found.verdict == "explained"
    (cause,) = found.causes
    assert cause.cause == "support_stiffness"
    assert cause.where
    assert cause.where.position == portal.at("right", 0.0)
    return cause


#: by the distance of the two closest modes with the loose foot, in per cent
PORTALS = {
    0.14: Portal(0.010, 0.010, 0.001, 0.6, 0.66),
    0.31: Portal(0.018, 0.015, 0.0015, 0.8, 1.45),
    0.33: Portal(0.015, 0.018, 0.0015, 0.9, 1.15),
    0.58: Portal(0.015, 0.018, 0.0015, 0.9, 1.175),
    1.13: Portal(0.018, 0.015, 0.0015, 1.0, 1.175),
    1.63: Portal(0.015, 0.018, 0.0015, 0.8, 1.15),
}
#: without the record of the first portal in which a mode is identified with a MAC of 0.85 with the true one
CASES = [(apart, seed, ()) for apart in PORTALS for seed in range(10)]
FEW = ("support_stiffness", "joint_stiffness", "local_stiffness")  # causes that are compared in the ordinary case


@pytest.mark.parametrize(("apart", "seed", "only"), few_of([(0.14, 3, FEW), *CASES]))
def test_loose_foot_is_named_where_two_modes_mix(apart: float, seed: int, only: tuple[str, ...]) -> None:
    """Its stiffness within three stated deviations, of at most a fifth.

    The third axis may be listed too: it is at two deviations, which chance exceeds in one of 20 cases.
    """
    portal = PORTALS[apart]
    frequency, _, _ = portal.modes(RIGHT)
    assert 100 * (np.diff(frequency[1:11]) / frequency[1:10]).min() == pytest.approx(apart, abs=0.005)
    found = explain(portal.file(), observed(portal, LEFT, seed), observed(portal, RIGHT, seed), only=only).diagnosis
    print(apart, seed, found)
    cause = of_right_foot(found, portal)
    for axis in ("rx", "ry"):
        stiffness = cause.parameters[f"stiffness_{axis}"]
        assert stiffness.std < RIGHT / 5
        assert abs(stiffness.value - RIGHT) < 3 * stiffness.std


GAIN_STD = 0.005  # of the sensors
CLAMPED = 2e6  # N m/rad
LOWEST, HIGHEST = np.array([0.01, 0.04, 0.001, 0.7, 0.6]), np.array([0.012, 0.06, 0.0015, 1.0, 1.0])
CLAMPED_CASES = [(seed, FEW) for seed in range(20)]


def draw(seed: int) -> tuple[Structure, Portal, float, tuple[Observation, Observation]]:
    """Return the file, a portal, the stiffness of its loose foot [N m/rad], and windows before and after."""
    random = np.random.default_rng((seed, 91))
    portal = Portal(*random.uniform(LOWEST, HIGHEST).tolist())
    foot = float(np.exp(random.uniform(np.log(60), np.log(600))))
    states = [portal.modes(stiffness)[:2] for stiffness in (CLAMPED, foot)]
    gain = 1 + GAIN_STD * random.standard_normal(len(states[0][1]))[:, None]
    before, after = (measured_modes.observed(portal, f, gain * s, 20 * k, random) for k, (f, s) in enumerate(states))
    return parse_structure(portal.file_text(rigid=True)), portal, foot, (before, after)


@pytest.mark.parametrize(("seed", "only"), few_of([(2, FEW[:1]), *CLAMPED_CASES]))
def test_stiffness_of_a_foot_that_is_nearly_a_hinge(seed: int, only: tuple[str, ...]) -> None:
    """About both axes within three stated deviations; the written file is four times as close to the modes.

    About the stronger axis the largest of 20 is 6.7 times the truth: the modes bound it, but hardly depend on it.
    """
    file, portal, foot, (before, after) = draw(seed)
    found = explain(file, before, after, only=only).diagnosis
    print(seed, foot, found)
    cause = of_right_foot(found, portal)
    for axis, most in (("rx", 10.0), ("ry", 2.5)):
        stiffness = cause.parameters[f"stiffness_{axis}"]
        assert abs(stiffness.value - foot) < 3 * stiffness.std
        assert stiffness.value < most * foot
    assert found.gain
    error = found.gain.frequency_error_percent
    assert error.before
    assert error.after
    assert error.after < error.before / 4
