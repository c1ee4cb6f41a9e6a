"""A pipeline that is given modes instead of signals: windows of a true structure, drawn, at no cost."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from daq import FloatArray, Recording
from monitor.results.windows import Result, WindowResult
from monitor.settings import Settings, parse_settings
from monitor.watch.memory import Memory
from monitor.watch.pipeline import Pipeline
from oma import ChannelFault, Identification, ModalEstimate, Stabilization, WindowQuality
from tests.support.updater.reference_frame import measure, true_model
from updater import Body, ModalDataError, Structure, parse_structure, t_structure_toml

STEP = 600  # s
START = 1_767_225_600_000_000_000
BASELINE = 12
_NOISE, _SHAPE_NOISE = 5e-4, 3e-3  # of frequencies at 10 Hz, and of shapes [-]
_NO_POLES = Stabilization(
    frequency=np.empty(0),
    damping=np.empty(0),
    shape=np.empty((0, 12), complex),
    order=np.empty(0, np.intp),
    column=np.empty(0, np.intp),
    stable=np.empty(0, bool),
)


def site_text(more: str = "") -> str:
    """Return settings of twelve channels on one device each, of the shipped frame; `more` is in [alarm]."""
    channels = parse_structure(t_structure_toml()).channels
    lines = ['structure = "t_structure.toml"', "[analysis]", f"baseline_windows = {BASELINE}", "[alarm]", more]
    for name in channels:
        device = ["[[device]]", f'name = "d_{name}"', 'driver = "epson-uart"', f'port = "/dev/{name}"']
        lines += [*device, f'channels = {{x = "{name}"}}']
    return "\n".join(lines)


def site_settings(more: str = "") -> Settings:
    """Return the same, read."""
    return parse_settings(site_text(more))


class Played:
    """Windows of a true structure, one every ten minutes, drawn from a seed; a body may be put onto it."""

    def __init__(self, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
        print(f"seed {seed}")
        self._random = np.random.default_rng(seed)
        self._seed, self._n = seed, 0
        self.hidden: tuple[int, ...] = ()  # modes that no window shows
        self.dead: dict[str, str] = {}  # channels that none hears, and why
        self._gain = 1 + 0.003 * self._random.standard_normal(12)
        self._known: dict[Body | None, ModalEstimate] = {}  # modes with a body, computed once
        self._modes = self._true_modes(None)
        self.text = site_text()
        self.structure: Structure | None = parse_structure(t_structure_toml())
        self.settings = site_settings()
        monkeypatch.setattr("monitor.analysis.window.identify_cleaned", self._identify)

    def put(self, body: Body | None) -> None:
        """Put a body onto the structure, or take it off again."""
        self._modes = self._true_modes(body)

    def true_frequency(self, body: Body | None) -> FloatArray:
        """Return the frequencies [Hz] of the structure with a body, or without."""
        return self._true_modes(body).frequency

    def _true_modes(self, body: Body | None) -> ModalEstimate:
        """Return the modes as they would be measured without errors, with the deviations that these would have."""
        if body not in self._known:
            self._known[body] = self._computed(body)
        return self._known[body]

    def _computed(self, body: Body | None) -> ModalEstimate:
        model = true_model(np.random.default_rng((self._seed, 1)), body)
        exact = measure(model, np.random.default_rng(0), self._gain, noise=0.0, shape_noise=0.0)
        std = _NOISE * np.sqrt(10 / exact.frequency) * exact.frequency
        return replace(exact, frequency_std=std, shape_std=np.full(exact.shape.shape, _SHAPE_NOISE))

    def pipeline(self, memory: Memory | None = None) -> Pipeline:
        """Return a pipeline of the site."""
        return Pipeline(self.structure, self.settings, memory)

    def windows(self, n: int) -> Iterator[Recording]:
        """Yield recordings, whose signals are noise without use."""
        for _ in range(n):
            data = self._random.standard_normal((64, 12))
            start = START + self._n * STEP * 10**9
            self._n += 1
            yield Recording(channels=self.settings.channels, data=data, rate=64 / STEP, start=start, temperature=20.0)

    def wait(self, days: int) -> None:
        """Let days pass of which there are no windows."""
        self._n += days * 86400 // STEP

    def _identify(self, recording: Recording, _clean: object, band: object) -> Identification:
        """Return a window's modes: the same of the same recording."""
        assert band is None
        random = np.random.default_rng((self._seed, recording.start // 10**9))
        true, drawn = self._modes, random.standard_normal((2, *self._modes.shape.shape))
        estimate = replace(
            true,
            frequency=true.frequency + true.frequency_std * random.standard_normal(true.n_modes),
            damping=true.damping + true.damping_std * random.standard_normal(true.n_modes),
            shape=true.shape + _SHAPE_NOISE * (drawn[0] + 1j * drawn[1]),
            start=recording.start,
            end=recording.end,
        )
        heard = [k for k, channel in enumerate(estimate.channels) if channel not in self.dead]
        estimate = replace(
            estimate,
            channels=tuple(estimate.channels[k] for k in heard),
            shape=estimate.shape[:, heard],
            shape_std=estimate.shape_std[:, heard],
        )
        return Identification(
            estimate=estimate[np.setdiff1d(np.arange(true.n_modes), self.hidden)],
            poles=_NO_POLES,
            harmonics=np.array([50.0]),
            may_be_tone=np.zeros(true.n_modes - len(self.hidden), np.bool_),
            frequency_moves=np.zeros((true.n_modes - len(self.hidden), 30)),
            quality=WindowQuality(complete=1.0, rms_variation=0.1, cycles=1000.0),
            band=(1.0, 400.0),
            recorded=true.channels,
            faults={c: ChannelFault(kind="no_signal", text=why) for c, why in self.dead.items()},
            delays={f"d_{c}": 0.0 for c in estimate.channels},
        )


def run(pipeline: Pipeline, windows: Iterator[Recording]) -> list[Result]:
    """Return the results of a pipeline for windows."""
    return [result for window in windows for result in pipeline.analyse(window)]


def judged(results: list[Result]) -> list[WindowResult]:
    """Return the windows among results."""
    return [result for result in results if isinstance(result, WindowResult)]


def without_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no window be diagnosed, which takes seconds: as where fewer than three modes can be compared."""

    def none(*_: object) -> None:
        raise ModalDataError("fewer than three modes")

    monkeypatch.setattr("monitor.watch.answer.explain_windows", none)
