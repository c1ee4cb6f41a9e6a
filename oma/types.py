"""Result of an identification: modes with their uncertainty, and the poles that they are selected from."""

from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from daq import BoolArray, FloatArray, IndexArray
from daq import ComplexArray as ComplexArray
from daq.notebook import html_table, notebook_extra, number_text, utc_text

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

    from oma.plots import Skeleton

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
class Stabilization:
    """Poles of all orders that could be modes: the stabilization diagram."""

    frequency: FloatArray  #: (n_poles,) [Hz]
    damping: FloatArray  #: (n_poles,) [-]
    shape: ComplexArray  #: (n_poles, n_channels), unit norm, as real as it can be
    order: IndexArray  #: (n_poles,) model order [-]
    column: IndexArray  #: (n_poles,) place among the eigenvalues of that order's model [-]
    stable: BoolArray  #: (n_poles,) the next order shows it too

    def __len__(self) -> int:
        """Return the number of poles."""
        return len(self.frequency)

    def __getitem__(self, chosen: BoolArray | IndexArray) -> "Stabilization":
        """Return some of the poles."""
        return Stabilization(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})


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
    poles: Stabilization | None = field(default=None, metadata={"stored": False})
    """Poles that the modes were selected from, kept by `identify` alone; None for several windows and other sources"""

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

        `support` is the share of the model orders that have the mode. `law_ratio` is the scatter of its frequency over
        the least standard deviation of any method, f sqrt(damping / (2 pi f T)) for a record of T seconds: about 1 for
        a clear mode, and larger for a weak one or one that changes within the record.

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

    def plot_stabilization(self) -> "Figure":
        """Draw poles over frequency by model order, and their damping; the modes are marked.

        `Identification.plot_stabilization` also draws the spectrum and the tones.

        Raises
        ------
        ValueError
            If the estimate has no poles.
        """
        from oma.plots import stabilization_figure  # matplotlib is loaded only for a figure

        if self.poles is None:
            raise ValueError("poles: expected those of one recording (identify, identify_all), found none")
        return stabilization_figure(self.poles, self, np.empty(0))

    def plot_shapes(self, structure: "Skeleton | None" = None) -> "Figure":
        """Draw all mode shapes: as arrows at the sensors of a structure; without one as bars, one per channel.

        Parameters
        ----------
        structure : updater.Structure, or another object with its properties `axis_lines` and `measuring_axes`, optional

        Raises
        ------
        ValueError
            If the structure has no sensor of these channels.
        """
        from oma.plots import shapes_figure  # matplotlib is loaded only for a figure

        if structure is not None and not structure.measuring_axes.keys() & set(self.channels):
            raise ValueError(f"structure: expected a sensor of {', '.join(self.channels)}, found none")
        return shapes_figure(self, structure)

    def plot_mac(self, other: "ModalEstimate | None" = None) -> "Figure":
        """Draw the modal assurance criterion (MAC) [-] of these modes with each other.

        Parameters
        ----------
        other : estimate of the same channels whose modes are the columns. Default: this one

        Raises
        ------
        ValueError
            If the channels differ.
        """
        from oma.plots import mac_figure  # matplotlib is loaded only for a figure

        other = self if other is None else other
        if self.channels != other.channels:
            raise ValueError(
                f"other: expected the channels {', '.join(self.channels)}, found {', '.join(other.channels)}"
            )
        return mac_figure(self, other)
