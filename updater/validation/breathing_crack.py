"""Opening and closing of a crack or a gaping connection, from the signals of a window.

Modes show the flexibility that a crack adds on average. If it is open under a moment m above m0 and closed below, its
rotation is c max(m - m0, 0): on average P c m, with P the share of the time in which it is open, and a nonlinear part,
which is not correlated with m or with any force on a linear structure. That part, as a modal force, is followed through
the modes to the sensors, and fitted to their signals by generalised least squares. Its size over that of the mean
flexibility is 1 for a crack that closes completely, and 0 for one that is always open.

The moment is known as far as measured modes show it. The remaining part r is random, so that the mean nonlinear
rotation for a known part s is that of E max(s + r - m0, 0). The model predicts that standard
deviation: that of the modes that are not measured, under the forces that the measured ones show. It is a parameter
within a factor of that, as is m0.

References
----------
Chondros, T. G., Dimarogonas, A. D. & Yao, J. (2001). Vibration of a beam with a breathing crack. J. Sound and Vibration
239(1), 57-67.
Price, R. (1958). A useful theorem for nonlinear devices having Gaussian inputs. IRE Trans. Information Theory 4(2),
69-72 (the mean flexibility is P c).
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts at their first use

from daq import FloatArray, Recording
from updater.causes import Cause, LocalStiffness, Springs, joint_opening
from updater.inference import Fit
from updater.modal_data import ModalMean
from updater.quantities import BREATHES, Breathing, NonlinearGain, Opening, Quantity, rounded_value
from updater.reference import Reference
from updater.structure import BreathingCrack, Structure, with_few_digits
from updater.validation.member_moment import member_moment
from updater.validation.nonlinear_part import (
    PROBABLE,
    UNKNOWN,
    ActionTest,
    Loss,
    LossTests,
    SignalWindow,
)

_APART = 0.015  # of the longest member: distance of places that are tried
_MAX_PLACES = 12
_TRIED = 2000  # alternatives, the most probable first
_MODEL_STD = 0.1  # of the nonlinear part, relative: moments that are not Gaussian, errors of shapes (simulated cracks)
_THRESHOLDS = np.linspace(-1.5, 1.5, 13)  # m0 over the standard deviation of the moment


def breathing(
    reference: Reference,
    event: ModalMean,
    part: Fit[Cause],
    recording: Recording,
    before: Recording | None = None,
    heldout: Recording | None = None,
    others: Sequence[Fit[Cause]] = (),
) -> Breathing | None:
    """Return how far a loss of stiffness closes; None for other causes, short records or too few channels.

    The probable places of the loss are tried, because the nonlinear part of the signals shows the place too. Where they
    are probable by the evidence of the signals, the p value is multiplied by the number of its tests as well. Forces
    that are not symmetric, such as blows from one side, have a nonlinear part in a linear structure. It is measured
    before the loss, and subtracted.

    Parameters
    ----------
    reference : of the structure without the loss
    event : (n_tracks,) modes of the window
    part : fit of the cause
    recording : signals of the window, the delays of devices removed; of the longest stretch without a gap the last 2^16
        samples
    before : likewise, of a window without the loss
    heldout : likewise, of a window with the loss, which is predicted
    others : fits of the other causes of the same joint fit
    """
    cause = part.hypotheses
    if not isinstance(cause, LocalStiffness | Springs):
        return None
    place = LossTests.of(cause, event, recording, before)
    if place is None:
        return None
    prior = part.log_density + cause.log_prior - joint_opening(part, others)
    tests = [
        test
        for row in _places(cause, part)
        for test in place.at(part.theta[row], row, float(prior[row]), at_best=row == part.best)
    ]
    if not tests:
        return None  # stiffness was gained
    best = max(tests, key=lambda test: test.log_density)
    bias, of_bias, p_value = best.against(place.before(best))
    known = cause.comparison.circumstances.opening.get(cause.name)
    n_tests = len(tests) + (known.n_tests if known else 0)
    posterior = _Posterior.of(tests, (bias, of_bias), min(1.0, n_tests * p_value), 1 / cause.deviations(part))
    if not posterior.closes:
        return posterior.breathing
    unused = None if heldout is None else SignalWindow.of(posterior.best.test.state, cause.comparison, heldout)
    more = {
        "opening": _opening(reference, cause, part, posterior, tests),
        "heldout": None if unused is None else posterior.best.predicted(unused),
    }
    return posterior.breathing.model_copy(update=more)


def _opening(
    reference: Reference,
    cause: Loss,
    part: Fit[Any],
    posterior: "_Posterior",
    tests: Sequence[ActionTest],
) -> Opening | None:
    """Return the moment that opens the place; None if it is not one of a member."""
    position, std = cause.where(part).position, 1 / cause.deviations(part)
    here = [test for test in tests if test.at_best]
    if position is None or not here:
        return None
    test = max(here, key=lambda one: one.log_density)
    found = member_moment(reference, cause.comparison, position, test.action.value)
    if found is None:
        return None
    share, open_time = posterior.breathing.share, posterior.breathing.open_time
    assert open_time
    mean = found.coefficient**2 * test.action.relief
    of_moment = test.moment_std * found.root_rigidity / (abs(found.coefficient) * test.action.relief)
    more = (1 - open_time.value) / open_time.value
    of_open = np.hypot(more * share.std, share.value * open_time.std / open_time.value**2)
    side = test.side(posterior.bias) * float(np.sign(found.coefficient))
    flexibility, closed = (1 + share.value * more) * mean, (1 - share.value) * mean
    threshold, of_threshold = posterior.threshold
    return Opening(
        member=found.member,
        position=position,
        axis=found.axis,
        flexibility=Quantity(value=flexibility, std=float(np.hypot(of_open * mean, std * flexibility)), unit="m"),
        closed=Quantity(value=closed, std=float(np.hypot(share.std * mean, std * closed)), unit="m"),
        mean=Quantity(value=mean, std=std * mean, unit="m"),
        moment=Quantity(value=side * threshold * of_moment, std=of_threshold * of_moment, unit="N m"),
        opens="above" if side > 0 else "below",
    )


def with_cracks(structure: Structure, openings: Sequence[Opening]) -> Structure:
    """Return a structure with cracks whose mean flexibility it contains; numbers rounded by their deviations."""
    cracks = [
        BreathingCrack(
            member=one.member,
            at=one.position,
            axis=one.axis,
            **{name: _rounded(getattr(one, name)) for name in ("flexibility", "closed", "mean")},
            moment=round(one.moment.value, 1 - math.floor(math.log10(one.moment.std))) + 0.0,
            opens=one.opens,
        )
        for one in openings
    ]
    own = structure.model_copy(update={"breathing_crack": (*structure.breathing_crack, *cracks)})
    return with_few_digits(own, structure)


def _places(cause: Loss, part: Fit[Any]) -> list[int]:
    """Return the best alternative at each probable place, the best of all first; of springs the best one alone."""
    found = [part.best]
    if isinstance(cause, Springs):
        return found
    density, points = part.log_density + cause.log_prior, cause.places(part.theta, np.arange(len(part.theta)))
    apart = _APART * max(member.length for member in cause.reference.structure.member)
    for row in np.argsort(-density)[:_TRIED]:
        if density[row] < density[part.best] - PROBABLE or len(found) == _MAX_PLACES:
            break
        if np.linalg.norm(points[found] - points[row], axis=1).min() > apart:
            found.append(int(row))
    return found


def _rounded(quantity: Quantity) -> float:
    return rounded_value(quantity.value, quantity.std)


@dataclass(frozen=True)
class _Setting:
    """A place, a moment at which it opens, and a standard deviation of the unknown part of the moment."""

    test: "ActionTest"
    threshold: float  #: over the standard deviation of the whole moment [-]
    unknown: int  #: number of the deviation of the unknown part, relative to that by the model
    size: float  #: of the nonlinear part, as for the mean flexibility [-]

    @property
    def whole(self) -> float:
        """Standard deviation of the whole moment over that of the known part."""
        return self.test.whole(self.unknown)

    def predicted(self, window: "SignalWindow") -> NonlinearGain:
        """Return how well the nonlinear part of signals is predicted that were not used."""
        state, action = self.test.state, self.test.action
        other = ActionTest(window, state, window.modal_motion(state), action)
        ratio = self.whole * self.test.moment_std / (other.whole(self.unknown) * other.moment_std)
        return other.predicted_by(self.size, self.threshold * ratio, self.unknown)


@dataclass(frozen=True)
class _Posterior:
    """Mean over places, unknown parts of the moment and, if it is significant, thresholds."""

    breathing: Breathing
    bias: float  #: size without a loss
    threshold: tuple[float, float]  #: over the standard deviation of the known moment, and its own deviation [-]
    best: _Setting  #: the most probable one

    @property
    def closes(self) -> bool:
        """True if the place opens and closes."""
        return self.breathing.significant

    @classmethod
    def of(cls, tests: Sequence[ActionTest], bias: tuple[float, float], p_value: float, std: float) -> "_Posterior":
        """Return the posterior.

        Parameters
        ----------
        bias : size without a loss, and its variance
        p_value : of all tests
        std : of the mean flexibility, relative [-]
        """
        closes = p_value < BREATHES
        grid = list(itertools.product(_THRESHOLDS if closes else (0.0,), range(len(UNKNOWN))))
        most = max(test.log_density for test in tests)
        cells = [(test, *values) for test in tests if test.log_density > most - PROBABLE for values in grid]
        log, share, variance, often = np.array([test.fitted(*bias, *values) for test, *values in cells]).T
        variance += (std**2 + _MODEL_STD**2) * share**2
        if closes:
            log, share, variance = _within_bounds(log, share, variance)
        weight = np.exp(log - log.max())
        weight /= weight.sum()
        mean, open_time = float(weight @ share), float(weight @ often)
        spread = float(weight @ (variance + (share - mean) ** 2))
        cell = float(np.ptp(_THRESHOLDS)) / (len(_THRESHOLDS) - 1)
        resolved = cell * scipy.stats.norm.pdf(0.0)
        # a shift of m0 by a share of the moment's deviation changes the nonlinear part by about the same share of it
        of_model = _MODEL_STD * scipy.stats.norm.pdf(scipy.stats.norm.isf(open_time))
        of_time = float(weight @ (often - open_time) ** 2 + resolved**2 / 12 + of_model**2) ** 0.5
        whole = np.array([test.whole(unknown) for test, _, unknown in cells])
        opens = whole * [threshold for _, threshold, _ in cells]
        threshold = float(weight @ opens)
        best = int(np.argmax(weight))
        test, opening, unknown = cells[best]
        size = test.side(bias[0]) * float(share[best] / (often[best] * test.action.relief))
        return cls(
            breathing=Breathing(
                share=Quantity(value=mean, std=spread**0.5, unit="-"),
                open_time=Quantity(value=open_time, std=of_time, unit="-") if closes else None,
                p_value=p_value,
            ),
            bias=bias[0],
            threshold=(
                threshold,
                float(weight @ ((opens - threshold) ** 2 + (_MODEL_STD * whole) ** 2) + cell**2 / 12) ** 0.5,
            ),
            best=_Setting(test, opening, unknown, size),
        )


def _within_bounds(
    log: FloatArray, mean: FloatArray, variance: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return log densities, means and variances of shares from 0 to 1: a closed place is no stiffer than before."""
    std = np.sqrt(variance)
    low, high = -mean / std, (1 - mean) / std
    nearer = np.where(mean < 0.5, -low, high)  # the bounds as quantiles of the tail that holds less
    farther = np.where(mean < 0.5, -high, low)
    inside = scipy.special.log_ndtr(nearer)
    inside += np.log1p(-np.exp(scipy.special.log_ndtr(farther) - inside))
    found = scipy.stats.truncnorm(low, high, loc=mean, scale=std)
    return log + inside, np.asarray(found.mean()), np.asarray(found.var())
