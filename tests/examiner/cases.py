"""Cells of the confusion matrix: detectable causes, undetectable ones, pairs, changes outside the catalogue."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2, ncx2

from daq import FloatArray
from oma.selection import uncertainty_law
from tests.examiner import draws
from tests.examiner import sensor_chain as chain
from tests.examiner.designs import DESIGNS
from tests.examiner.draws import Do, Done, Hidden
from tests.examiner.models.bar import Vector, Zone
from tests.examiner.models.specimen import Random, State, draw_state
from tests.examiner.outside_causes import OUTSIDE
from tests.examiner.signals import N_MODES, is_seen, modal_std
from tests.examiner.solid_draws import SOLID, draw_bar
from tests.examiner.structure_file import FILE, Coarse, draw_as_filed, draw_mesh

CAUSES: dict[str, Do] = {
    do.__name__: do
    for do in (
        draws.added_mass,
        draws.distributed_mass,
        draws.local_stiffness,
        draws.support_stiffness,
        draws.joint_stiffness,
        draws.support_spring,
        draws.axial_force,
        draws.member_temperature,
        draws.attached_oscillator,
        draws.ground_mode,
        draws.global_stiffness,
        draws.global_density,
        draws.temperature,
        draws.sampling_clock,
        draws.damping_change,
        draws.amplitude_softening,
        chain.sensor_gain,
        chain.sensor_polarity,
        chain.sensor_swap,
        chain.sensor_orientation,
        chain.sensor_position,
        chain.sensor_delay,
        chain.sensor_dead,
    )
}
ONE_SIDED = "one_sided"  #: a stretch about one axis: another draw of a cause
#: likewise: exchanged devices, a turned device, a mass at a sensor
OF_DEVICES: dict[str, Do] = {do.__name__: do for do in (chain.exchanged_devices, chain.turned_device, chain.cable_mass)}
_DONE: dict[str, Do] = {**CAUSES, ONE_SIDED: draws.one_sided, **OF_DEVICES}
PAIRS = (
    "added_mass + sensor_gain",
    "added_mass + support_stiffness",
    "added_mass + sensor_polarity",
    "added_mass + added_mass",
    "local_stiffness + sensor_gain",
    "support_stiffness + sensor_swap",
    "local_stiffness + added_mass",
    f"{ONE_SIDED} + added_mass",
    f"{ONE_SIDED} + sensor_gain",
    "added_mass + sensor_position",
)
TRIPLES = (
    "added_mass + added_mass + local_stiffness",
    "added_mass + added_mass + sensor_polarity",
    "added_mass + local_stiffness + sensor_gain",
    "added_mass + support_stiffness + sensor_gain",
    "local_stiffness + support_stiffness + added_mass",
)
FILES = tuple(f"file: {name}" for name in FILE)
_DESIGNS = tuple(name for name in DESIGNS if name != "storeys")  # its draws take a minute each: by `--cells`
_OF_ANY_FILE = (
    *("nothing", "added_mass", "local_stiffness", "sensor_gain", "sensor_polarity", "sensor_swap", "sensor_position"),
    ONE_SIDED,
)
BUILT, FAR = (
    tuple(f"{how} {where}: {name}" for where in ("frame", *_DESIGNS) for name in _OF_ANY_FILE)
    for how in ("built", "far")
)
SOLIDS = tuple(f"solid: {name}" for name in SOLID)
_ON_THE_T_FRAME = {"joint_stiffness", "axial_force", "member_temperature", "amplitude_softening"}
_ANYWHERE = (
    *(name for name in CAUSES if name not in _ON_THE_T_FRAME),
    *(ONE_SIDED, "nothing", "small", "added_mass + sensor_gain", "local_stiffness + added_mass"),
    *(name for name in OUTSIDE if name not in {"braced", "sliding"}),
)
ELSEWHERE = (
    *(
        f"{design}: {name}"
        for design in _DESIGNS
        for name in _ANYWHERE
        if f"{design}: {name}" != "grid: support_stiffness"
    ),
    "portal: joint_stiffness",
    *(f"{design}: member_temperature" for design in ("portal", "mast")),
)  #: the grid's supports are rigid, and its members hardly differ by their temperature; the bridge has one member
CELLS = (*CAUSES, ONE_SIDED, *OF_DEVICES, "nothing", "small", *PAIRS, *TRIPLES, *OUTSIDE, *SOLIDS, *FILES)
N_BEFORE, N_AFTER = 8, 5  # windows
_COMMON = (
    3e-3  # of all frequencies together, that a day may bring: not to be distinguished from a global cause this small
)
_TOGETHER = 3.0  # components of a shape that err as one
_LEVEL, _POWER = 0.01, 0.99
_HARDLY = 0.03
_BEYOND_FILES = 0.03  # of ln f of some mode: too much for a file that is off by a per cent here and there
_DISTINCT = 0.4  # m of the T-frame
_NEAR = 0.10  # likewise


@dataclass(frozen=True, kw_only=True)
class Case:
    """One draw of a cell."""

    cell: str
    kind: str  #: "detectable", "nothing", "small", "two", "three" or "outside"
    seed: int
    done: Done
    coarse: Coarse | None = None  #: the mesh of the structure file, if it is another than the shipped one

    @property
    def near(self) -> float:
        """Return the largest error of a stated position [m]: a cause that is named farther away is another one."""
        return _NEAR * self.done.before.scale.length

    @property
    def built(self) -> bool:
        """Return whether nothing was measured before: the file, with errors everywhere, is the only knowledge."""
        return self.cell.startswith(("built ", "far "))

    @property
    def far(self) -> float:
        """Return how many times too stiff all materials of the file are: 0.74 to 1.35, and by 15 % at least, or 1."""
        if not self.cell.startswith("far "):
            return 1.0
        random = np.random.default_rng((self.seed, 7))
        return float(np.exp(random.choice((-1, 1)) * random.uniform(0.15, 0.3)))


def draw(cell: str, seed: int, *, noise: str = "law") -> Case:
    """Draw a case of a cell, its specimen included; `cell` names a cause, "nothing", "small", "a + b" or an outsider.

    Before it "solid: " or a design's name, such as "bridge: ", names another specimen than the T-frame; "file: " is an
    error of the structure file of a specimen that otherwise agrees with it, "built bridge: " or "built frame: " of one
    that does not, "far bridge: " of one that is far from it.

    Raises
    ------
    RuntimeError
        If a hundred draws have none of the size that the cell requires.
    """
    random = np.random.default_rng((seed, 5))
    if cell.startswith("file: "):
        return _of_file(cell, seed, random, noise)
    which, _, name = cell.rpartition(": ")
    how, _, where = which.rpartition(" ")
    state, causes = specimen(where.removeprefix("frame"), seed)
    if how and name != "nothing":
        return Case(cell=cell, kind="detectable", seed=seed, done=_as_built(causes[name], state, random, noise))
    if name == "nothing":
        return Case(cell=cell, kind="nothing", seed=seed, done=draws.nothing(state, random))
    if name == "small":
        return Case(cell=cell, kind="small", seed=seed, done=_small(state, random, noise))
    if name in OUTSIDE:
        return Case(cell=cell, kind="outside", seed=seed, done=_large(OUTSIDE[name], state, random, noise))
    if "+" in name:
        several = [causes[one] for one in name.split(" + ")]
        kind = {2: "two", 3: "three"}[len(several)]
        return Case(cell=cell, kind=kind, seed=seed, done=_together(several, state, random, noise))
    return Case(cell=cell, kind="detectable", seed=seed, done=_large(causes[name], state, random, noise))


def specimen(which: str, seed: int) -> tuple[State, dict[str, Do]]:
    """Return a specimen, and the possible changes of it."""
    if which == "solid":
        return draw_bar(seed), SOLID
    return (DESIGNS[which].draw(seed) if which else draw_state(seed)), _DONE


def _of_file(cell: str, seed: int, random: Random, noise: str) -> Case:
    """Draw an error of the file; a body removed before was never in it."""
    name, state = cell.removeprefix("file: "), draw_as_filed(seed)
    if name == "nothing":
        return Case(cell=cell, kind="nothing", seed=seed, done=draws.nothing(state, random))
    if name == "mesh_error":
        done = Done(state, state, (Hidden(cause="mesh_error"),))
        return Case(cell=cell, kind="detectable", seed=seed, done=done, coarse=draw_mesh(seed))
    done = _large(FILE[name], state, random, noise)
    while done.before is not state:
        done = _large(FILE[name], state, random, noise)
    return Case(cell=cell, kind="detectable", seed=seed, done=done)


def _large(do: Do, state: State, random: Random, noise: str) -> Done:
    return _drawn(lambda: do(state, random), lambda power: power >= _POWER, noise)


def _as_built(do: Do, state: State, random: Random, noise: str) -> Done:
    """Make a change beyond the small errors of a file; nothing is removed that was never in it."""
    while True:
        done = _large(do, state, random, noise)
        f, g = (one.claimed_frequency(N_MODES) for one in (done.before, done.after))
        if done.before is state and (done.hidden[0].channels or np.abs(np.log(g / f)).max() > _BEYOND_FILES):
            return done


def _small(state: State, random: Random, noise: str) -> Done:
    """A hundredth of the usual size of a mass, a loss, a gain or a foot."""

    def one() -> Done:
        names = ("added_mass", "local_stiffness", "support_stiffness", "sensor_gain", "support_spring")
        done = CAUSES[names[int(random.integers(len(names)))]](state, random)
        return _fainter(done, 10 ** random.uniform(-3, -1.5))

    return _drawn(one, lambda power: power <= _HARDLY, noise)


def _fainter(done: Done, share: float) -> Done:
    """Return the same with a share of the change: a state between, in mass, stiffness and gain."""
    before, after = done.before, done.after
    gain = before.gain + share * (after.gain - before.gain)
    one, other = before.frame, after.frame
    bars = tuple(
        replace(b, zones=tuple(z if z in a.zones else _thinner(z, share) for z in b.zones))
        for a, b in zip(one.bars, other.bars, strict=True)
    )
    new = [lump for lump in other.lumps if lump not in one.lumps]
    old = [lump for lump in one.lumps if lump not in other.lumps]
    lumps = (
        *(lump for lump in one.lumps if lump not in old),
        *(replace(lump, mass=lump.mass * share, inertia=_times(lump.inertia, share)) for lump in new),
        *(replace(lump, mass=lump.mass * (1 - share), inertia=_times(lump.inertia, 1 - share)) for lump in old),
    )
    grounds = tuple(
        replace(b, along=_between(a.along, b.along, share), about=_between(a.about, b.about, share))
        for a, b in zip(one.grounds, other.grounds, strict=True)
    )
    props = tuple(replace(p, stiffness=p.stiffness * share) for p in other.props)
    frame = replace(other, bars=bars, lumps=lumps, grounds=grounds, props=props)
    return Done(before, replace(after.of_frame(frame), gain=gain), done.hidden)


def _between(one: Vector, other: Vector, share: float) -> Vector:
    """Stiffness of a spring whose flexibility is that share of the way from one to the other."""
    x, y, z = (a if a == b else 1 / (1 / a + share * (1 / b - 1 / a)) for a, b in zip(one, other, strict=True))
    return x, y, z


def _times(inertia: tuple[float, float, float], share: float) -> tuple[float, float, float]:
    x, y, z = (i * share for i in inertia)
    return x, y, z


def _thinner(zone: Zone, share: float) -> Zone:
    left = {key: 1 + share * (getattr(zone, key) - 1) for key in ("bend1", "bend2", "twist")}
    return replace(zone, mass=zone.mass * share, **left)


def _together(several: Sequence[Do], state: State, random: Random, noise: str) -> Done:
    """Do several, each of which can be detected after those before it; nothing is taken off."""
    while True:
        made = Done(state, state, ())
        for do in several:
            one = _large(do, made.after, random, noise)
            if one.before is not made.after or not all(_apart(h, one.hidden[0], state) for h in made.hidden):
                break
            made = Done(state, one.after, made.hidden + one.hidden)
        else:
            return made


def _apart(one: Hidden, two: Hidden, state: State) -> bool:
    """Two masses side by side are one, or one that is spread."""
    if one.cause != two.cause or one.position is None or two.position is None:
        return True
    return float(np.linalg.norm(np.subtract(one.position, two.position))) > _DISTINCT * state.scale.length


def _drawn(one: Callable[[], Done], wanted: Callable[[float], bool], noise: str) -> Done:
    for _ in range(100):
        done = one()
        if wanted(detection_power(done, noise)):
            return done
    raise RuntimeError("a hundred draws brought none of the size that is wanted")


def detection_power(done: Done, noise: str = "law") -> float:
    """Return how often a chi-square test of all data at a level of 1 % detects that something has changed.

    Frequencies, complex shapes and damping of the modes in the band, with the noise of 8 windows before and 5 after.
    For a change with a position, the common part of all frequencies counts only beyond 0.3 %.
    """
    n_modes = N_MODES
    before, after = done.before, done.after
    f, g = before.claimed_frequency(n_modes), after.claimed_frequency(n_modes)
    u, v = _heard(before, n_modes), _heard(after, n_modes)
    mac = np.abs(u.conj() @ v.T) ** 2
    chain_alone = done.before.body is done.after.body and before.clock == after.clock
    cost = np.abs(np.log(f[:, None] / g)) * 10 + (0 if chain_alone else 1 - mac)
    mode, partner = linear_sum_assignment(cost)
    kept = is_seen(before, n_modes)[mode]
    mode, partner = mode[kept], partner[kept]
    share = 1 / N_BEFORE + 1 / N_AFTER
    std, shape_std = modal_std(before, n_modes, noise)
    ratio = np.log(g[partner] / f[mode])
    whole = all(one.position is None and not one.channels for one in done.hidden) and bool(done.hidden)
    covariance = np.diag(share * std[mode] ** 2) + (0.0 if whole else _COMMON**2)
    turn = np.sum(u[mode].conj() * v[partner], axis=1)
    apart = v[partner] * (turn.conj() / np.abs(turn))[:, None] - u[mode]
    damping = np.log(after.modal_damping(n_modes)[partner] / before.modal_damping(n_modes)[mode])
    damping_std = _damping_std(before, mode)
    noncentrality = (
        float(ratio @ np.linalg.solve(covariance, ratio))
        + float((np.abs(apart) ** 2).sum()) / (share * shape_std**2 * _TOGETHER)
        + float((damping**2 / damping_std**2).sum()) / share * (not np.array_equal(after.damping, before.damping))
    )
    freedom = len(mode) * (1 + len(before.channels) / _TOGETHER)
    return float(ncx2.sf(chi2.isf(_LEVEL, freedom), freedom, max(noncentrality, 1e-9)))


def _heard(state: State, n_modes: int) -> FloatArray:
    """Complex unit shapes (n_modes, n_channels), delays included."""
    frequency, shape = state.claimed_frequency(n_modes), state.claimed_shape(n_modes)
    turned = shape * np.exp(-2j * np.pi * frequency[:, None] * state.delay[state.order])
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def _damping_std(state: State, mode: np.ndarray) -> FloatArray:
    frequency, damping = state.motion(N_MODES).frequency, state.modal_damping(N_MODES)
    return np.array([uncertainty_law(frequency[i], damping[i], state.scale.window)[1] / damping[i] for i in mode])
