"""A rail that gussets or a plate through the post hold rigidly: springs of the wall are not fitted to measured modes.

The truth has a finer mesh, another modulus and density, and feet that yield; nothing bends where the members meet.
"""

import numpy as np
import pytest

from daq import FloatArray
from tests.support.thorough import few_of
from tests.support.updater.frames import noisy_estimates, unmoved
from updater import Structure, build_model, calibrate, mean_modes, parse_structure, stack_tracks

N_USED, N_UNUSED, N_WINDOWS, STD, SHAPE_STD = 8, 4, 8, 1e-3, 0.01
AXES = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
FILE = """
name = "H"
[mesh]
element_length = {size}
[material.steel]
youngs_modulus = {modulus}
poisson_ratio = 0.3
density = {density}
[section.post]
shape = "box"
width = 0.06
height = 0.06
thickness = 0.003
[section.rail]
shape = "box"
width = 0.04
height = 0.04
thickness = 0.003
[updating]
fixed = {fixed}
"""


def draw_frame(random: np.random.Generator, feet_are: str) -> tuple[Structure, Structure, Structure]:
    """Draw two posts with a rail on usual or far softer feet: the truth, its file, and the file with fixed walls."""
    height, width = random.uniform(1.0, 1.5), random.uniform(0.6, 1.0)
    up = height * random.uniform(0.5, 0.8)
    foot = 6e4 / random.uniform(0.01, 0.03, 2) if feet_are == "usual" else random.uniform(1e5, 4e5, 2)
    modulus, density = 2.1e11 * (1 + 0.01 * random.standard_normal()), 7850 * (1 + 0.005 * random.standard_normal())
    spring = "fixed = ['x', 'y', 'z', 'rz']\nstiffness = {{ rx = {0}, ry = {0} }}"
    clamp = "fixed = ['x', 'y', 'z', 'rx', 'ry', 'rz']"
    held = "['*.wall_*']"
    of_truth = FILE.format(size=0.02, modulus=modulus, density=density, fixed="[]")
    of_file, of_rigid = (FILE.format(size=0.05, modulus=2.1e11, density=7850, fixed=own) for own in ("[]", held))
    parts = _geometry(height, width, up)
    feet = [f"[[support]]\nat = [{x}, 0, 0]\n" for x in (0, width)]
    truth = parse_structure(of_truth + parts + "\n".join(a + spring.format(k) for a, k in zip(feet, foot, strict=True)))
    file, rigid = (parse_structure(own + parts + "\n".join(a + clamp for a in feet)) for own in (of_file, of_rigid))
    return truth, file, rigid


def _geometry(height: float, width: float, up: float) -> str:
    """Return the members, and 14 sensors on them."""
    members = {
        "left": ([0.0, 0.0, 0.0], [0.0, 0.0, height], "post", "xy"),
        "right": ([width, 0.0, 0.0], [width, 0.0, height], "post", "xy"),
        "beam": ([0.0, 0.0, up], [width, 0.0, up], "rail", "yz"),
    }
    text = ""
    for name, (start, end, section, axes) in members.items():
        text += f'[[member]]\nname = "{name}"\nfrom = {start}\nto = {end}\nmaterial = "steel"\nsection = "{section}"\n'
        for share in (0.5, 1.0) if section == "post" else (0.25, 0.5, 0.75):
            at = (np.array(start) + share * np.subtract(end, start)).tolist()
            text += "".join(
                f'[[sensor]]\nchannel = "{name}_{share}_{axis}"\nat = {at}\ndirection = {AXES[axis]}\n' for axis in axes
            )
    return text


def seen_modes(structure: Structure, n: int) -> tuple[FloatArray, FloatArray]:
    """Return frequencies (n,) [Hz] and shapes (n, n_channels) of unit norm of the modes that sensors see."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    modes = model.modes(30)
    shape = (model.sensor_rows @ modes.shape).T
    size = np.linalg.norm(shape, axis=1)
    seen = np.flatnonzero(size > 0.05 * np.median(size))[:n]
    return modes.frequency[seen], shape[seen] / size[seen, None]


@pytest.mark.parametrize(
    ("feet_are", "seed"),
    few_of([(feet, seed) for feet in ("usual", "far off") for seed in range(1, 11)]),
)
def test_walls_of_a_rigid_joint_stay_rigid(feet_are: str, seed: int) -> None:
    """Parameters are those of a file that fixes the walls, and with them the modes that were not measured.

    Feet that are far off are softer than the prior by up to 15 deviations: springs of walls would imitate them.
    """
    random = np.random.default_rng((seed, 79))
    truth, file, rigid = draw_frame(random, feet_are)
    frequency, shape = seen_modes(truth, N_USED + N_UNUSED)
    windows = noisy_estimates(
        frequency[:N_USED], shape[:N_USED], file.channels, N_WINDOWS, random, std=STD, shape_std=SHAPE_STD
    )
    measured = mean_modes(stack_tracks(windows, unmoved(N_WINDOWS)))
    found, expected = calibrate(file, measured), calibrate(rigid, measured)
    error = seen_modes(found.structure, N_USED + N_UNUSED)[0] / frequency - 1
    print(f"seed {seed}", feet_are, [(p.name, p.value, p.std) for p in found.parameters], 100 * error.round(5))
    assert [p.name for p in found.parameters] == [p.name for p in expected.parameters]
    assert [p.value for p in found.parameters] == pytest.approx([p.value for p in expected.parameters], rel=1e-9)
    assert found.modes.frequency == pytest.approx(expected.modes.frequency, rel=1e-9)
