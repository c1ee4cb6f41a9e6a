from dataclasses import dataclass

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import minimize
from scipy.signal import welch

from daq import FloatArray
from daq.drivers import EPSON_SCALE
from monitor.rig import T_DEVICES, RigEvent, Scenario, World, draw_t_frame, make_sources, true_structure
from monitor.rig.scenario import RigCrack
from tests.support.monitor.rig import ORIGIN, nominal, t_frame
from tests.support.thorough import few_of
from updater import Body, Model, build_model, parse_structure
from updater.fe import Modes
from updater.structure import Ground, Support

MODES = range(8)
SOFT = 0.035  # m: rotation per moment over E I
HEAVY = Body(at=(0.25, 0.0, 1.48), mass=0.304)
SENSORS = [(0, "xy"), (1, "xy"), (2, "xy"), (3, "xy"), (4, "yz"), (5, "yz")]  # device number, analysed axes


def true_model(scenario: Scenario, *bodies: Body) -> Model:
    structure = true_structure(t_frame(), scenario).with_bodies(bodies)
    return build_model(structure, shear_flexible=True, mass="consistent")


def columns() -> list[int]:
    return [3 * device + "xyz".index(axis) for device, axes in SENSORS for axis in axes]


def record(scenario: Scenario, seconds: float, *, begin: int | None = None) -> FloatArray:
    """Return the measurements of the devices (n, 18) [m/s2], all started at ORIGIN."""
    world, sources = make_sources(t_frame(), scenario)
    for source, device in zip(sources, scenario.device, strict=True):
        source.start(ORIGIN, scenario.rate * (1 + device.clock_error))
    if begin is not None:
        world.begin(begin)
    steps = range(0, round(seconds * scenario.rate), 250)
    return np.concatenate([np.hstack([s.read(k, 250) for s in sources]) for k in steps]) * EPSON_SCALE


@dataclass(frozen=True)
class Peak:
    frequency: float  #: [Hz]
    damping: float  #: [-]


def whittle(signal: FloatArray, rate: float, near: float, damping: float) -> Peak:
    """Fit one mode's spectrum to a periodogram by maximum likelihood within 6 half-power bandwidths of `near`."""
    power = np.abs(np.fft.rfft(signal)) ** 2
    frequency = np.fft.rfftfreq(len(signal), 1 / rate)
    band = np.abs(frequency - near) < 12 * damping * near
    f, p = frequency[band], power[band]

    def cost(q: FloatArray) -> float:
        f0, zeta = near * (1 + q[0] * damping), damping * np.exp(q[1])
        shape = 1 / ((1 - (f0 / f) ** 2) ** 2 + (2 * zeta * f0 / f) ** 2)  # of an acceleration
        density = np.exp(q[2]) * shape + np.exp(q[3])
        return float(np.sum(np.log(density) + p / density))

    level = np.log(p.mean())
    start = np.array([0.0, 0.0, np.log(p.max()) + 2 * np.log(2 * damping), level - 7])
    best = minimize(cost, start, method="Nelder-Mead", options={"maxiter": 4000, "xatol": 1e-4, "fatol": 1e-4})
    return Peak(near * (1 + best.x[0] * damping), damping * float(np.exp(best.x[1])))


def frequency_std(frequency: float, damping: float, seconds: float) -> float:
    """Return the least standard deviation of a mode's frequency from its ambient response (Au 2014, long data)."""
    return frequency * float(np.sqrt(damping / (2 * np.pi * frequency * seconds)))


def alone(data: FloatArray, model: Model, modes: Modes, k: int, scenario: Scenario) -> FloatArray:
    """Return the motion in one mode (n,), by the shapes of ten at the analysed columns.

    In a single column modes far away move with the same forces and slant a mode's peak: by six deviations at
    beam_left_z, while beam_right_z, which moves as much, has it right.
    """
    read = np.concatenate([model.read(np.array(device.at))[:3] for device in scenario.device])
    return np.asarray(data[:, columns()] @ np.linalg.pinv(read[columns()] @ modes.shape[:, :10])[k])


