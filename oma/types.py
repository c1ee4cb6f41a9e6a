"""Result of an identification: modes with their uncertainty."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from daq import FloatArray, IndexArray
from daq.notebook import html_table, notebook_extra, number_text, utc_text

if TYPE_CHECKING:
    import pandas
    import xarray

ComplexArray = npt.NDArray[np.complex128]
SAME_AS = "the same as "  #: beginning of the text of a channel's fault that ends with the name of another channel
_LISTED = 8  # frequencies in a short description
_PER_MODE = {
    "frequency": "Hz",
    "frequency_std": "Hz",
    "damping": "1",
    "damping_std": "1",
    "support": "1",
    "law_ratio": "1",
}


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
        for name in _PER_MODE:
            if getattr(self, name).shape != (n,):
                raise ValueError(f"{name}: expected ({n},), found {getattr(self, name).shape}")
        for name in ("shape", "shape_std"):
            if getattr(self, name).shape != (n, len(self.channels)):
                raise ValueError(f"{name}: expected ({n}, {len(self.channels)}), found {getattr(self, name).shape}")

    def __getitem__(self, chosen: npt.NDArray[np.bool_] | IndexArray) -> "ModalEstimate":
        """Return some of the modes."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in (*_PER_MODE, "shape", "shape_std")})

    def __repr__(self) -> str:
        frequencies = ", ".join(f"{frequency:.4g}" for frequency in self.frequency[:_LISTED])
        more = ", ..." if self.n_modes > _LISTED else ""
        return f"ModalEstimate({self.n_modes} modes at {frequencies}{more} Hz, {len(self.channels)} channels)"

    def _repr_html_(self) -> str:
        """Return a table of the modes, for notebooks."""
        rows = [
            (str(k + 1), number_text(frequency, frequency_std), number_text(100 * damping, 100 * damping_std))
            for k, (frequency, frequency_std, damping, damping_std) in enumerate(
                zip(self.frequency, self.frequency_std, self.damping, self.damping_std, strict=True)
            )
        ]
        seconds = (self.end - self.start) * 1e-9
        caption = f"{len(self.channels)} channels, {seconds:.4g} s from {utc_text(self.start)}"
        return html_table(caption, ("mode", "frequency [Hz]", "damping [%]"), rows)

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return len(self.frequency)

    def to_dataframe(self, *, shapes: bool = False) -> "pandas.DataFrame":
        """Return a table with one row per mode, numbered from 1; units as of the fields.

        Parameters
        ----------
        shapes : whether each channel has the columns `shape_CHANNEL`, complex, and `shape_std_CHANNEL`

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        with notebook_extra():
            import pandas
        columns = {name: getattr(self, name) for name in _PER_MODE}
        for k, channel in enumerate(self.channels if shapes else ()):
            columns |= {f"shape_{channel}": self.shape[:, k], f"shape_std_{channel}": self.shape_std[:, k]}
        return pandas.DataFrame(columns, index=pandas.RangeIndex(1, self.n_modes + 1, name="mode"))

    def to_xarray(self) -> "xarray.Dataset":
        """Return a data set over modes, numbered from 1, and channels; units are attributes.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        with notebook_extra():
            import xarray
        per_mode = {name: ("mode", getattr(self, name), {"units": unit}) for name, unit in _PER_MODE.items()}
        shapes = {name: (("mode", "channel"), getattr(self, name), {"units": "1"}) for name in ("shape", "shape_std")}
        return xarray.Dataset(
            per_mode | shapes,
            {"mode": np.arange(1, self.n_modes + 1), "channel": list(self.channels)},
            {"start": self.start, "end": self.end},
        )
