"""Interface of an identification method to the stream that feeds it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from daq import FloatArray
from oma.preparation import Level
from oma.selection import Mode, Selection, Stabilization


@dataclass(frozen=True, eq=False, kw_only=True)
class LevelModes:
    """Identification at one sampling rate, in its band."""

    poles: Stabilization
    modes: Sequence[Mode]  #: candidates; noise is removed later by its uncertainty


class LevelIdentifier(Protocol):
    """Sums over blocks of time at one rate, and the modes in them."""

    def add(self, data: FloatArray) -> None:
        """Add a block, (n_samples, n_channels), zero-mean, NaN where a sample is missing."""

    def drop(self, n_blocks: int) -> None:
        """Forget the oldest blocks."""

    def identify(self) -> LevelModes | None:
        """Return the modes in the blocks held; None if gaps leave too little to be worth a look."""


class Method(Protocol):
    """Identification method with its options, for `identify`."""

    name: ClassVar[str]  #: name on the command line
    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def n_blocks(self) -> int:
        """Blocks of time a recording is cut into; their scatter gives the uncertainty."""

    @property
    def decimation(self) -> int:
        """Ratio of one rate to the next lower one."""

    @property
    def min_cycles(self) -> float:
        """Periods in the window below which no mode is sought, unless a band is given."""

    @property
    def selection(self) -> Selection:
        """Criteria of a mode."""

    def least_samples(self, n_channels: int) -> int:
        """Return how many samples at one rate are the least to identify anything from."""

    def start(self, channels: Sequence[str], level: Level) -> LevelIdentifier:
        """Return an empty identifier for one rate; raises TooFewChannels if no reference is among the channels."""
