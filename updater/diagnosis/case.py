"""An event to be explained with its fits, and the result of its diagnosis."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from updater.causes import Cause
from updater.diagnosis.gain import Gained, WindowModes
from updater.diagnosis.schema import Diagnosis, NextMeasurement, Rejected
from updater.diagnosis.weighing import Candidate, EvidenceComparison
from updater.inference import Comparison, Fit
from updater.modal_data import Circumstances, ModalMean
from updater.reference import Calibration, Reference
from updater.structure import Body, Structure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class RecalibratedModel:
    """An inconsistent structure file with fitted parameters, which does not explain all measurements."""

    structure: Structure
    gained: Gained


@dataclass(frozen=True, eq=False)
class DiagnosisResult:
    """A diagnosis, with the model that it extends."""

    diagnosis: Diagnosis
    extended: Structure | None  #: structure with the causes; None if nothing is explained
    rejected: tuple[Rejected, ...] = ()  #: single causes that were not accepted
    next_measurement: NextMeasurement = ()
    gained: Gained | None = None  #: gain of it, with its deviation
    parts: tuple[Fit[Cause], ...] = ()  #: the fit of each cause of the best explanation
    nearer: RecalibratedModel | None = None  #: recalibrated model of a file that is far off, if nothing is explained
    #: calibration of `extended`, if not the reference's: with removed bodies on, or with springs as since the change
    calibration: Calibration | None = None
    springs: tuple[str, ...] = ()  #: names of the parameters that this calibration has as since the change
    removed: tuple[Body, ...] = ()  #: bodies taken off that the structure file lacks, as they were on it

    def __repr__(self) -> str:
        return f"DiagnosisResult({self.diagnosis!r})"

    def plot(self) -> "Figure":
        """Draw the errors of the model without and with the causes, and the log evidence [-] of all causes.

        Raises
        ------
        ValueError
            If no mode was compared and no cause weighed.
        """
        from updater.diagnosis.schema.figures import diagnosis_figure  # matplotlib is loaded only for a figure

        return diagnosis_figure(self.diagnosis.causes, self.diagnosis.modes, self.rejected)

    def _repr_html_(self) -> str:
        """Return a table of the causes, for notebooks."""
        return self.diagnosis._repr_html_()


@dataclass(frozen=True, eq=False)
class Case:
    """Data to be explained, and every cause fitted alone."""

    reference: Reference
    event: ModalMean
    data: Comparison
    singles: list[Candidate]  #: single causes as searched for
    weighing: EvidenceComparison
    measured: WindowModes
    heldout: WindowModes | None
    #: calibration of the structure file, if the reference's model has bodies that it lacks
    bare: Calibration | None = None

    @property
    def of_other_references(self) -> Circumstances:
        """The circumstances, without a mixing that is of the modes of this reference.

        Another reference is then compared with smaller errors, and is not preferred because of larger ones.
        """
        return replace(self.data.circumstances, mixing=None)
