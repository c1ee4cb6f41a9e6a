"""From recordings to a diagnosis: windows, tracks, a reference, and the causes weighed against each other."""

import math
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

from monitor.analysis.event import Event, event_of
from monitor.analysis.observation import Observation
from monitor.analysis.states.stationarity import of_one_state
from monitor.errors import State, StateError
from monitor.optional import run_optional
from monitor.results.comparison import DiagnosisAnswer
from monitor.text.diagnosis import diagnosis_answer, exchanged_text
from updater import (
    Cause,
    Circumstances,
    DiagnosisResult,
    ModalDataError,
    ModalMean,
    PairingError,
    Reference,
    Structure,
    diagnose,
    learn_reference,
    nominal_reference,
    sensor_health,
)
from updater.diagnosis import OnCause, ReferenceStep, allowed_causes, say_nothing
from updater.modal_data import Effort, KnownMass, Signals, mean_modes
from updater.quantities import ExchangedSections, Where
from updater.reference import exchanged_sections
from updater.structure import ON_MEMBER, Updating
from updater.validation import SensorHealth, breathing, with_acting, with_cracks

_FILE_MAY_BE_OFF = "model_parameters"
_POOR_PERCENT = 1.0  # rms of frequencies after calibration: five times the error of a good beam model


@dataclass(frozen=True, eq=False, kw_only=True)
class MassRecord:
    """A further record of the state that is explained, with a known mass on the structure."""

    mass: float  #: [kg]
    position: tuple[float, float, float]  #: of the mass [m]
    observation: Observation


@dataclass(frozen=True, eq=False, kw_only=True)
class Explanation:
    """A diagnosis with its basis."""

    explained: DiagnosisResult
    #: reference with which the causes were sought; for a file that is far off, that of the recalibrated model
    sought: Reference
    measured: ModalMean  #: (n_modes,) all modes of the logs that were to be explained
    event: ModalMean  #: (n_tracks,) modes known to this reference, as compared
    circumstances: Circumstances  #: circumstances of the logs
    diagnosis: DiagnosisAnswer  #: the diagnosis in sentences

    def __repr__(self) -> str:
        return f"Explanation({self.diagnosis!r})"

    def _repr_html_(self) -> str:
        """Return a table of the causes, for notebooks."""
        return self.diagnosis._repr_html_()

    @property
    def reference(self) -> Reference:
        """Of the structure as it was, or of the structure file."""
        return self.sought.file

    @property
    def health(self) -> SensorHealth:
        """Gain, polarity and delay of every channel against the reference, with the causes that act on it."""
        extended = self.explained.extended
        reference = with_acting(self.sought, extended) if extended else self.sought
        return sensor_health(reference, self.event, self.circumstances)


def _as_measured(modes: ModalMean, observation: Observation) -> ModalMean:
    """Return all modes of an observation, without the model's shapes where only frequencies were measured."""
    return modes if observation.shaped else modes.without_shapes()


def explain(
    structure: Structure,
    before: Observation | None,
    now: Observation,
    heldout: Observation | None = None,
    on_cause: OnCause = say_nothing,
    *,
    only: Collection[str] = (),
    without: Collection[str] = (),
    with_mass: Sequence[MassRecord] = (),
    effort: Effort | None = None,
) -> Explanation:
    """Explain the change since reference logs; without them, the errors of the structure file.

    Parameters
    ----------
    structure : as in its file
    before, now : the reference logs, if there are any, and those to explain; of the reference logs, the windows of
        the state that most of them show are used
    heldout : logs that the fit does not use, to measure the gain on
    on_cause : as for `updater.diagnose`
    only, without : causes to which the search is limited, and that are left out; without `model_parameters` the file's
        own parameters are taken as they are
    with_mass : further records of the state that is explained
    effort : of further measurements; their record is as long as that of `now`

    Raises
    ------
    StateError
        If fewer than three modes can be compared, or modes are invalid; names the state.
    """
    steps: tuple[ReferenceStep, ...] = ()
    with _errors_of_state("reference" if before else "current", structure, before or now):
        if before:
            before, steps = of_one_state(before)
            reference = reference_of(structure, before)
        else:
            devices = sorted(set(now.lateness.devices.values()))
            fixed = structure.model_copy(update={"updating": Updating(fixed=("*",))})
            filed = structure if _FILE_MAY_BE_OFF in allowed_causes(only, without) else fixed
            reference = nominal_reference(filed, now.modes, devices, stated=now.stated)
    with _errors_of_state("heldout"):
        unused = _event(reference, heldout, before) if heldout else None
    with _errors_of_state("mass"):
        known = tuple(
            KnownMass(mass=one.mass, position=one.position, modes=_event(reference, one.observation, before).modes)
            for one in with_mass
        )
    with _errors_of_state("current"):
        event = _event(reference, now, before)
        work = replace(effort or Effort(), record=event.circumstances.effort.record)
        signals = None
        if before and before.sample and now.sample:
            signals = Signals(now=now.sample, before=before.sample, heldout=heldout.sample if heldout else None)
        own = replace(event.circumstances, known_masses=known, effort=work, signals=signals)
        event = replace(event, circumstances=own)
        explained = diagnose(
            reference,
            event.modes,
            heldout=unused.modes if unused else None,
            every=_as_measured(event.measured, now),
            heldout_every=_as_measured(unused.measured, heldout) if unused and heldout else None,
            circumstances=event.circumstances,
            on_cause=on_cause,
            only=only,
            without=without,
        )
    if signals:
        explained = with_breathing(explained, reference, event.modes, signals)
    answer = diagnosis_answer(explained, steps)
    return Explanation(
        explained=explained,
        sought=reference,
        measured=event.measured,
        event=event.modes,
        circumstances=event.circumstances,
        diagnosis=answer.model_copy(update={"exchanged_sections": _exchanged(structure, before, now, answer)}),
    )


