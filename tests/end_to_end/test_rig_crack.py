"""A crack that opens and closes in the virtual rig: found, sized, and in the extended model."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from scipy.signal import firwin, upfirdn

from daq import Channel, Recording
from monitor.analysis.explanation import Explanation, explain
from monitor.analysis.observation import observe
from monitor.rig import RigDevice, World, load_scenario, shipped_scenarios
from monitor.rig.world import OVERSAMPLING
from monitor.text.causes import breathing_text
from tests.support.updater.frames import COLUMN_CRACK
from updater import Structure, dump_structure, parse_structure, t_structure_toml
from updater.quantities import Opening

WINDOWS, SECONDS = 3, 40
START = 1_767_225_600_000_000_000


def test_crack_of_the_virtual_rig_opens_and_closes() -> None:
    """The shipped scenario: the column cracks 0.3 m above the foot, with 0 and 40 mm of flexibility.

    The extended model contains it, and predicts the nonlinear part of windows that were not used.
    """
    scenario = load_scenario(shipped_scenarios()["breathing-crack"])
    event = scenario.event[0].model_copy(update={"at": WINDOWS * SECONDS})
    world = World(parse_structure(t_structure_toml()), scenario.model_copy(update={"event": (event,)}))
    world.sample(START)
    (cracked,) = world.begin(START)
    structure = parse_structure(t_structure_toml())
    before = observe(windows(world, structure, scenario.device, START))
    after = observe(windows(world, structure, scenario.device, cracked))
    heldout = observe(windows(world, structure, scenario.device, cracked + WINDOWS * SECONDS * 10**9))
    found = explain(structure, before, after, heldout)
    opening = checked_opening(found, share=1.0)
    assert abs(opening.flexibility.value - 0.04) < 3 * opening.flexibility.std
    assert abs(opening.closed.value) < 3 * opening.closed.std
    assert abs(opening.moment.value) < 3 * opening.moment.std
    assert opening.opens == "above"
    (cause,) = found.diagnosis.causes
    assert cause.breathing
    gain = cause.breathing.heldout
    print(gain)
    assert gain
    assert gain.log_likelihood.value > 5 * gain.log_likelihood.std
    extended = found.explained.extended
    assert extended
    again = parse_structure(dump_structure(extended))
    assert again == extended
    (crack,) = again.breathing_crack
    assert (crack.member, crack.axis, crack.opens) == ("column", "y", "above")


SEGMENT = """
[[segment]]
member = "column"
at = [0.0, 0.0, 0.3]
extent = 0.02
bending = [0.563, 1.0]
"""


@pytest.mark.thorough
def test_crack_of_a_structure_file_is_played_and_found() -> None:
    """The rig plays the file's crack; the moment is half a standard deviation, on the negative side."""
    scenario, structure = load_scenario(shipped_scenarios()["quiet"]), parse_structure(t_structure_toml())
    observed = []
    for seed, played in ((3, structure), (4, parse_structure(t_structure_toml() + SEGMENT + COLUMN_CRACK))):
        print(f"seed {seed}")
        world = World(played, scenario.model_copy(update={"seed": seed}))
        world.sample(START)
        world.begin(START)
        observed.append(observe(windows(world, structure, scenario.device, START)))
    opening = checked_opening(explain(structure, observed[0], observed[1]), share=1.0)
    assert abs(opening.flexibility.value - 0.05) < 3 * opening.flexibility.std
    assert abs(opening.moment.value + 0.0016) < 3 * opening.moment.std
    assert opening.opens == "below"


def checked_opening(found: Explanation, share: float) -> Opening:
    """Return the opening of a crack 0.3 m up the column that closes by a share."""
    (cause,) = found.diagnosis.causes
    print(cause, breathing_text(cause))
    assert cause.cause == "local_stiffness"
    assert cause.where
    assert cause.where.position
    assert cause.where.position[2] == pytest.approx(0.3, abs=0.05)
    assert cause.breathing
    assert cause.breathing.significant
    assert abs(cause.breathing.share.value - share) < 3 * cause.breathing.share.std
    opening = cause.breathing.opening
    assert opening
    assert (opening.member, opening.axis) == ("column", "y")
    return opening


def windows(world: World, structure: Structure, devices: Sequence[RigDevice], start: int) -> Iterator[Recording]:
    """Yield windows of the structure's sensors from a time on, filtered and at a quarter of the simulated rate."""
    taps = firwin(32 * OVERSAMPLING + 1, 0.88 / OVERSAMPLING, window=("kaiser", 9.0))
    number = {device.at: k for k, device in enumerate(devices)}
    axes = [int(np.argmax(np.abs(sensor.direction))) for sensor in structure.sensor]
    for k in range(WINDOWS):
        first = round(world.sample(start + k * SECONDS * 10**9))
        seconds = range(first, first + round(SECONDS * world.rate), round(world.rate))
        fine = np.concatenate(
            [
                np.column_stack(
                    [
                        world.motion(at, at + round(world.rate), number[sensor.at])[:, axis]
                        for sensor, axis in zip(structure.sensor, axes, strict=True)
                    ]
                )
                for at in seconds
            ]
        )
        yield Recording(
            channels=tuple(
                Channel(name=sensor.channel, device="rig", axis=axis)
                for sensor, axis in zip(structure.sensor, axes, strict=True)
            ),
            data=upfirdn(taps, fine, down=OVERSAMPLING, axis=0)[16:-16],
            rate=world.rate / OVERSAMPLING,
            start=start + k * SECONDS * 10**9,
            temperature=np.nan,
        )
