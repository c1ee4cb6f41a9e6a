"""Common part of identification methods, and their interface to the stream that feeds them."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from daq import FloatArray
from oma.preparation import Level
from oma.selection import Mode, Selection
from oma.spectral import CorrelationAccumulator
from oma.types import Stabilization


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
        """Remove the oldest blocks."""

    def identify(self) -> LevelModes | None:
        """Return the modes in the blocks held; None if gaps leave too little to be worth a look."""


@dataclass(frozen=True, kw_only=True)
class Method(ABC):
    """Identification method with its options, for `identify`."""

    name: ClassVar[str]  #: name on the command line
    n_blocks: int = 30  #: blocks of time a recording is cut into, whose scatter gives the uncertainty [-]
    decimation: int = 5  #: ratio of one rate to the next lower one [-]
    min_cycles: float = 100.0  #: periods in the window below which no mode is sought, unless a band is given [-]
    selection: Selection = field(default_factory=Selection)  #: criteria of modes

    def __post_init__(self) -> None:
        """Refuse invalid options."""
        self.check_least(n_blocks=4, decimation=2)

    def check_least(self, **least: int) -> None:
        """Refuse options below their least values."""
        for name, value in least.items():
            if getattr(self, name) < value:
                raise ValueError(f"{name}: expected at least {value}, found {getattr(self, name)}")

    @abstractmethod
    def least_samples(self, n_channels: int) -> int:
        """Return the least number of samples at one rate from which modes can be identified."""

    @abstractmethod
    def start(self, channels: Sequence[str], level: Level) -> LevelIdentifier:
        """Return an empty identifier for one rate; raises TooFewChannels if no reference is among the channels."""


class CorrelationLevel:
    """Common part of identifiers that sum correlations."""

    _correlations: CorrelationAccumulator

    def add(self, data: FloatArray) -> None:
        """Add a block, (n_samples, n_channels), zero-mean, NaN where a sample is missing."""
        self._correlations.add(data)

    def drop(self, n_blocks: int) -> None:
        """Remove the oldest blocks."""
        self._correlations.drop(n_blocks)
