"""Interface of a cause."""

from dataclasses import dataclass, field
from typing import Any, Protocol, Self, TypeVar, runtime_checkable

import numpy as np
import numpy.typing as npt

from daq import FloatArray, IndexArray
from updater.inference import Comparison, Effect, Fit, Hypotheses, no_effect
from updater.quantities import ParameterChange, Quantity, Where
from updater.reference import Reference
from updater.structure import Structure

BoolArray = npt.NDArray[np.bool_]


class Cause(Hypotheses, Protocol):
    """Alternatives of one named cause, with its parameters as values and its extension of a structure."""

    @property
    def name(self) -> str:
        """Name in a diagnosis."""

    @property
    def cannot_be_told_from(self) -> tuple[str, ...]:
        """Causes outside the catalogue's reach with the very same signature."""

    @property
    def place_free(self) -> bool:
        """True if it acts on the whole structure alike."""

    @property
    def advice(self) -> str:
        """Measurement that would decide between the remaining hypotheses."""

    @property
    def neutral_start(self) -> FloatArray:
        """Start of a joint fit with other causes (n_alternatives, n_parameters); positions have no effect yet."""

    def where(self, fit: "Fit[Cause]") -> Where | None:
        """Return the place, None if the cause has none."""

    def parameters(self, fit: "Fit[Cause]") -> dict[str, Quantity]:
        """Return the estimated parameters."""

    def extend(self, structure: Structure, row: int, theta: FloatArray) -> Structure:
        """Return the structure with alternative `row` of parameters theta (n_parameters,) written into it."""


@runtime_checkable
class Placed(Protocol):
    """A cause that may be at several places."""

    reference: Reference

    def points(self, fit: Fit[Any]) -> FloatArray:
        """Return where each alternative is (n, 3) [m]."""

    def by_place(self, fit: Fit[Any]) -> list[FloatArray]:
        """Return the probability of each alternative (n,) at each place left open, the most probable place first."""


@runtime_checkable
class Sized(Protocol):
    """A cause with magnitudes that may be found within their standard deviations of no change."""

    def deviations(self, fit: Fit[Any]) -> float:
        """Return by how many standard deviations the best alternative differs from no change.

        Of several magnitudes the most; parameters that mean nothing where a magnitude is zero - a place, a length -
        are held.
        """


@runtime_checkable
class MayOpen(Protocol):
    """A loss of stiffness that may open and close."""

    def opening(self, theta: FloatArray, rows: IndexArray) -> FloatArray:
        """Return the log likelihood ratio (len(rows),) of opening and closing to none by the signals."""


C = TypeVar("C", bound=Cause, covariant=True)


@runtime_checkable
class Parametric(Protocol):
    """A cause that changes parameters of the model."""

    def changes(self, fit: Fit[Any]) -> tuple[ParameterChange, ...]:
        """Return the parameters that changed significantly, before and after."""

    def physical_std(self, fit: Fit[Any]) -> dict[str, float]:
        """Return the standard deviation of every fitted parameter by its name, in physical units."""


class Propose(Protocol[C]):
    """Makes a cause's alternatives for a structure and its data; None where it has none."""

    def __call__(self, reference: Reference, comparison: Comparison) -> C | None:
        """Return the alternatives."""


@dataclass(frozen=True, kw_only=True)
class CatalogueEntry:
    """A cause of the catalogue, and its relations to the others."""

    propose: Propose[Cause]
    rarity: float = 1.0  #: prior probability relative to that of any other cause
    common_form: str = ""  #: more common cause with a similar effect; its prediction to first order may be lower
    relaxed: Propose[Cause] | None = None  #: the same cause with more parameters, considered if it is much likelier
    of_the_file: bool = False  #: whether it is an error of the structure file, which may occur with any other cause


@dataclass(frozen=True, eq=False, kw_only=True)
class Discrete:
    """Common part of causes with equally probable alternatives without refinement; by default one, no parameters."""

    comparison: Comparison
    prior_std: FloatArray = field(default_factory=lambda: np.zeros(0))
    lower: FloatArray = field(default_factory=lambda: np.zeros((1, 0)))
    drifting: bool = False
    cannot_be_told_from: tuple[str, ...] = ()

    @property
    def start(self) -> FloatArray:
        """Parameters (n_alternatives, n_parameters) from which a fit starts: no change."""
        return np.zeros(self.lower.shape)

    @property
    def neutral_start(self) -> FloatArray:
        """Parameters from which a fit in addition to other causes starts; without a place the same as `start`."""
        return self.start

    @property
    def log_prior(self) -> FloatArray:
        """Log prior probability (n_alternatives,): all are equally probable [-]."""
        return np.full(len(self.lower), -np.log(len(self.lower)))

    def repeats(self, other: Self, row: int) -> BoolArray:
        """Return which alternatives (n,) change what alternative `row` of the same cause, as `other`, changes."""
        same: BoolArray = np.arange(len(self.lower)) == row
        return same

    def log_ratio(self, theta: FloatArray, covariance: FloatArray, rows: IndexArray) -> FloatArray:
        """Return zeros (n_alternatives,): the prior is Gaussian."""
        del covariance, rows
        return np.zeros(len(theta))

    def refined(self, log_density: FloatArray, theta: FloatArray) -> Self | None:
        """There is nothing between the alternatives."""
        del log_density, theta
        return None

    def where(self, fit: Fit[Any]) -> Where | None:
        """Return none: it has no place of its own."""
        del fit
        return None

    def parameters(self, fit: Fit[Any]) -> dict[str, Quantity]:
        """There are none."""
        del fit
        return {}


@dataclass(frozen=True, eq=False, kw_only=True)
class Nothing(Discrete):
    """One alternative without parameters."""

    def effect(self, theta: FloatArray, rows: IndexArray) -> Effect:
        """Return none."""
        del theta
        return no_effect(len(rows), self.comparison)
