"""Result of an identification: modes with their uncertainty."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from daq import FloatArray, IndexArray

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalEstimate:
    """Modes identified from one recording."""

    channels: tuple[str, ...]  #: names, in the order of the columns of `shape`
    frequency: FloatArray  #: (n_modes,) natural frequency [Hz], ascending
    frequency_std: FloatArray  #: (n_modes,) [Hz]
    damping: FloatArray  #: (n_modes,) ratio of critical [-]
    damping_std: FloatArray  #: (n_modes,) [-]
    shape: (
        ComplexArray  #: (n_modes, n_channels) [-], unit Euclidean norm, phase turned so that it is as real as it can be
    )
    shape_std: FloatArray  #: (n_modes, n_channels) [-], standard deviation of the real part, at the same scale
    support: FloatArray  #: (n_modes,) share of the model orders that showed the mode [-]
    law_ratio: FloatArray  #: (n_modes,) jackknife sigma of frequency over the uncertainty law's [-]
    start: int  #: start of the recording [ns UTC]
    end: int  #: its end [ns UTC]

    def __post_init__(self) -> None:
        """Check that shapes agree."""
        n = len(self.frequency)
        for name in ("frequency_std", "damping", "damping_std", "support", "law_ratio"):
            if getattr(self, name).shape != (n,):
                raise ValueError(f"{name}: expected ({n},), found {getattr(self, name).shape}")
        for name in ("shape", "shape_std"):
            if getattr(self, name).shape != (n, len(self.channels)):
                raise ValueError(f"{name}: expected ({n}, {len(self.channels)}), found {getattr(self, name).shape}")

    def __getitem__(self, chosen: npt.NDArray[np.bool_] | IndexArray) -> "ModalEstimate":
        """Return some of the modes."""
        names = ("frequency", "frequency_std", "damping", "damping_std", "shape", "shape_std", "support", "law_ratio")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return len(self.frequency)
