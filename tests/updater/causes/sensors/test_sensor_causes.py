"""Faults of the measuring chain hidden in another model's modes: named, sized, written down."""

from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import pytest

from daq import FloatArray
from oma import ChannelFault, ModalEstimate
from oma.preparation import FaultKind
from tests.support.thorough import few_of
from tests.support.updater.reference_frame import measure, t_frame, true_model
from updater import (
    Circumstances,
    Diagnosis,
    DiagnosisResult,
    ModalMean,
    Model,
    Reference,
    build_model,
    diagnose,
    dump_structure,
    learn_reference,
    matched,
    parse_structure,
    stack_tracks,
    t_structure_toml,
)
from updater.causes.composite import JointHypothesis, SelectedCause
from updater.causes.sensors.orientation import propose_sensor_orientation
from updater.inference import compare

TRACK = np.arange(8)
CHANNELS = t_frame().channels
DEVICES = {channel: channel.rsplit("_", 1)[0] for channel in CHANNELS}  # one at each place


@dataclass(eq=False)
class Rig:
    """A bench with small errors of its own: gains off by half a per cent, devices late by 0.02 ms."""

    seed: int

    def __post_init__(self) -> None:
        print(f"seed {self.seed}")
        self.random = np.random.default_rng(self.seed)
        self.bare = true_model(np.random.default_rng((self.seed, 1)))
        self.gain: FloatArray = 1 + 0.005 * self.random.standard_normal(12)
        late = {device: 2e-5 * self.random.standard_normal() for device in dict.fromkeys(DEVICES.values())}
        self.late: FloatArray = np.array([late[DEVICES[c]] for c in CHANNELS])
        windows = [self.window(self.bare, self.gain, self.late) for _ in range(8)]
        self.reference: Reference = learn_reference(t_frame(), windows, [TRACK] * 8)

    def window(self, model: Model, gain: FloatArray, late: FloatArray) -> ModalEstimate:
        found = measure(model, self.random, gain)
        return replace(found, shape=found.shape * np.exp(-2j * np.pi * found.frequency[:, None] * late))

    def event(
        self, model: Model | None = None, gain: FloatArray | float = 1.0, late: FloatArray | float = 0.0
    ) -> ModalMean:
        windows = [self.window(model or self.bare, self.gain * gain, self.late + late) for _ in range(5)]
        return matched(self.reference.baseline, self.reference.mean_of(stack_tracks(windows, [TRACK] * 5)))

    def explained(
        self, event: ModalMean, faults: dict[str, ChannelFault] | None = None, only: tuple[str, ...] = ()
    ) -> DiagnosisResult:
        known = Circumstances(devices=DEVICES, faults=faults or {})
        return diagnose(self.reference, event, circumstances=known, only=only)


def test_sensor_fault_is_not_combined_with_itself_on_same_channels() -> None:
    rig = Rig(221)
    data = compare(rig.reference, rig.event())
    cause = propose_sensor_orientation(rig.reference, data)
    joint = JointHypothesis(cause, (SelectedCause(cause, 3, np.zeros(3)),))
    assert np.flatnonzero(np.isneginf(joint.log_prior)).tolist() == [3]


def only(*channels: str) -> FloatArray:
    return np.array([float(c in channels) for c in CHANNELS])


def the_cause(found: Diagnosis, name: str, *channels: str) -> dict[str, tuple[float, float]]:
    """Check that this alone was named, on these channels; return its parameters with their deviations."""
    assert (found.verdict, [cause.cause for cause in found.causes]) == ("explained", [name])
    (cause,) = found.causes
    assert cause.where is not None
    assert cause.where.channels == channels
    return {key: (quantity.value, quantity.std) for key, quantity in cause.parameters.items()}


