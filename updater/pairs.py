"""Two causes at once, to first order: every alternative of every cause beside every other.

Where two act, the one that explains most alone may be neither of them, and nothing leads from it to the two. To first
order what two do is the sum of what each does: all pairs of some hundred alternatives are looked at in a tenth of a
second.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.candidates import Weighing
from updater.causes.attached_oscillator import hides
from updater.causes.common_factor import CommonFactor
from updater.causes.composite import Chosen
from updater.first_order import pulls

_MOST = 300  # alternatives of a cause that are looked at; of more, evenly many
_LEAST = 1.0  # of chi-square, by a step of one prior standard deviation: what does less explains nothing
_ALIKE = 1e-6  # of the product of two squares, the determinant of what acts alike: one of them is enough
_FARTHEST = 3.0  # prior standard deviations that a fit begins from


@dataclass(frozen=True, eq=False)
class _Columns:
    """Effect of a unit of each parameter of each alternative on the data, besides a drift common to all frequencies."""

    names: list[str]  #: of the causes
    effect: FloatArray  #: (n, n_data) whitened
    precision: FloatArray  #: (n,) of the priors
    log_prior: FloatArray  #: (n,) of the alternatives and their causes
    cause: IndexArray  #: (n,)
    row: IndexArray  #: (n,) alternative
    parameter: IndexArray  #: (n,)
    rest: FloatArray  #: (n_data,) whitened, that nothing but a drift leaves


def likeliest_pair(weighing: Weighing) -> tuple[Chosen, Chosen] | None:
    """Return the two alternatives that explain most together, as they do to first order; None if there are no two."""
    columns = _columns(weighing)
    if columns is None:
        return None
    gram, score = columns.effect @ columns.effect.T, columns.effect @ columns.rest
    square = np.diagonal(gram) + columns.precision
    product = np.outer(square, square)
    determinant = product - gram**2
    cross = np.outer(score**2, square)
    gain = (cross + cross.T - 2 * np.outer(score, score) * gram) / np.maximum(determinant, _ALIKE * product)
    evidence = gain / 2 + columns.log_prior[:, None] + columns.log_prior
    same = (columns.cause[:, None] == columns.cause) & (columns.row[:, None] == columns.row)
    evidence[same | (determinant < _ALIKE * product)] = -np.inf
    one, other = (int(k) for k in np.unravel_index(np.argmax(evidence), evidence.shape))
    if evidence[one, other] == -np.inf:
        return None
    both = [one, other]
    normal = gram[np.ix_(both, both)] + np.diag(columns.precision[both])
    first, second = np.linalg.solve(normal, score[both]).tolist()
    return _begun(weighing, columns, one, first), _begun(weighing, columns, other, second)


def _columns(weighing: Weighing) -> _Columns | None:
    data = replace(weighing.data, plain=weighing.data.drifting)  # sensors, too, beside a drift
    names: list[str] = []
    parts = []
    for name, cause in weighing.causes.items():
        std, n = cause.prior_std, len(cause.log_prior)
        if hides(cause) or isinstance(cause, CommonFactor) or not len(std):
            continue
        rows = np.arange(0, n, -(-n // _MOST))
        rest, effect = pulls(data, cause, rows)
        at, parameter = np.nonzero((effect**2).sum(1) * std**2 > _LEAST)
        prior = cause.log_prior[rows[at]] + weighing.log_prior(name)
        parts.append(
            (effect[at, :, parameter], std[parameter] ** -2, prior, np.full(len(at), len(names)), rows[at], parameter)
        )
        names.append(name)
    if not parts:
        return None
    effect, precision, prior, number, row, parameter = (np.concatenate(each) for each in zip(*parts, strict=True))
    return _Columns(names, effect, precision, prior, number, row, parameter, -rest)


def _begun(weighing: Weighing, columns: _Columns, number: int, strength: float) -> Chosen:
    cause, row = weighing.causes[columns.names[columns.cause[number]]], int(columns.row[number])
    theta, at = cause.idle[row].copy(), int(columns.parameter[number])
    theta[at] = strength
    reach = _FARTHEST * cause.prior_std
    return Chosen(cause, row, np.maximum(np.clip(theta, -reach, reach), cause.lower[row]))
