"""Shapes and signals before and after a change, for drawings."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from daq import FloatArray, Recording
from oma import mac_matrix
from updater import ModalMean, Reference, correlate_modes
from updater.reference import LARGEST_CLUSTER, expand_shape
from updater.validation import modes_before, modes_with_causes

if TYPE_CHECKING:
    from updater import DiagnosisResult


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeShapes:
    """Shapes of one mode, each scaled to fit the measured one, whose largest component is 1."""

    frequency_before: float  #: [Hz]
    frequency: float  #: measured now [Hz]
    before: FloatArray  #: (n_channels,) measured in the reference logs, else of the model [-]
    now: FloatArray  #: (n_channels,) measured [-]
    before_moved: FloatArray  #: (n_nodes, 3) the same at the nodes of the reference's model
    now_moved: FloatArray  #: (n_nodes, 3); the largest motion is 1
    with_causes: FloatArray | None = None  #: (n_channels,) expected with the diagnosed causes [-]; None without any


@dataclass(frozen=True, eq=False, kw_only=True)
class StateComparison:
    """Two states of a structure: as expected before, and as measured now."""

    channels: tuple[str, ...]  #: channels of the shapes
    shapes: tuple[ModeShapes, ...]  #: in the order of the measured frequencies
    measured_before: bool  #: whether the state before is that of reference logs; else it is that of the model
    signals_before: Recording | None = None  #: last window of the reference logs
    signals: Recording | None = None  #: last window of the logs


def compare_states(
    reference: Reference,
    measured: ModalMean,
    explained: "DiagnosisResult",
    before: Recording | None,
    now: Recording | None,
) -> StateComparison:
    """Return the shapes and signals of both states.

    Parameters
    ----------
    reference : that was diagnosed
    measured : (n_modes,) modes now, with measured shapes
    explained : diagnosis, whose extended structure gives the shapes with the causes
    before, now : signals of the reference logs, if there are any, and of the logs

    Raises
    ------
    ModalDataError
        If fewer than two channels are common to both.
    """
    expected = modes_before(reference, float(np.exp(np.nanmax(measured.log_frequency))))
    pairs = _pairs(expected, measured)
    changed = modes_with_causes(reference, explained.extended, expected) if explained.extended else None
    after = _pairs(changed, measured) if changed else {}
    channels = tuple(c for c in expected.channels if c in measured.channels)
    old, new = expected.at(channels), measured.at(channels)
    causes = changed.at(channels) if changed else None
    shapes = []
    for column in sorted(pairs, key=lambda k: float(measured.log_frequency[k])):
        shape = new.shape[column] / np.abs(new.shape[column]).max()
        row = after.get(column)
        earlier = _scaled(old.shape[pairs[column]], shape)
        moved = [_at_nodes(reference, channels, one) for one in (earlier, shape)]
        largest = max(float(np.linalg.norm(moved[1], axis=1).max()), 1e-300)
        shapes.append(
            ModeShapes(
                frequency_before=float(np.exp(old.log_frequency[pairs[column]])),
                frequency=float(np.exp(new.log_frequency[column])),
                before=earlier,
                now=shape,
                before_moved=moved[0] / largest,
                now_moved=moved[1] / largest,
                with_causes=_scaled(causes.shape[row], shape) if causes and row is not None else None,
            )
        )
    return StateComparison(
        channels=channels,
        shapes=tuple(shapes),
        measured_before=before is not None,
        signals_before=before,
        signals=now,
    )


def _pairs(simulated: ModalMean, measured: ModalMean) -> dict[int, int]:
    """Return measured -> expected mode."""
    seen = np.flatnonzero(np.isfinite(measured.log_frequency) & np.isfinite(measured.shape).all(1))
    partner = correlate_modes(simulated, measured.only(seen)).partner
    return {int(seen[column]): row for row, column in enumerate(partner.tolist()) if column >= 0}


def _at_nodes(reference: Reference, channels: tuple[str, ...], shape: FloatArray) -> FloatArray:
    """Return a shape (n_channels,) expanded to the nodes (n_nodes, 3) by the model's modes most like it."""
    model = reference.at_channels(channels).T
    likest = int(np.argmax(mac_matrix(shape[None], model)[0]))
    expansion = expand_shape(shape, model, 2 * np.pi * reference.frequency, likest, largest=LARGEST_CLUSTER)
    at_dofs = reference.shape @ (expansion.inverse @ shape)
    return np.asarray(np.append(at_dofs, 0.0)[reference.model.dofs[:, :3]])  # -1: a DOF that is held


def _scaled(shape: FloatArray, like: FloatArray) -> FloatArray:
    """Return a shape (n_channels,) with the factor that fits another one best."""
    return np.asarray(shape * float(shape @ like) / max(float(shape @ shape), 1e-300))
