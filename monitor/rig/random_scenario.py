"""Random scenarios from a seed."""

import numpy as np

from monitor.rig.scenario import RigDevice, RigEvent, Scenario, Truth, Vector
from updater import Body

#: positions of the T-frame's six accelerometers, and their analysed axes
T_DEVICES: dict[str, tuple[Vector, str]] = {
    "col_037": ((0.0, 0.0, 0.37), "xy"),
    "col_074": ((0.0, 0.0, 0.74), "xy"),
    "col_111": ((0.0, 0.0, 1.11), "xy"),
    "beam_mid": ((0.0, 0.0, 1.48), "xy"),
    "beam_left": ((-0.40, 0.0, 1.48), "yz"),
    "beam_right": ((0.40, 0.0, 1.48), "yz"),
}
#: accelerometers on a CAN bus, and their ids; the others have serial ports
T_NODES = {"beam_left": 2, "beam_right": 3}
#: possible positions of a body: the whole crossbeam, and the column above 0.5 m
_STRETCHES: tuple[tuple[Vector, Vector], ...] = (
    ((-0.40, 0.0, 1.48), (0.40, 0.0, 1.48)),
    ((0.0, 0.0, 0.50), (0.0, 0.0, 1.48)),
)
_N_MODES = 24
_STEEL = 7850.0  # kg/m3, of the bodies


def draw_t_frame(
    structure: str, seed: int, *, duration: float, between: tuple[float, float] | None, rate: float = 1000.0
) -> Scenario:
    """Draw a T-frame that is never the nominal one, and a body of 150 to 300 g that is added to it.

    Every quantity is uniform in its range: E and G within 2 %, density within 1 %, foot and joint flexibilities
    0.002 to 0.01 L / (E I) about each axis (they lower frequencies by the order of 1 %), damping 0.2 to 1 % of
    critical, device clocks within 20 ppm; ambient forces are log-uniform over a factor of two. Gains scatter by 0.5 %.

    Parameters
    ----------
    structure : path of its file, or "t_structure"
    seed : draws everything
    duration : [s]
    between : times between which the body is added [s]; None for a rig to which nothing happens
    rate : of the devices [Hz]

    Raises
    ------
    ValueError
        If `between` is not two ascending times within the duration.
    """
    if between is not None and not 2 <= between[0] <= between[1] <= (duration or np.inf):
        raise ValueError(f"between: expected two ascending times from 2 s to {duration:g} s, found {between}")
    random = np.random.default_rng((seed, 0))
    truth = _draw_truth(random)
    errors = random.uniform(-20e-6, 20e-6, len(T_DEVICES)).tolist()
    devices = [
        RigDevice(name=n, at=at, clock_error=e, node=T_NODES.get(n))
        for (n, (at, _)), e in zip(T_DEVICES.items(), errors, strict=True)
    ]
    body = _draw_body(random)
    events = () if between is None else (RigEvent(at=float(random.uniform(*between)), body=body),)
    return Scenario(
        structure=structure,
        seed=seed,
        rate=rate,
        duration=duration,
        device=tuple(devices),
        truth=truth,
        event=events,
        answer="mass",
    )


def _draw_truth(random: np.random.Generator) -> Truth:
    return Truth(
        stiffness_factor=float(random.uniform(0.98, 1.02)),
        density_factor=float(random.uniform(0.99, 1.01)),
        foot_flexibility=_vector(random.uniform(0.002, 0.01, 3)),
        joint_flexibility=_vector(random.uniform(0.002, 0.01, 3)),
        damping=tuple(random.uniform(0.002, 0.01, _N_MODES).tolist()),
        force_density=float(3e-9 * 2 ** random.uniform()),
    )


def _draw_body(random: np.random.Generator) -> Body:
    """Draw a steel block on the stretches, uniformly, with its centre 1 to 2 cm off the axis."""
    place, along = _draw_place(random)
    mass = float(random.uniform(0.150, 0.300))
    edge2 = (mass / _STEEL) ** (2 / 3) * random.uniform(0.7, 1.3, 3)  # m2, of a block not quite a cube
    angle = random.uniform(0, 2 * np.pi)
    axis = int(np.argmax(np.abs(along)))
    across = np.eye(3)[[(axis + 1) % 3, (axis + 2) % 3]]
    offset = random.uniform(0.01, 0.02) * np.array([np.cos(angle), np.sin(angle)]) @ across
    inertia = mass * (edge2.sum() - edge2) / 12
    return Body(at=_vector(place), mass=mass, offset=_vector(offset), inertia=_vector(inertia))


def _draw_place(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a point on the stretches [m] and the direction of its stretch."""
    ends = np.array(_STRETCHES)
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    which = int(random.choice(len(ends), p=length / length.sum()))
    return ends[which, 0] + random.uniform() * along[which], along[which] / length[which]


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
