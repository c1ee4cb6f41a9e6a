"""Simulated results of records of given lengths for true frames: errors along the truth's own modes."""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from oma import ModalEstimate
from tests.support.updater.reference_frame import t_frame, true_model
from updater import Body, MassChange, Record, Reference, learn_reference, locate_mass, stack_tracks
from updater.fe import Model
from updater.planning.record_noise import shape_errors

N_BEFORE, N_AFTER = 8, 4  # windows that a record is cut into
_N_MODES = 30


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueRig:
    """A frame that differs from the reference in kind, and records of it."""

    seed: int
    record: Record

    def model(self, body: Body | None = None) -> Model:
        return true_model(np.random.default_rng((self.seed, 1)), body)

    def windows(self, body: Body | None, n: int, draw: int) -> list[ModalEstimate]:
        """Return the n windows of one record; each errs by sqrt(n) more than the whole. Gains scatter by 0.5 %."""
        random = np.random.default_rng((self.seed, draw))
        gain = 1 + 0.005 * np.random.default_rng((self.seed, 2)).standard_normal(12)
        model = self.model(body)
        modes = model.modes(_N_MODES)
        measured = np.flatnonzero(modes.frequency <= self.record.highest)
        at = gain[:, None] * (model.sensor_rows @ modes.shape)
        error = np.sqrt(n) * shape_errors(at, self.record.leaks(modes.frequency, measured), at[:, measured].T)
        std = np.sqrt(n) * self.record.log_frequency_std(modes.frequency[measured])
        blur = np.sqrt(n) * self.record.blur(modes.frequency[measured])
        unit = (at[:, measured] / np.linalg.norm(at[:, measured], axis=0)).T
        return [self._window(model, modes.frequency[measured], std, unit, error, blur, random) for _ in range(n)]

    def _window(
        self,
        model: Model,
        frequency: FloatArray,
        std: FloatArray,
        unit: FloatArray,
        error: FloatArray,
        blur: FloatArray,
        random: np.random.Generator,
    ) -> ModalEstimate:
        n = len(frequency)
        shape = unit + np.einsum("ik,ikc->ic", random.standard_normal(error.shape[:2]), error)
        shape += blur[:, None] * random.standard_normal(shape.shape)
        return ModalEstimate(
            channels=model.structure.channels,
            frequency=frequency * np.exp(std * random.standard_normal(n)),
            frequency_std=std * frequency,
            damping=np.full(n, self.record.damping),
            damping_std=np.full(n, 0.2 * self.record.damping),
            shape=(shape / np.linalg.norm(shape, axis=1, keepdims=True)).astype(complex),
            shape_std=np.sqrt((error**2).sum(1) + blur[:, None] ** 2),
            support=np.ones(n),
            law_ratio=np.ones(n),
            start=0,
            end=round(self.record.seconds * 1e9),
        )

    def reference(self) -> Reference:
        """Return the reference of the record before the change."""
        windows = self.windows(None, N_BEFORE, 3)
        return learn_reference(t_frame(), windows, in_order(windows))

    def located(self, reference: Reference, body: Body, draw: int) -> MassChange:
        """Return the result of the record after the change for the body."""
        windows = self.windows(body, N_AFTER, draw)
        return locate_mass(reference, reference.mean_of(stack_tracks(windows, in_order(windows))))


def in_order(windows: list[ModalEstimate]) -> list[IndexArray]:
    """Return tracks of windows whose modes are all in the order of frequency."""
    return [np.arange(window.n_modes, dtype=np.intp) for window in windows]


def away(change: MassChange, body: Body) -> float:
    """Return how far the answer is from the point the body is fixed to [m]."""
    return float(np.linalg.norm(t_frame().member_named(change.member).point(change.distance) - np.array(body.at)))
