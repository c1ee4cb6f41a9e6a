"""A measured cantilever with six masses in 35 layouts, and possible errors of its simulation.

Deflections in z of a strip along x, clamped at x = 0. Every mass is relative to the beam's, every flexibility to L / (E
I) or L^3 / (E I), since width and material of the beam are not documented: bending frequencies determine E / density,
and masses only relative to the beam's.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

from daq import FloatArray, IndexArray
from oma import fit_resonance
from updater import Body, Structure, build_model, dump_structure, parse_structure
from updater.reference import Prior, SensitivityFit, fit_parameters
from updater.structure import Support, Updating

LENGTH, THICKNESS = 0.38, 4.75e-3  # m, documented
BANDS = ((17.0, 30.0), (125.0, 152.0), (345.0, 420.0), (690.0, 800.0), (1060.0, 1240.0))  # Hz, a mode each
ALL = slice(None)
LABELS = tuple(f"L{k}" for k in range(1, 7))
FIT_ERROR = np.array([3e-4, 1e-4, 1e-4, 1e-4, 1e-4])  # standard deviation of a frequency in the fit of one response
MODEL_ERROR = 5e-3  # of ln f, a mode, alike in all layouts: what no beam on a point-like clamp says better
_RIGID = 1e-6  # the least flexibility of the clamp
_KEPT = 20  # bending modes
_SOLVED = ("clamp_shifts", "clamp_turns", "accelerometer", "accelerometer_gyration", "near_clamp", "near_clamp_at")
_SIGHT = 1e-4  # of a prior's deviation: step of the slopes

BEAM = f"""
name = "cantilever"
[mesh]
element_length = 0.0076
[material.metal]                      # E / density is that of steel too, within 3 %
youngs_modulus = 70e9
poisson_ratio = 0.33
density = 2700
[section.strip]
shape = "rectangle"
width = 0.04                          # not documented: a guess that no bending frequency depends on
height = {THICKNESS}
[[member]]
name = "beam"
from = [0, 0, 0]
to = [{LENGTH}, 0, 0]
material = "metal"
section = "strip"
[[support]]
at = [0, 0, 0]
fixed = ["x", "y", "z", "rx", "ry", "rz"]
[[sensor]]
channel = "tip_z"
at = [{LENGTH}, 0, 0]
direction = [0, 0, 1]
[[sensor]]
channel = "middle_z"                  # nothing was there: with frequencies alone it only says which way modes bend
at = [{LENGTH / 2}, 0, 0]
direction = [0, 0, 1]
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Layouts:
    """The measurements: all six masses on, and one of them removed."""

    place: FloatArray  #: (n, 6) of the masses, from the clamp [m]
    before: FloatArray  #: (n, 5) all on [ln Hz]
    after: FloatArray  #: (n, 5) one off [ln Hz]

    def only(self, rows: IndexArray) -> "Layouts":
        """Return some of the layouts."""
        return Layouts(place=self.place[rows], before=self.before[rows], after=self.after[rows])

    @property
    def mean(self) -> FloatArray:
        """(n, 5) of both states [ln Hz]; its noise and that of the shift are independent."""
        return (self.before + self.after) / 2

    @property
    def shift(self) -> FloatArray:
        """(n, 5) by taking the mass off [-]."""
        return self.after - self.before

    def noise(self) -> tuple[FloatArray, FloatArray]:
        """Return deviations (5,) of `mean` and of `shift` that no mass's place explains, to first order in places.

        Layouts were mounted again each time: their scatter is a hundred times the deviation of each frequency's fit. It
        is estimated without any beam model, so that no hypothesis affects its own noise.
        """
        columns = np.column_stack([np.ones(len(self.place)), self.place - self.place.mean(axis=0)])
        found = []
        for values in (self.mean, self.shift):
            rest = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
            found.append(np.sqrt((rest**2).sum(axis=0) / (len(rest) - columns.shape[1])))
        return found[0], found[1]


def read_layouts(folder: Path, rows: slice = ALL, *, state: str = "2.96") -> Layouts:
    """Read the frequency responses of some layouts before and after, and fit the five modes to each.

    Parameters
    ----------
    folder : of the data
    rows : layouts
    state : the authors' label of the removed masses: 2.96 per cent of mass, one of the six, or 5.92, two
    """
    place = np.loadtxt(folder / "mass_positions_cm.csv", delimiter=",", skiprows=1)[rows, 1:] / 100
    data = np.load(folder / "frf.npz")
    line, states = data["freq_hz"].astype(float), []
    for name in ("healthy", f"loss{state}"):
        phase = np.radians(data[f"{name}_phase_deg"].astype(float))
        response = (10 ** (data[f"{name}_mag_db"].astype(float) / 20) * np.exp(1j * phase))[rows]
        states.append([[np.log(fit_resonance(line, r[:, None], band).frequency) for band in BANDS] for r in response])
    return Layouts(place=place, before=np.array(states[0]), after=np.array(states[1]))


