"""A diagnosis: verdict, causes, and errors of the model without and with them."""

from typing import TYPE_CHECKING

from daq.notebook import html_table, number_text
from updater.diagnosis.schema.values import (
    CalibrationSummary,
    Cause,
    Failed,
    Gain,
    MassTestFit,
    ModeFit,
    SmallestChange,
    Verdict,
)
from updater.quantities import PlainValue, Where, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Diagnosis(PlainValue):
    """Errors of the simulation, or changes of the structure."""

    verdict: Verdict
    causes: tuple[Cause, ...]
    modes: tuple[ModeFit, ...]
    gain: Gain | None
    calibration: CalibrationSummary | None = None  #: None if the structure file was not calibrated
    failed: tuple[Failed, ...] = ()  #: parts left out because of internal faults
    #: per kind, if a structure file is compared and only errors of the file are named
    smallest_changes: tuple[SmallestChange, ...] = ()
    mass_tests: tuple[MassTestFit, ...] = ()  #: records with a known mass, and what the best causes predict

    def __repr__(self) -> str:
        causes = ", ".join(f"{cause.cause} {_probability(cause)}" for cause in self.causes)
        return f"{type(self).__name__}({self.verdict}{': ' if causes else ''}{causes})"

    __str__ = __repr__

    def plot(self) -> "Figure":
        """Draw the errors of the model mode by mode, without and with the causes, and the evidence of alternatives.

        The bars are log evidence [-] relative to the accepted causes. `DiagnosisResult.plot` has those of all causes.

        Raises
        ------
        ValueError
            If no mode was compared and no cause weighed.
        """
        from updater.diagnosis.schema.figures import diagnosis_figure  # matplotlib is loaded only for a figure

        return diagnosis_figure(self.causes, self.modes, ())

    def _repr_html_(self) -> str:
        """Return a table of the causes, for notebooks."""
        head = ("cause", "probability", "parameters", "place", "position [m]")
        return html_table(self.verdict, head, map(_cells, self.causes))


def _probability(cause: Cause) -> str:
    """Return a probability, never rounded to certainty."""
    return "> 0.99" if cause.probability > 0.99 else f"{cause.probability:.3f}"


def _cells(cause: Cause) -> tuple[str, ...]:
    """Return the row of a cause."""
    where = cause.where or Where()
    parameters = (f"{name} {number_text(q.value, q.std)} {q.unit}" for name, q in cause.parameters.items())
    position = ", ".join(f"{x:.3f}" for x in where.position or ())
    deviation = f" ± {where.position_std:.3f}" if where.position_std is not None else ""
    return (
        plain(cause.cause),
        _probability(cause),
        ", ".join(parameters),
        ", ".join(filter(None, (where.member, *where.channels))),
        position + deviation,
    )
