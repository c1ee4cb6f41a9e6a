"""Results as the monitoring loop would give them, made from a finite element model and first-order perturbation."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from daq import Channel as RecordedChannel
from daq import FloatArray, Recording
from monitor.results.run_results import RunResults
from monitor.results.windows import (
    AlarmResult,
    Interval,
    MassAnswer,
    ModeResult,
    Novelty,
    Phase,
    ProfilePoint,
    ReferenceMode,
    ReferenceResult,
    Spectrum,
    WindowResult,
)
from updater import Model, build_model, parse_structure, t_structure_toml
from updater.quantities import Vector

START = 1_767_225_600_000_000_000  # 2026-01-01 00:00 UTC [ns]
WINDOW = 40_000_000_000  # [ns]
LIMIT = 5.5
FREQUENCY_STD = 4e-4  # of a frequency in one window, relative
DAMPING = 0.005

BRIDGE = """
name = "footbridge"
[material.steel]
youngs_modulus = 210e9
shear_modulus = 80.8e9
density = 7850
[section.box]
area = 0.02
second_moment = [2e-4, 1e-4]
torsion_constant = 2e-4
[[member]]
name = "deck"
from = [0.0, 0.0, 3.0]
to = [18.0, 6.0, 3.0]
material = "steel"
section = "box"
elements = 24
[[support]]
at = [0.0, 0.0, 3.0]
fixed = ["x", "y", "z", "rx"]
[[support]]
at = [18.0, 6.0, 3.0]
fixed = ["x", "y", "z", "rx"]
[[sensor]]
channel = "mid"
at = [9.0, 3.0, 3.0]
direction = [0, 0, 1]
[[sensor]]
channel = "quarter"
at = [4.5, 1.5, 3.0]
direction = [0, 0, 1]
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Site:
    """A structure, an added mass, and the monitor's results window by window."""

    text: str = field(default_factory=t_structure_toml)
    n_modes: int = 6
    place: Vector = (0.25, 0.0, 1.48)  #: a node, where the mass comes [m]
    mass: float = 0.212  #: [kg]
    seed: int = 1

    @cached_property
    def model(self) -> Model:
        """Model of the reported modes."""
        return build_model(parse_structure(self.text))

    @cached_property
    def modal(self) -> tuple[FloatArray, FloatArray]:
        """Frequencies (n,) [Hz] and mass-normalised displacements (n, n_nodes, 3) [1/sqrt(kg)]."""
        modes = self.model.modes(self.n_modes)
        padded = np.vstack([modes.shape, np.zeros(self.n_modes)])
        return modes.frequency, np.moveaxis(padded[self.model.dofs[:, :3]], 2, 0)

    @cached_property
    def lines(self) -> dict[str, list[int]]:
        """Nodes of each member in order."""
        lines: dict[str, list[int]] = {}
        for member, (start, end) in zip(self.model.member_names, self.model.spans, strict=True):
            lines.setdefault(member, [start]).append(end)
        return lines

    @cached_property
    def channel_shape(self) -> FloatArray:
        """Shapes (n, n_channels) at the sensors, unit norm."""
        shape = (self.model.sensor_rows @ self.model.modes(self.n_modes).shape).T
        return np.asarray(shape / np.linalg.norm(shape, axis=1, keepdims=True))

    @cached_property
    def sensitivity(self) -> FloatArray:
        """Relative shift a kg (n, n_nodes): -|phi|^2 / 2, to first order [1/kg]."""
        return np.asarray(-0.5 * (self.modal[1] ** 2).sum(axis=2))

    def node(self, place: Vector) -> int:
        """Index of the node nearest to a place."""
        return int(np.argmin(np.linalg.norm(self.model.nodes - place, axis=1)))

    def reference(self, time: int, n_windows: int) -> ReferenceResult:
        """Return the reference as learned at a time [ns UTC]."""
        frequency, displacement = self.modal
        return ReferenceResult(
            time=time,
            n_windows=n_windows,
            nodes=[vector(p) for p in self.model.nodes],
            lines=self.lines,
            sensors={s.channel: (s.at, s.direction) for s in self.model.structure.sensor},
            modes=[
                ReferenceMode(
                    id=i + 1,
                    frequency=f,
                    frequency_std=f * FREQUENCY_STD / np.sqrt(n_windows),
                    damping=DAMPING,
                    model_frequency=1.015 * f,
                    mac=0.999,
                    displacement=[vector(u) for u in displacement[i] / np.abs(displacement[i]).max()],
                )
                for i, f in enumerate(frequency.tolist())
            ],
            calibrated={"stiffness of steel": (0.982, 0.0024)},
        )

    def window(self, index: int, phase: Phase, shift: FloatArray, *, missing: tuple[int, ...] = ()) -> WindowResult:
        """Return a window whose modes are shifted by `shift` (n,) [-]; `missing` modes are left out."""
        tracked, frequency, shape = phase != "learning", self.modal[0] * (1 + shift), self.channel_shape
        std = {"shift_std_percent": 100 * FREQUENCY_STD * 1.04} if tracked else {}
        modes = [
            ModeResult(
                id=i + 1,
                frequency=frequency[i],
                frequency_std=frequency[i] * FREQUENCY_STD,
                damping=DAMPING,
                damping_std=0.0005,
                shape=shape[i].tolist(),
                **(std | {"shift_percent": 100 * shift[i]} if tracked else {}),
            )
            for i in range(self.n_modes)
            if i + 1 not in missing
        ]
        seen = [m.id for m in modes]
        t2 = float(np.mean([(shift[i - 1] / FREQUENCY_STD) ** 2 for i in seen]))
        return WindowResult(
            index=index,
            start=START + index * WINDOW,
            end=START + (index + 1) * WINDOW,
            phase=phase,
            channels=list(self.model.structure.channels),
            modes=modes,
            novelty=Novelty(t2=t2, limit=LIMIT, modes=seen) if tracked else None,
            spectrum=self.spectrum(frequency),
        )

    def spectrum(self, frequency: FloatArray) -> Spectrum:
        """Return the singular values of the modes' response to white noise, and poles about the modes."""
        grid = np.linspace(0, 1.3 * frequency[-1], 257)
        ratio, shape = grid[:, None] / frequency, self.channel_shape
        response = ratio**4 / ((1 - ratio**2) ** 2 + (2 * DAMPING * ratio) ** 2)
        part = np.sqrt(response)[:, :, None] * shape
        across = part.transpose(0, 2, 1)
        # over modes or over channels, the values are the same but for zeros
        matrix = part @ across if self.n_modes < shape.shape[1] else across @ part
        largest = np.linalg.eigvalsh(matrix)[:, :-4:-1].T
        values = np.full((3, len(grid)), 1e-2)
        values[: len(largest)] += np.maximum(largest, 0.0)
        rng = np.random.default_rng(self.seed)
        order = np.repeat(np.arange(4, 44, 2), self.n_modes)
        spurious = rng.random(len(order)) < 2 / order
        pole = np.tile(frequency, len(order) // self.n_modes) * (1 + 1e-3 * rng.standard_normal(len(order)))
        pole[spurious] = rng.uniform(0, grid[-1], spurious.sum())
        return Spectrum(
            frequency=grid.tolist(),
            singular_values=(10 * np.log10(values) - 60).tolist(),
            pole_frequency=pole.tolist(),
            pole_order=order.tolist(),
            pole_stable=(~spurious).tolist(),
        )

    def answer(self, shift: FloatArray, n_windows: int) -> MassAnswer:
        """Return where the mean shift (n,) of some windows puts a mass: least squares at every node, flat prior."""
        std, per_kg = FREQUENCY_STD / np.sqrt(n_windows), self.sensitivity
        power = np.maximum((per_kg**2).sum(0), 1e-12)
        mass = (per_kg * shift[:, None]).sum(0) / power
        misfit = ((shift[:, None] - per_kg * mass) ** 2).sum(0) / std**2
        likely = np.exp(-0.5 * (misfit - misfit.min()))
        order = [(m, n) for m, nodes in self.lines.items() for n in nodes]
        steps = np.concatenate([self._steps(nodes) for nodes in self.lines.values()])
        density = likely[[n for _, n in order]]
        density = density / (density @ steps)
        best = int(np.argmax(density))
        member, node = order[best]
        at = self.model.nodes[node]
        inside = np.flatnonzero(density > 0.05 * density[best])
        return MassAnswer(
            member=member,
            position=vector(at),
            position_std=0.02 / np.sqrt(n_windows),
            mass=float(mass[node]),
            mass_std=float(std / np.sqrt(power[node])),
            region=[self._stretch(*order[i], float(steps[i])) for i in inside],
            member_probability=float(
                sum(d * s for d, s, o in zip(density, steps, order, strict=True) if o[0] == member)
            ),
            p_value=0.4,
            n_windows=n_windows,
            profile=[
                ProfilePoint(member=m, position=vector(self.model.nodes[n]), density=float(d), mass=float(mass[n]))
                for (m, n), d in zip(order, density, strict=True)
            ],
        )

    def _steps(self, nodes: list[int]) -> FloatArray:
        length = np.linalg.norm(np.diff(self.model.nodes[nodes], axis=0), axis=1)
        return np.asarray((np.r_[length, 0] + np.r_[0, length]) / 2)

    def _stretch(self, member: str, node: int, length: float) -> Interval:
        first, last = self.model.nodes[self.lines[member][0]], self.model.nodes[self.lines[member][-1]]
        half = 0.5 * length * (last - first) / np.linalg.norm(last - first)
        return Interval(
            member=member, start=vector(self.model.nodes[node] - half), end=vector(self.model.nodes[node] + half)
        )


def vector(values: FloatArray) -> Vector:
    """Return three numbers."""
    x, y, z = (float(v) for v in values)
    return x, y, z


def whole_run(site: Site, *, n_learning: int = 8, n_before: int = 4, n_after: int = 8) -> dict[str, Any]:
    """Return the fields of a `RunResults` for a run that learns, watches, and finds the mass.

    Mode 2 is not seen in the second watched window; the last window before the change gives no modes at all.
    """
    rng = np.random.default_rng(site.seed)
    windows: list[WindowResult] = []
    changed = site.mass * site.sensitivity[:, site.node(site.place)]
    for index in range(n_learning + n_before + n_after):
        noise = FREQUENCY_STD * rng.standard_normal(site.n_modes)
        since = index - n_learning - n_before
        shift = noise + (changed if since >= 0 else 0)
        phase: Phase = "learning" if index < n_learning else "alarm" if since >= 1 else "watching"
        window = site.window(index, phase, shift, missing=(2,) if index == n_learning + 1 else ())
        if since >= 1:
            mean = changed + noise / np.sqrt(since)
            window = window.model_copy(update={"answer": site.answer(mean, since)})
        windows.append(window)
    troubled = n_learning + n_before - 1
    windows[troubled] = without_modes(windows[troubled], "channel mid is flat")
    return {
        "reference": site.reference(windows[n_learning - 1].end, n_learning),
        "windows": windows,
        "alarms": [
            alarm(windows[n_learning - 1], "normal", f"baseline learned from {n_learning} windows"),
            alarm(windows[n_learning + n_before], "watch", "one window over the limit: novelty 19.0, limit 5.5"),
            alarm(windows[n_learning + n_before + 1], "alarm", "ALARM: the structure has changed " + 12 * "indeed "),
        ],
        "name": site.model.structure.name,
    }


def run_results(run: dict[str, Any]) -> RunResults:
    """Return a run as the drawings take it."""
    fields: dict[str, Any] = run | {"windows": tuple(run["windows"]), "alarms": tuple(run["alarms"])}
    return RunResults(**fields)


def without_modes(window: WindowResult, problem: str) -> WindowResult:
    """Return the window as it is when identification fails."""
    return window.model_copy(
        update={"modes": [], "novelty": None, "spectrum": None, "answer": None, "problem": problem}
    )


def alarm(window: WindowResult, state: str, text: str) -> AlarmResult:
    """Return a transition at a window's end."""
    return AlarmResult.model_validate({"time": window.end, "state": state, "text": text, "window": window.index})


def learning_run(site: Site, n: int = 5) -> dict[str, Any]:
    """Return the arguments for a run that stopped while learning."""
    run = whole_run(site)
    return run | {"reference": None, "windows": run["windows"][:n], "alarms": []}


def signals(site: Site, end: int, *, seconds: float = 14.0, rate: float = 250.0) -> Recording:
    """Return decaying modes at each channel up to a time [ns UTC], with half a second missing on the first."""
    n = round(seconds * rate)
    time = np.arange(n) / rate
    low = site.modal[0] < rate / 2.5
    motion = np.sin(2 * np.pi * np.outer(time, site.modal[0][low])) * np.exp(-0.1 * time)[:, None]
    data = 0.05 * motion @ site.channel_shape[low]
    data[-round(4.5 * rate) : -round(4.0 * rate), 0] = np.nan
    channels = tuple(RecordedChannel(name=c, device="d", axis=0) for c in site.model.structure.channels)
    return Recording(channels=channels, data=data, rate=rate, start=end - round(seconds * 1e9))