def write_bodies_file(folder: Path, beam: "Cantilever", values: Mapping[str, float], measured: Layouts) -> Path:
    """Write the files of `modalwatch bodies`: the beam without its six masses, and all layouts as records.

    Parameters
    ----------
    folder : that gets beam.toml and bodies.toml
    beam, values : the model and its parameters, which the program must not fit again to each layout
    measured : layouts
    """
    bare = beam.written_out(values, np.zeros(6), np.zeros(6)).model_copy(update={"updating": Updating(fixed=("*",))})
    (folder / "beam.toml").write_text(dump_structure(bare), encoding="utf-8")
    lines = ['structure = "beam.toml"']
    lines += [f'[[body]]\nname = "{label}"\nmass = {values["mass"] * beam.beam}' for label in LABELS]
    for place, before, after in zip(measured.place, measured.before, measured.after, strict=True):
        lines += [f"[[record]]\nat = {[[x, 0.0, 0.0] for x in place.tolist()]}"]
        for state, log_frequency in (("before", before), ("after", after)):
            frequency = np.exp(log_frequency)
            lines += [f"{state} = {frequency.tolist()}", f"{state}_std = {(FIT_ERROR * frequency).tolist()}"]
    path = folder / "bodies.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def share_explained(measured: Layouts) -> FloatArray:
    """Return the share (6, 5) of each shift's scatter over layouts that a parabola in each mass's place explains.

    No model is used: the removed mass is the one whose position determines the shift.
    """
    found = []
    for place in measured.place.T:
        columns = np.vander(place - place.mean(), 3)
        rest = measured.shift - columns @ np.linalg.lstsq(columns, measured.shift, rcond=None)[0]
        found.append(1 - rest.var(axis=0) / measured.shift.var(axis=0))
    return np.array(found)


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A parameter before anything is measured."""

    mean: float
    std: float
    lower: float = -np.inf
    upper: float = np.inf


#: ln (E / density); each mass in beams (documented: 2.96 % of all that moves comes off); then what may be wrong
UNKNOWN = {
    "stiffness": Unknown(mean=0.0, std=0.05),
    "mass": Unknown(mean=0.036, std=0.01, lower=1e-3),
    "clamp_turns": Unknown(mean=0.0, std=0.1, lower=0.0),  # L / (E I)
    "clamp_shifts": Unknown(mean=0.0, std=1e-3, lower=0.0),  # L^3 / (E I)
    "accelerometer": Unknown(mean=0.0, std=0.05, lower=0.0),  # beams
    "accelerometer_gyration": Unknown(mean=0.0, std=0.01, lower=0.0),  # m
    "near_clamp": Unknown(mean=0.0, std=0.2, lower=0.0),  # beams, of whatever moves with the beam there
    "near_clamp_at": Unknown(mean=0.03, std=0.03, lower=0.0, upper=0.1),  # m
    "offset": Unknown(mean=0.0, std=0.005),  # m, of all places: an edge measured in the place of the middle
    "gyration": Unknown(mean=0.0, std=0.01, lower=0.0),  # m, of each mass
    "stiffens": Unknown(mean=0.0, std=0.005),  # L / (E I) less at each mass: glue, a bolted foot
}
PLAIN = ("stiffness", "mass")
#: what may be added to the plain beam: words, parameters
EXTENSIONS = {
    "the clamp turns": ("clamp_turns",),
    "the clamp shifts": ("clamp_shifts",),
    "the accelerometer's mass": ("accelerometer",),
    "its rotary inertia too": ("accelerometer", "accelerometer_gyration"),
    "a body near the clamp": ("near_clamp", "near_clamp_at"),
    "places are off by a constant": ("offset",),
    "the masses' rotary inertia": ("gyration",),
    "the masses stiffen the beam": ("stiffens",),
}


class Cantilever:
    """The beam model and its frequencies under any values of the parameters.

    Bending in z is independent of all else. The matrices of the model without supports are used; clamp, accelerometer
    and near_clamp are written into them and solved, the masses are then low rank in the modes.
    """

    def __init__(self) -> None:
        self.structure = parse_structure(BEAM)
        metal, strip = self.structure.material["metal"], self.structure.section["strip"]
        self.rigidity = metal.youngs_modulus * strip.second_moment[0]  # about y
        self.beam = metal.density * strip.area * LENGTH  # kg
        soft = dict.fromkeys(("z", "ry"), 1.0)  # taken out again: a support must hold
        model = build_model(self._held(soft), shear_flexible=True, mass="consistent")
        order = np.argsort(model.nodes[:, 0])
        dofs = model.dofs[order][:, [2, 4]].ravel()  # z and ry of each node, from the clamp
        self._x = model.nodes[order, 0]
        self._mass = model.mass[dofs][:, dofs].toarray()
        self._stiffness = model.stiffness[dofs][:, dofs].toarray()
        self._stiffness[[0, 1], [0, 1]] -= 1.0
        self._solved = lru_cache(4)(self._solve)

    def _held(self, springs: Mapping[str, float]) -> Structure:
        fixed = [axis for axis in ("x", "y", "z", "rx", "ry", "rz") if axis not in springs]
        support = Support.model_validate({"at": (0, 0, 0), "fixed": fixed, "stiffness": dict(springs)})
        return self.structure.model_copy(update={"support": (support,)})

    def _solve(
        self, shifts: float, turns: float, tip: float, gyration: float, near_clamp: float, near_clamp_at: float
    ) -> tuple[FloatArray, CubicSpline, CubicSpline]:
        """Return angular frequencies (n_modes,), deflections and rotations along the beam without its six masses."""
        stiffness, mass = self._stiffness.copy(), self._mass.copy()
        stiffness[0, 0] += self.rigidity / LENGTH**3 / max(shifts, _RIGID**2)
        stiffness[1, 1] += self.rigidity / LENGTH / max(turns, _RIGID)
        mass[-2, -2] += self.beam * tip
        mass[-1, -1] += self.beam * tip * gyration**2
        row = self._reads(near_clamp_at)
        mass += self.beam * near_clamp * np.outer(row, row)
        square, shape = eigh(stiffness, mass, subset_by_index=(0, _KEPT - 1))
        return np.sqrt(square), CubicSpline(self._x, shape[::2]), CubicSpline(self._x, shape[1::2])

    def _reads(self, at: float) -> FloatArray:
        """Return the row that reads the deflection at a place, by Hermite's cubics; dz/dx = -ry."""
        element = min(int(np.searchsorted(self._x, at, side="right")) - 1, len(self._x) - 2)
        length = self._x[element + 1] - self._x[element]
        s = (at - self._x[element]) / length
        row = np.zeros(len(self._mass))
        row[2 * element : 2 * element + 4] = (
            1 - 3 * s**2 + 2 * s**3,
            -length * s * (1 - s) ** 2,
            3 * s**2 - 2 * s**3,
            length * s**2 * (1 - s),
        )
        return row

    def log_frequency(self, values: Mapping[str, float], place: FloatArray, on: FloatArray) -> FloatArray:
        """Return ln of the first five frequencies (n, 5) with masses at places (n, 6), those of `on` (6,) fixed."""
        v = dict.fromkeys(UNKNOWN, 0.0) | dict(values)
        omega, deflection, turn = self._solved(*(v[name] for name in _SOLVED))
        at = np.clip(place + v["offset"], 0, LENGTH)
        root = np.diag(1 / omega)
        if v["stiffens"]:
            moment = self.rigidity * turn(at, 1) / omega**2  # of each mode at the masses
            less = np.einsum("j,njr,njs->nrs", on, moment, moment) * v["stiffens"] * LENGTH / self.rigidity
            root = np.linalg.cholesky(np.diag(omega**-2.0) - less)
        moved, turned = deflection(at), v["gyration"] * turn(at)
        mass = np.einsum("j,njr,njs->nrs", on, moved, moved) + np.einsum("j,njr,njs->nrs", on, turned, turned)
        whole = np.eye(_KEPT) + self.beam * v["mass"] * mass
        found = np.linalg.eigvalsh(np.swapaxes(root, -1, -2) @ whole @ root)
        lowest = found[:, ::-1][:, : len(BANDS)]
        return np.asarray(-0.5 * np.log(lowest) - np.log(2 * np.pi) + v["stiffness"] / 2)

    def written_out(self, values: Mapping[str, float], place: FloatArray, on: FloatArray) -> Structure:
        """Return one layout, places (6,), as a structure with everything written in."""
        v = dict.fromkeys(UNKNOWN, 0.0) | dict(values)
        stiffer = float(np.exp(v["stiffness"]))
        springs = {}
        if v["clamp_shifts"]:
            springs["z"] = stiffer * self.rigidity / LENGTH**3 / v["clamp_shifts"]
        if v["clamp_turns"]:
            springs["ry"] = stiffer * self.rigidity / LENGTH / v["clamp_turns"]
        bodies = [
            self._as_body(x + v["offset"], v["mass"], v["gyration"]) for x in place[np.asarray(on, bool)].tolist()
        ]
        if v["accelerometer"]:
            bodies.append(self._as_body(LENGTH, v["accelerometer"], v["accelerometer_gyration"]))
        if v["near_clamp"]:
            bodies.append(self._as_body(v["near_clamp_at"], v["near_clamp"], 0.0))
        metal = self.structure.material["metal"]
        stiffened = metal.model_copy(
            update={name: stiffer * getattr(metal, name) for name in ("youngs_modulus", "shear_modulus")}
        )
        return self._held(springs).model_copy(update={"material": {"metal": stiffened}, "body": tuple(bodies)})

    def _as_body(self, at: float, mass: float, gyration: float) -> Body:
        kilograms = self.beam * mass
        return Body(at=(at, 0.0, 0.0), mass=kilograms, inertia=(0.0, kilograms * gyration**2, 0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Hypothesis:
    """Parameters that are free, and the mass that was taken off."""

    free: tuple[str, ...]
    off: int  #: 0..5

    @property
    def states(self) -> tuple[FloatArray, FloatArray]:
        """Masses that are on (6,), before and after."""
        return np.ones(6), (np.arange(6) != self.off).astype(float)


class Misfit:
    """Whitened difference of a hypothesis from the measurement."""

    def __init__(
        self,
        beam: Cantilever,
        hypothesis: Hypothesis,
        measured: Layouts,
        noise: tuple[FloatArray, FloatArray],
        model_error: float = MODEL_ERROR,
    ) -> None:
        self._beam, self._hypothesis, self._measured, self._noise = beam, hypothesis, measured, noise
        # a model error common to n layouts: (1 + n b^2 / s^2)^-1/2 in the mean's direction, one elsewhere
        self._common = 1 / np.sqrt(1 + len(measured.place) * (model_error / noise[0]) ** 2) - 1

    def differences(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return measured less predicted mean and shift (n, 5)."""
        values = dict(zip(self._hypothesis.free, x.tolist(), strict=True))
        before, after = (self._beam.log_frequency(values, self._measured.place, on) for on in self._hypothesis.states)
        return self._measured.mean - (before + after) / 2, self._measured.shift - (after - before)

    def residual(self, x: FloatArray) -> FloatArray:
        """Return (10 n,)."""
        mean, shift = self.differences(x)
        mean = mean / self._noise[0]
        return np.concatenate([(mean + self._common * mean.mean(axis=0)).ravel(), (shift / self._noise[1]).ravel()])

    def slope(self, x: FloatArray) -> FloatArray:
        """Return (10 n, n_parameters)."""
        here, columns = self.residual(x), []
        for k, name in enumerate(self._hypothesis.free):
            step = np.zeros(len(x))
            step[k] = _SIGHT * UNKNOWN[name].std
            columns.append((self.residual(x + step) - here) / step[k])
        return np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Fitted:
    """A hypothesis with its parameters."""

    hypothesis: Hypothesis
    values: dict[str, float]
    std: dict[str, float]
    log_evidence: float
    chi_square: float  #: of data and priors


def fitted(
    beam: Cantilever,
    hypothesis: Hypothesis,
    measured: Layouts,
    noise: tuple[FloatArray, FloatArray] | None = None,
    *,
    starts: int = 4,
    near: Mapping[str, float] | None = None,
    model_error: float = MODEL_ERROR,
) -> Fitted:
    """Fit from several starts drawn from the prior, seeds 0 .. starts - 1; the lowest cost counts.

    `near` are parameters that the first start takes over, so that more parameters never fit worse.
    """
    misfit = Misfit(beam, hypothesis, measured, noise or measured.noise(), model_error)
    prior = [UNKNOWN[name] for name in hypothesis.free]
    found: list[SensitivityFit] = []
    for seed in range(starts):
        random = np.random.default_rng(seed)
        start = {n: UNKNOWN[n].mean + 0.5 * UNKNOWN[n].std * abs(random.standard_normal()) for n in hypothesis.free}
        start |= near if near and seed == 0 else {}
        found.append(
            fit_parameters(
                misfit,
                Prior(
                    mean=np.array([u.mean for u in prior]),
                    std=np.array([u.std for u in prior]),
                    lower=np.array([u.lower for u in prior]),
                    upper=np.array([u.upper for u in prior]),
                    start=np.array(list(start.values())),
                ),
            )
        )
    best = min(found, key=lambda f: f.chi_square)
    names = hypothesis.free
    return Fitted(
        hypothesis=hypothesis,
        values=dict(zip(names, best.value.tolist(), strict=True)),
        std=dict(zip(names, best.std.tolist(), strict=True)),
        log_evidence=best.log_evidence,
        chi_square=best.chi_square,
    )
