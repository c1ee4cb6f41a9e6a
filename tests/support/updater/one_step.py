"""A T-frame without and with masses, and the reference of its baseline: data for tests of the one-step update."""

from dataclasses import replace

from oma import ModalEstimate
from tests.support.updater.frames import Truth, t_frame, t_truth, unmoved
from updater import Body, Reference, learn_reference, learn_scatter, mean_modes, stack_tracks
from updater.fe import Modes

LOCATION_1 = Body(at=(0.25, 0, 1.48), mass=0.304)
N_BASELINE, N_EVENT = 8, 4


class Rig:
    """A true structure, bare and loaded, and the reference that its baseline taught."""

    def __init__(self, seed: int) -> None:
        self.truth: Truth = t_truth(seed)
        bare, loaded = self.truth.model(), self.truth.model(LOCATION_1)
        self.rows = bare.sensor_rows
        self.bare, self.loaded = bare.modes(8), loaded.modes(8)
        self.reference = learn_reference(t_frame(), self.windows(self.bare, N_BASELINE, 1), unmoved(N_BASELINE))

    def windows(self, modes: Modes, n: int, seed: int, noise: float = 1.0) -> list[ModalEstimate]:
        return self.truth.windows(modes, self.rows, n, seed, noise)

    def relearnt(self, windows: list[ModalEstimate]) -> Reference:
        """Return the reference with another baseline and all that follows from it but the calibration."""
        tracked = stack_tracks(windows, unmoved(len(windows)))
        scatter = learn_scatter(tracked)
        factors = {"frequency_factor": scatter.frequency_factor, "shape_factor": scatter.shape_factor}
        return replace(self.reference, baseline=mean_modes(tracked, **factors), scatter=scatter, windows=tracked)