def _exchanged(
    structure: Structure, before: Observation | None, now: Observation, answer: DiagnosisAnswer
) -> ExchangedSections | None:
    """Return sections with exchanged dimensions, tested without a reference, or if something does not fit."""
    fit = answer.calibration
    error = fit.frequency_error_percent.after if fit else None
    fits = fit and error is not None and error < _POOR_PERCENT and fit.modes_paired.after == fit.modes_measured
    if before and fits and answer.verdict != "unexplained":
        return None
    modes = mean_modes((before or now).modes)
    return run_optional("the test of the sections' orientation", partial(exchanged_sections, structure, modes))


def with_breathing(found: DiagnosisResult, reference: Reference, event: ModalMean, signals: Signals) -> DiagnosisResult:
    """Return a diagnosis whose losses of stiffness state how far they close; the extended model contains the cracks."""
    recordings = signals.now, signals.before, signals.heldout

    def of(cause: Cause) -> Cause:
        for part in found.parts:
            if part.hypotheses.name == cause.cause and _same_place(part.hypotheses.where(part), cause.where):
                others = [other for other in found.parts if other is not part]
                closing = run_optional(
                    "the test whether it opens and closes",
                    partial(breathing, reference, event, part, *recordings, others=others),
                )
                return cause.model_copy(update={"breathing": closing})
        return cause

    causes = tuple(map(of, found.diagnosis.causes))
    cracks = [c.breathing.opening for c in causes if c.breathing and c.breathing.opening]
    return replace(
        found,
        diagnosis=found.diagnosis.model_copy(update={"causes": causes}),
        extended=with_cracks(found.extended, cracks) if found.extended else None,
    )


def _same_place(one: Where | None, other: Where | None) -> bool:
    """Return whether two places are the same, but for rounding."""
    positions = [where.position if where else None for where in (one, other)]
    first, second = positions
    return first == second or (first is not None and second is not None and math.dist(first, second) < ON_MEMBER)


def reference_of(structure: Structure, before: Observation) -> Reference:
    """Learn the reference from an observation of one state; errors as for `updater.learn_reference`."""
    return learn_reference(
        structure,
        before.estimates,
        before.tracks,
        before.lateness.delays,
        stated=before.stated,
        shaped=before.shaped,
    )


@contextmanager
def _errors_of_state(
    state: State, structure: Structure | None = None, seen: Observation | None = None
) -> Iterator[None]:
    """Raise StateError for modes that cannot be compared; of a structure and its modes, with the likely cause."""
    try:
        yield
    except (ModalDataError, PairingError) as error:
        exchanged = None
        if structure and seen and isinstance(error, PairingError):
            exchanged = run_optional(
                "the test of the sections' orientation", lambda: exchanged_sections(structure, mean_modes(seen.modes))
            )
        raise StateError(state, f"{error}. {exchanged_text(exchanged)}" if exchanged else str(error)) from error


def _event(reference: Reference, observation: Observation, before: Observation | None) -> Event:
    event = event_of(
        reference,
        replace(observation.lateness, estimates=observation.estimates),
        observation.tracks,
        observation.conditions,
        before.conditions if before else None,
    )
    return event if observation.shaped else replace(event, modes=event.modes.without_shapes())