@pytest.mark.parametrize(("seed", "seconds"), few_of([(11, 60.0), (11, 120.0), (12, 120.0)]))
def test_devices_measure_the_modes_of_the_true_model(seed: int, seconds: float) -> None:
    scenario = draw_t_frame("t_structure", seed, duration=0, between=None)
    model = true_model(scenario)
    modes = model.modes(24)
    data = record(scenario, seconds)
    for k in MODES:
        damping = scenario.truth.damping[k]
        rate = scenario.rate  # clocks are off by 20 ppm at most, the tolerance is hundreds of ppm
        peak = whittle(alone(data, model, modes, k, scenario), rate, modes.frequency[k], damping)
        std = frequency_std(modes.frequency[k], damping, seconds)
        assert abs(peak.frequency - modes.frequency[k]) < 5 * std, f"mode {k}"
        # var(zeta)/zeta^2 = 1 / (2 pi zeta f T) for long data (Au 2014)
        assert abs(np.log(peak.damping / damping)) < 5 / np.sqrt(2 * np.pi * damping * modes.frequency[k] * seconds)


def test_added_body_lowers_frequencies_as_predicted() -> None:
    seconds, at = 40.0, 2.0
    scenario = nominal(3, bodies=((at, HEAVY),))
    before, after = true_model(scenario).modes(8).frequency, true_model(scenario, HEAVY).modes(8).frequency
    model = true_model(scenario, HEAVY)
    data, modes = record(scenario, seconds + 2 * at, begin=ORIGIN)[round(2 * at * 1000) :], model.modes(24)
    for k in (2, 3, 6):  # 38.8 -> 36.7, 68.8 -> 66.4, 253 -> 241 Hz: the ones it moves most
        peak = whittle(alone(data, model, modes, k, scenario), 1000.0, after[k], 0.005)
        std = frequency_std(after[k], 0.005, seconds)
        assert abs(peak.frequency - after[k]) < 5 * std
        assert abs(peak.frequency - before[k]) > 20 * std


def test_structure_changes_at_the_exact_sample_and_continues_to_move() -> None:
    at = 3.123  # in the middle of what is simulated at once
    calm = World(t_frame(), nominal(4))
    world = World(t_frame(), nominal(4, bodies=((at, HEAVY),)))
    assert world.begin(ORIGIN) == (ORIGIN + 3_123_000_000,)
    change = round(world.sample(ORIGIN + 3_123_000_000))
    first, last = change - 2000, change + 2000
    changed, unchanged = world.motion(first, last, 5), calm.motion(first, last, 5)
    np.testing.assert_array_equal(changed[:2000], unchanged[:2000])
    assert np.abs(changed[2000] - unchanged[2000]).max() > 1e-4  # accelerations jump at once ...
    # ... but the heavier structure goes on under the same forces: neither at rest nor thrown
    assert 0.5 < changed[2000:].std() / unchanged[2000:].std() < 2


def test_two_bodies_are_added_one_after_the_other() -> None:
    second = Body(at=(0.0, 0.0, 0.92), mass=0.152)
    world = World(t_frame(), nominal(4, bodies=((2.6, second), (2.51, HEAVY))))
    one = World(t_frame(), nominal(4, bodies=((2.51, HEAVY),)))
    start = ORIGIN + 7
    assert [t - start for t in world.begin(start)] == [2_510_000_000, 2_600_000_000]
    one.begin(start)
    change = round(world.sample(start + 2_600_000_000))
    both, first = world.motion(change - 100, change + 1000, 1), one.motion(change - 100, change + 1000, 1)
    np.testing.assert_array_equal(both[:100], first[:100])
    assert np.abs(both[100:] - first[100:]).max() > 1e-4


def test_ground_below_the_foot_is_played() -> None:
    """40 kg at 24 Hz: one more peak, where the frequency of the truth's additional mode is."""
    structure = t_frame()
    ground = Ground(at=tuple(foot.at for foot in structure.support), axis="x", mass=40.0, frequency=24.0)
    heights = []
    for grounds in ((ground,), ()):
        world = World(structure.model_copy(update={"ground": grounds}), nominal(4))
        world.begin(ORIGIN)
        along = np.concatenate([world.motion(k * 2000, (k + 1) * 2000, 5)[:, 0] for k in range(2, 18)])
        frequency, power = welch(along, world.rate, nperseg=8000)
        near = np.abs(frequency - 23.6) < 1.1
        heights.append(power[near].max() / np.median(power[(frequency > 15) & (frequency < 35)]))
    print(f"peak over the median of 15 to 35 Hz: {heights}")
    assert heights[0] > 5
    assert heights[1] < 5