@pytest.mark.parametrize(
    ("seed", "channels", "delay"),
    few_of(
        [
            (201, ("col_074_x", "col_074_y"), 8e-4),
            (202, ("beam_left_z",), 1.5e-3),  # more than a third of the highest mode's period
            (203, ("beam_mid_y",), -2e-4),
        ]
    ),
)
def test_sensor_delay_is_found_within_50_microseconds(seed: int, channels: tuple[str, ...], delay: float) -> None:
    rig = Rig(seed)
    found = rig.explained(rig.event(late=delay * only(*channels)))
    value, std = the_cause(found.diagnosis, "sensor_delay", *channels)["delay"]
    assert abs(value - delay) < max(5 * std, 1e-6)
    assert abs(value - delay) < 5e-5
    assert found.extended is not None
    extended = parse_structure(dump_structure(found.extended, t_structure_toml()))
    assert {c for c, late in extended.delays.items() if late} == set(channels)
    assert extended.delays[channels[0]] == pytest.approx(value)


@pytest.mark.parametrize(
    ("seed", "channel", "axis", "angle"),
    few_of([(211, "beam_left_z", (1.0, 0.0, 0.0), 0.15), (212, "col_111_x", (0.0, 0.6, 0.8), 0.3)]),
)
def test_misaligned_sensor_is_found_with_its_angle(
    seed: int, channel: str, axis: tuple[float, float, float], angle: float
) -> None:
    """To four deviations and 1 degree: the model's other directions are right to 3 % of the tilt."""
    rig = Rig(seed)
    way = np.array(rig.bare.structure.sensor[CHANNELS.index(channel)].direction, float)
    turned = np.cos(angle) * way + np.sin(angle) * np.cross(axis, way)
    sensors = tuple(
        s.model_copy(update={"direction": tuple(turned.tolist())}) if s.channel == channel else s
        for s in rig.bare.structure.sensor
    )
    askew = rig.bare.structure.model_copy(update={"sensor": sensors})
    model = build_model(askew, shear_flexible=True, mass="consistent")
    found = rig.explained(rig.event(model))
    value, std = the_cause(found.diagnosis, "sensor_orientation", channel)["angle"]
    assert abs(value - angle) < max(4 * std, np.radians(1))
    assert found.extended is not None
    (sensor,) = (s for s in found.extended.sensor if s.channel == channel)
    assert np.degrees(np.arccos(np.dot(sensor.direction, turned))) < max(1.0, 4 * np.degrees(std))


def test_channel_without_signal_is_diagnosed_as_dead() -> None:
    rig = Rig(221)
    found = rig.explained(rig.event(gain=1 - only("beam_right_y")))
    assert not the_cause(found.diagnosis, "sensor_dead", "beam_right_y")
    assert found.extended is not None
    assert set(CHANNELS) - set(found.extended.active_channels) == {"beam_right_y"}


@pytest.mark.thorough
def test_channel_left_out_as_constant_is_diagnosed_as_dead() -> None:
    rig = Rig(222)
    lost = ("col_037_x", "col_037_y")
    event = rig.event().at(tuple(c for c in CHANNELS if c not in lost))
    constant = ChannelFault(kind="no_signal", text="constant")
    the_cause(rig.explained(event, dict.fromkeys(lost, constant)).diagnosis, "sensor_dead", *lost)
    assert rig.explained(event).diagnosis.verdict == "nothing_to_explain"  # not recorded is not broken


@pytest.mark.parametrize("kind", few_of(sorted(set(get_args(FaultKind)) - {"no_signal"})))
def test_channel_left_out_for_another_reason_is_no_cause(kind: FaultKind) -> None:
    rig = Rig(223)
    event = rig.event().at(tuple(c for c in CHANNELS if c != "beam_mid_y"))
    faults = {"beam_mid_y": ChannelFault(kind=kind, text="left out")}
    found = rig.explained(event, faults, ("sensor_dead", "sensor_gain", "added_mass"))
    assert found.diagnosis.verdict == "nothing_to_explain"


@pytest.mark.thorough
def test_small_errors_already_in_the_baseline_are_no_faults() -> None:
    """Half a per cent in gains and 0.02 ms in devices cancel against the baseline; two rigs."""
    verdicts = [rig.explained(rig.event()).diagnosis.verdict for rig in map(Rig, (231, 232))]
    assert verdicts == ["nothing_to_explain"] * 2
