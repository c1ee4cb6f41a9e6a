"""Selection of causes, channels, modes and model parameters for a diagnosis."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from monitor.analysis.observation import Observation
from oma import ModalEstimate, normalise
from updater import Structure
from updater.structure import Updating, check_updating

_SAME_MODE = 0.02  # relative difference of frequency within which a mode is the one that was named


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Limits that a person sets for a diagnosis; without any, everything takes part."""

    only: tuple[str, ...] = ()  #: causes to which the search is limited; all if empty
    without: tuple[str, ...] = ()  #: causes that are left out
    without_channels: tuple[str, ...] = ()  #: channels that are left out
    without_modes: tuple[float, ...] = ()  #: frequencies of modes that are left out [Hz]
    #: names of model parameters that keep the file's value, in addition to the file's own list
    fixed: tuple[str, ...] = ()
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)  #: least and greatest value by name

    def of_structure(self, structure: Structure) -> Structure:
        """Return the structure with these parameters fixed and bounded.

        Raises
        ------
        ValueError
            If the structure has no parameter of a name, bounds do not contain the file's value, or it has no sensor
            for a channel.
        """
        for name in self.without_channels:
            if name not in structure.channels:
                raise ValueError(f"the structure has no channel {name!r}; it has {', '.join(structure.channels)}")
        own = structure.updating
        chosen = Updating(fixed=(*own.fixed, *self.fixed), bounds={**own.bounds, **self.bounds})
        limited = structure.model_copy(update={"updating": chosen})
        check_updating(limited)
        return limited

    def of_observation(self, observation: Observation) -> Observation:
        """Return an observation without the channels and modes that are left out.

        Raises
        ------
        ValueError
            If no channel is left.
        """
        estimates = tuple(self._of_estimate(estimate) for estimate in observation.estimates)
        frequency = np.exp(np.nanmedian(observation.modes.log_frequency, axis=0))
        kept = np.ones(len(frequency), bool)
        for hertz in self.without_modes:
            kept &= np.abs(np.log(frequency / hertz)) > _SAME_MODE
        tracks = tuple(track[kept] for track in observation.tracks)
        return replace(observation, estimates=estimates, tracks=tracks)

    def _of_estimate(self, estimate: ModalEstimate) -> ModalEstimate:
        kept = [i for i, name in enumerate(estimate.channels) if name not in self.without_channels]
        if len(kept) == len(estimate.channels):
            return estimate
        if not kept:
            raise ValueError("no channel is left")
        shape = estimate.shape[:, kept]
        norm = np.linalg.norm(shape, axis=1, keepdims=True)
        return replace(
            estimate,
            channels=tuple(estimate.channels[i] for i in kept),
            shape=normalise(shape),
            shape_std=estimate.shape_std[:, kept] / norm,
        )


EVERYTHING = Selection()