def test_body_that_comes_little_by_little_is_there_at_the_end() -> None:
    """Half of the way the structure has half of the body; the time of the event is that of its start."""
    event = RigEvent(at=2.5, over=960.0, body=HEAVY)
    scenario = nominal(4).model_copy(update={"event": (event,)})
    world = World(t_frame(), scenario)
    assert world.begin(ORIGIN) == (ORIGIN + 2_500_000_000,)
    masses = [model.total_mass() for model, _ in world._states]
    assert masses[len(masses) // 2] - masses[0] == pytest.approx(HEAVY.mass / 2)
    assert masses[-1] - masses[0] == pytest.approx(HEAVY.mass)
    final = true_model(nominal(), HEAVY).modes(8).frequency
    np.testing.assert_allclose(world._states[-1][0].modes(8).frequency, final, rtol=1e-9)
    with pytest.raises(ValidationError, match="over: expected 0"):
        RigEvent(
            kind="crack", at=2.5, over=3.0, crack=RigCrack(member="column", distance=0.3, axis="y", flexibility=0.1)
        )


@pytest.mark.parametrize("seed", [21])
def test_signals_do_not_depend_on_read_size_and_order(seed: int) -> None:
    scenario = draw_t_frame("t_structure", seed, duration=0, between=(2.1, 2.9))
    n = 6000
    world, sources = make_sources(t_frame(), scenario)
    for source in sources:
        source.start(ORIGIN, 1000.0)
    world.begin(ORIGIN)
    whole = [np.concatenate([s.read(k, 500) for k in range(0, n, 500)]) for s in sources[:1]]
    again, others = make_sources(t_frame(), scenario)
    again.keep_up(ORIGIN)
    for source in others:
        source.start(ORIGIN, 1000.0)
    again.begin(ORIGIN)
    random, have, pieces = np.random.default_rng(seed), [0] * 6, []
    while min(have) < n:
        for i in random.permutation(6):
            size = int(min(random.integers(0, 300), n - have[i]))
            piece = others[i].read(have[i], size)
            have[i] += size
            if i == 0:
                pieces.append(piece)
    np.testing.assert_array_equal(np.concatenate(pieces), whole[0])


def test_signals_are_reproducible_per_seed_and_differ_between_seeds() -> None:
    one, same, other = (record(nominal(seed), 1.0) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert abs(float(np.corrcoef(one[:, 1], other[:, 1])[0, 1])) < 0.5


@pytest.mark.parametrize("seed", few_of(range(3)))
def test_vibration_level_is_that_of_a_quiet_floor(seed: int) -> None:
    data = record(draw_t_frame("t_structure", seed, duration=0, between=None), 10.0)[:, columns()]
    rms = data.std(0)
    assert rms.min() > 0.002
    assert 0.005 < np.median(rms) < 0.02
    assert rms.max() < 0.05


#: the reference structure by definition: 10 mm Timoshenko mesh, consistent mass, clamped foot, rigid joint
@pytest.mark.parametrize(
    ("bodies", "frequencies"),
    [
        ((), (10.78, 10.97, 38.84, 68.77, 92.53, 158.02, 253.11, 270.96)),
        ((HEAVY,), (10.36, 10.55, 36.65, 66.37, 91.93, 153.98, 241.08, 269.60)),
        ((Body(at=(0, 0, 0.92), mass=0.152),), (10.74, 10.92, 38.84, 67.68, 89.90, 156.55, 253.08, 269.68)),
    ],
)
def test_true_model_without_deviations_is_the_reference_structure(
    bodies: tuple[Body, ...], frequencies: tuple[float, ...]
) -> None:
    found = true_model(nominal(), *bodies).modes(8).frequency
    # the table stems from another Timoshenko element, whose consistent mass differs in the order of (h/L)^2 = 5e-5
    np.testing.assert_allclose(found, frequencies, rtol=1e-4, atol=0.005)  # and is rounded to 0.01 Hz


@pytest.mark.parametrize(("name", "flexibility"), [("foot_flexibility", 0.01), ("joint_flexibility", 0.01)])
def test_foot_and_joint_flexibility_lower_frequencies_by_about_one_percent(name: str, flexibility: float) -> None:
    rigid = true_model(nominal()).modes(8).frequency
    soft = true_model(nominal(0, {name: (flexibility,) * 3})).modes(8).frequency
    drop = 1 - soft / rigid
    assert np.all(drop > -1e-9)
    assert 0.005 < drop.max() < 0.03


def test_foot_flexibility_acts_as_a_rotational_spring() -> None:
    # a point mass at the tip of a massless cantilever: compliance L^3/3EI grows by c L^3/EI, the frequency by
    # (1 + 3 c)^-1/2; the crossbeam and the column's own mass change the factor 3 by some tenths
    c = 0.005
    rigid = true_model(nominal()).modes(2).frequency
    soft = true_model(nominal(0, {"foot_flexibility": (c, c, c)})).modes(2).frequency
    np.testing.assert_allclose((rigid / soft) ** 2 - 1, 3 * c, rtol=0.15)


FRAME = """
name = "portal"
[material.a]
youngs_modulus = 70e9
shear_modulus = 26e9
density = 2700
[section.s]
area = 3e-4
second_moment = [4e-8, 4e-8]
torsion_constant = 6e-8
[[member]]
name = "beam"
from = [0, 0, 1]
to = [1.2, 0, 1]
material = "a"
section = "s"
elements = 4
[[member]]
name = "left"
from = [0, 0, 0]
to = [0, 0, 1]
material = "a"
section = "s"
elements = 4
[[member]]
name = "right"
from = [1.2, 0, 0]
to = [1.2, 0, 1]
material = "a"
section = "s"
elements = 4
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
[[support]]
at = [1.2, 0, 0]
fixed = ["x", "y", "z", "ry"]
"""


def test_other_frames_can_be_simulated() -> None:
    structure = parse_structure(FRAME)
    soft = nominal(0, {"foot_flexibility": (0.01,) * 3, "joint_flexibility": (0.01,) * 3, "stiffness_factor": 0.98})
    truth = true_structure(structure, soft)
    assert {(joint.member, joint.at) for joint in truth.joint} == {("left", (0, 0, 1)), ("right", (1.2, 0, 1))}
    assert [sorted(support.stiffness) for support in truth.support] == [["rx", "ry", "rz"], ["ry"]]
    devices = tuple(d.model_copy(update={"at": (0.3, 0.0, 1.0)}) for d in soft.device[:2])
    world = World(structure, soft.model_copy(update={"device": devices}))
    motion = world.motion(0, 4000, 0)
    np.testing.assert_array_equal(motion, world.motion(0, 4000, 1))
    assert motion.std() > 0


@pytest.fixture(scope="module")
def soft_foot() -> tuple[World, Model]:
    """A world whose foot has become softer by a hinge of 35 mm, and a model of the same with a softer spring."""
    crack = RigCrack(member="column", distance=0.0, axis="y", flexibility=SOFT, closed=SOFT)
    scenario = nominal(4, {"damping": (0.005,) * 12})
    event = RigEvent(kind="crack", at=10.0, crack=crack)
    world = World(t_frame(), scenario.model_copy(update={"event": (event,)}))
    world._response.change(*world._states[-1])
    truth = true_structure(t_frame(), scenario)
    (foot,) = truth.support
    rigidity = truth.rigidity(truth.member_named("column"))[1]
    springs = {**foot.stiffness, "ry": 1 / (SOFT / rigidity + 1 / foot.stiffness.get("ry", np.inf))}
    fixed = [axis for axis in foot.fixed if axis != "ry"]
    softer = Support.model_validate({"at": foot.at, "fixed": fixed, "stiffness": springs})
    structure = truth.model_copy(update={"support": (softer,)})
    return world, build_model(structure, shear_flexible=True, mass="consistent")


def test_modes_at_a_crack_have_the_shapes_of_a_hinge(soft_foot: tuple[World, Model]) -> None:
    """Shapes at the sensor 0.37 m from the foot are off by 0.1 % at most; in 12 modes alone, by 0.35 to 0.63 %.

    They are compared as shares of the shapes of the column about y, of unit length.
    """
    world, softer = soft_foot
    exact, own = softer.modes(10), world._response._modes
    stiffness = -world._response._crack._sides[0][1][:, : len(own.omega)]  # type: ignore[union-attr]
    square, vector = np.linalg.eigh(stiffness)
    np.testing.assert_allclose(np.sqrt(square[:10]), exact.omega, rtol=5e-4)
    expected, found = (
        np.array([model.read(np.array((0.0, 0.0, z)), 0) for z in (0.37, 0.74, 1.11, 1.48)]) @ shape
        for model, shape in ((softer, exact.shape), (world._states[-1][0], (own.shape @ vector)[:, :10]))
    )
    bends = np.linalg.norm(expected, axis=0) > 0.2 * np.linalg.norm(expected, axis=0).max()
    assert bends.sum() >= 4
    own_share, share = (np.abs(shape[0] / np.linalg.norm(shape, axis=0))[bends] for shape in (found, expected))
    np.testing.assert_allclose(own_share, share, rtol=1e-3)


def test_spectrum_with_a_crack_is_that_of_a_softer_foot(soft_foot: tuple[World, Model]) -> None:
    """Amplitudes of all analysed channels, as sampled and of the continuous structure with 120 modes and held forces.

    From 120 to 300 Hz within 4 %; in bands of 25 Hz below 400 Hz within 15 %, as without a crack: a band between
    resonances lacks what modes above the simulated ones contribute. Modes that appear at wrong frequencies would double
    amplitudes.
    """
    world, softer = soft_foot
    response, frequency = world._response, np.arange(5.0, 400.0, 0.5)
    modes, (steps, rates, _) = response._modes, response._crack._sides[0]  # type: ignore[union-attr]
    n = 2 * len(modes.omega)
    forward, pushed = steps[-1][:, :n], steps[-1][:, n:]
    read, push = (response._read @ modes.shape)[columns()], (response._force @ modes.shape).T
    exact = softer.modes(120)
    damping = np.pad(world._damping(), (0, 120 - len(world._damping())), mode="edge")
    rows = np.concatenate([softer.read(np.array(at))[:3] for at, _ in T_DEVICES.values()])[columns()] @ exact.shape
    ambient = world._ambient()
    acting = [softer.read(np.array(at), axis) for at, axis in zip(ambient.points, ambient.axes, strict=True)]
    forces = (np.array(acting) @ exact.shape).T
    found, expected = np.empty((2, len(frequency), len(rows)))
    for k, f in enumerate(frequency):
        turn = np.exp(2j * np.pi * f / world.rate)
        state = np.linalg.solve(turn * np.eye(n) - forward, turn * pushed @ push)
        moved = rates @ state + push
        moved[-1] = world.rate * (1 - 1 / turn) * state[-1]
        found[k] = (np.abs(read @ moved) ** 2).sum(1)
        s = 2j * np.pi * f
        gain = s**2 / (s**2 + 2 * damping * exact.omega * s + exact.omega**2) * np.sinc(f / world.rate)
        expected[k] = (np.abs((rows * gain) @ forces) ** 2).sum(1)
    middle = (frequency > 120) & (frequency < 300)
    np.testing.assert_allclose(np.sqrt(found[middle].sum(0) / expected[middle].sum(0)), 1, atol=0.04)
    bands = [frequency // 25 == k for k in range(16)]
    ratio = np.sqrt([found[band].sum(0) / expected[band].sum(0) for band in bands])
    print(f"{ratio.min():.3f} to {ratio.max():.3f}")
    np.testing.assert_allclose(ratio, 1, atol=0.15)


def test_modes_above_the_simulated_rate_are_left_out_with_a_crack() -> None:
    """40 dampings, of which 22 are of modes below 1.8 kHz."""
    crack = RigCrack(member="column", distance=0.3, axis="y", flexibility=0.04)
    scenario = nominal(0, {"damping": (0.005,) * 40})
    event = RigEvent(kind="crack", at=10.0, crack=crack)
    world = World(t_frame(), scenario.model_copy(update={"event": (event,)}))
    frequency = world._response._modes.frequency
    assert frequency.max() < 1.8 * scenario.rate
    assert len(frequency) == 22


def test_old_samples_are_discarded() -> None:
    world = World(t_frame(), nominal())
    world.keep_up(ORIGIN)
    world.keep_up(ORIGIN + 20_000_000_000)
    with pytest.raises(ValueError, match=r"motion: expected samples from \d+ on, found 4000"):
        world.motion(4000, 4100, 0)


def test_an_event_in_the_past_is_refused() -> None:
    world = World(t_frame(), nominal(bodies=((2.0, HEAVY),)))
    world.keep_up(ORIGIN)
    world.keep_up(ORIGIN + 3_000_000_000)
    with pytest.raises(ValueError, match=r"event at sample 12000: expected one from 16000 on"):
        world.begin(ORIGIN)
