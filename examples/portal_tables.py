"""Tables of a portal frame before and after a change, for the page "Your data in ten minutes".

    python examples/portal_tables.py portal

writes portal/before.csv and portal/after.csv: 120 s of eight accelerometers at 500 Hz, as a data logger would. The true
frame is not that of the page: 1 % stiffer steel, feet that turn, gains 0.5 % off. In between, a steel block of 400 g
was clamped to the beam at x = 0.80 m. The page does not use this.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.signal import resample_poly

from updater import Body, Structure, build_model, parse_structure
from updater.fe import Ambient, AmbientResponse

SECONDS, RATE, OVER = 120, 500, 2  # OVER: simulated samples per sample
SEED = 3
BLOCK = Body(at=(0.80, 0, 1.0), mass=0.4, offset=(0, 0.01, 0.02), inertia=(1e-4, 1e-4, 1e-4))
FRAME = """
name = "portal"
[mesh]
element_length = 0.02
[material.steel]
youngs_modulus = 212.1e9
shear_modulus = 81.6e9
density = 7850
[section.tube]
shape = "box"
width = 0.04
height = 0.04
thickness = 0.003
corner_radius = 0.006
[[member]]
name = "left post"
from = [0, 0, 0]
to = [0, 0, 1]
material = "steel"
section = "tube"
[[member]]
name = "right post"
from = [1.2, 0, 0]
to = [1.2, 0, 1]
material = "steel"
section = "tube"
[[member]]
name = "beam"
from = [0, 0, 1]
to = [1.2, 0, 1]
material = "steel"
section = "tube"
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z"]
stiffness = {rx = 6e6, ry = 5e6, rz = 6e6}
[[support]]
at = [1.2, 0, 0]
fixed = ["x", "y", "z"]
stiffness = {rx = 4e6, ry = 6e6, rz = 5e6}
"""
SENSORS = {
    "left_x": ((0, 0, 0.6), 0),
    "left_y": ((0, 0, 0.6), 1),
    "right_x": ((1.2, 0, 0.7), 0),
    "right_y": ((1.2, 0, 0.7), 1),
    "beam_y": ((0.3, 0, 1.0), 1),
    "beam_z": ((0.3, 0, 1.0), 2),
    "corner_x": ((1.2, 0, 1.0), 0),
    "corner_y": ((1.2, 0, 1.0), 1),
}
FORCES = tuple(((x, 0.0, z), axis) for x, z in ((0.0, 0.45), (1.2, 0.8), (0.5, 1.0), (0.95, 1.0)) for axis in (0, 1, 2))


def record(structure: Structure, seed: int) -> np.ndarray:
    """Return accelerations (n_samples, n_channels) [m/s2] under ambient forces."""
    model = build_model(structure, shear_flexible=True, mass="consistent")
    rows = np.array([model.read(np.array(at, float), axis) for at, axis in SENSORS.values()])
    damping = np.full((model.modes(20).frequency < 0.45 * RATE * OVER).sum(), 0.006)
    points, axes = zip(*FORCES, strict=True)
    ambient = Ambient(points=points, axes=axes, density=1e-7)
    response = AmbientResponse(model, rows, damping, ambient, rate=RATE * OVER, seed=seed)
    response.step(20 * RATE * OVER)
    motion = resample_poly(response.step(SECONDS * RATE * OVER), 1, OVER, axis=0)
    gains = 1 + 0.005 * np.random.default_rng(SEED).standard_normal(len(SENSORS))
    noise = 1e-4 * np.random.default_rng(seed).standard_normal(motion.shape)
    return np.asarray(motion * gains + noise)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else "portal")
folder.mkdir(parents=True, exist_ok=True)
frame = parse_structure(FRAME)
for name, structure in (("before", frame), ("after", frame.with_bodies([BLOCK]))):
    data = record(structure, SEED + (name == "after"))
    table = np.column_stack([np.arange(len(data)) / RATE, data])
    head = ",".join(["t", *SENSORS])
    np.savetxt(
        folder / f"{name}.csv", table, delimiter=",", header=head, comments="", fmt=["%.3f"] + ["%.5f"] * len(SENSORS)
    )
    print(f"{folder / name}.csv: {len(data)} rows of {len(SENSORS)} channels")
