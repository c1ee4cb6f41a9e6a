"""Opening and closing of a crack, a gaping connection or play, from the signals of a window.

Modes show the flexibility that a crack adds on average. If it is open under a moment m above m0 and closed below, its
rotation is c max(m - m0, 0): on average P c m, with P the share of the time in which it is open, and a nonlinear part,
which is not correlated with m or with any force on a linear structure. That part, as a modal force, is followed through
the modes to the sensors, and fitted to their signals by generalised least squares. Its size over that of the mean
flexibility is 1 for a crack that closes completely, and 0 for one that is always open.

Play is softer within a moment on both sides, |m| < m0; a connection that gapes, or slips, under both signs of the load
is softer beyond. The rotation beyond is c (max(m - m0, 0) - max(-m - m0, 0)). These laws are tried too.

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
from updater.quantities import BREATHES, Breathing, Law, NonlinearGain, Opening, Opens, Quantity, rounded_value
from updater.reference import Reference
from updater.structure import BreathingCrack, Structure, with_few_digits
from updater.validation.member_moment import member_moment
from updater.validation.nonlinear_part import (
    PROBABLE,
    UNKNOWN,
    UNKNOWN_LOG_DENSITY,
    ActionTest,
    Loss,
    LossTests,
    SignalWindow,
)

_APART = 0.015  # of the longest member: distance of places that are tried
_MAX_PLACES = 12
_TRIED = 2000  # alternatives, the most probable first
_MODEL_STD = 0.1  # of the nonlinear part, relative: moments that are not Gaussian, errors of shapes (simulated cracks)
# of the share of a place that opens on both sides, relative: the nonlinear part is of first order (25 simulated draws)
_SYMMETRIC_STD = 0.35
_THRESHOLDS = np.linspace(-1.5, 1.5, 13)  # m0 over the standard deviation of the moment
_OF_BOTH_SIDES = np.linspace(0.25, 2.5, 10)  # the same of a place that opens, or closes, on both sides


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
        law
        for row in _places(cause, part)
        for test in place.at(part.theta[row], row, float(prior[row]), at_best=row == part.best)
        for law in (test, test.of_both_sides())
    ]
    if not tests:
        return None  # stiffness was gained
    known = cause.comparison.circumstances.opening.get(cause.name)
    n_tests = len(tests) + (known.n_tests if known else 0)
    posterior = _most_probable_law(place, tests, n_tests, cause.relative_std(part))
    if not posterior.closes:
        return posterior.breathing
    unused = None if heldout is None else SignalWindow.of(posterior.best.test.state, cause.comparison, heldout)
    more = {
        "opening": _opening(reference, cause, part, posterior, tests),
        "heldout": None if unused is None else posterior.best.predicted(unused),
    }
    return posterior.breathing.model_copy(update=more)


def _most_probable_law(place: LossTests, tests: Sequence[ActionTest], n_tests: int, std: float) -> "_Posterior":
    """Return the posterior of the law that is more probable; of the larger share where nothing is significant.

    Parameters
    ----------
    n_tests : by which the smallest p value is multiplied
    std : of the mean flexibility, relative [-]
    """
    laws = [[test for test in tests if test.symmetric == symmetric] for symmetric in (False, True)]
    # alike for all places and laws: the products of one that does not hold scatter more
    noise = max(tests, key=lambda test: test.explained).spread
    best = [max(law, key=lambda test: test.log_density(noise)) for law in laws]
    usual = [test.against(place.before(test)) for test in best]
    p_value = min(1.0, n_tests * min(p for _, _, p in usual))
    found = [
        _Posterior.of(own, (bias, of_bias), p_value, std, noise)
        for own, (bias, of_bias, _) in zip(laws, usual, strict=True)
    ]
    return max(found, key=lambda one: one.log_evidence if one.closes else one.breathing.upper_share)


def _opening(
    reference: Reference,
    cause: Loss,
    part: Fit[Any],
    posterior: "_Posterior",
    tests: Sequence[ActionTest],
) -> Opening | None:
    """Return the moment that opens the place; None if it is not one of a member."""
    position, std = cause.where(part).position, cause.relative_std(part)
    best, law = posterior.best.test, posterior.breathing.law
    kind = best.symmetric, best.action.axis
    test = next((one for one in tests if one.at_best and (one.symmetric, one.action.axis) == kind), None)
    if position is None or test is None:
        return None
    found = member_moment(reference, cause.comparison, position, test.action.value)
    if found is None:
        return None
    share, open_time = posterior.breathing.share, posterior.breathing.open_time
    assert open_time
    assert law
    mean = found.coefficient**2 * test.action.relief
    of_moment = test.moment_std * found.root_rigidity / (abs(found.coefficient) * test.action.relief)
    more = (1 - posterior.part) / posterior.part
    of_open = np.hypot(more * share.std, share.value * open_time.std / posterior.part**2)
    above = test.side(posterior.bias) * found.coefficient > 0
    opens: dict[Law, Opens] = {"one_side": "above" if above else "below", "within": "within", "beyond": "beyond"}
    sign = 1.0 if test.symmetric or above else -1.0
    flexibility, closed = (1 + share.value * more) * mean, (1 - share.value) * mean
    threshold, of_threshold = posterior.threshold
    return Opening(
        member=found.member,
        position=position,
        axis=found.axis,
        flexibility=Quantity(value=flexibility, std=float(np.hypot(of_open * mean, std * flexibility)), unit="m"),
        closed=Quantity(value=closed, std=float(np.hypot(share.std * mean, std * closed)), unit="m"),
        mean=Quantity(value=mean, std=std * mean, unit="m"),
        moment=Quantity(value=sign * threshold * of_moment, std=of_threshold * of_moment, unit="N m"),
        opens=opens[law],
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
        state = self.test.state
        other = self.test.in_window(window, state, window.modal_motion(state))
        ratio = self.whole * self.test.moment_std / (other.whole(self.unknown) * other.moment_std)
        return other.predicted_by(self.size, self.threshold * ratio, self.unknown)


@dataclass(frozen=True)
class _Posterior:
    """Mean over places, unknown parts of the moment and, if it is significant, thresholds."""

    breathing: Breathing
    bias: float  #: size without a loss
    threshold: tuple[float, float]  #: over the standard deviation of the known moment, and its own deviation [-]
    best: _Setting  #: the most probable one
    log_evidence: float  #: of the law
    part: float  #: part of the flexibility while open that the mean contains, beyond that while closed [-]

    @property
    def closes(self) -> bool:
        """True if the place opens and closes."""
        return self.breathing.significant

    @classmethod
    def of(
        cls, tests: Sequence[ActionTest], bias: tuple[float, float], p_value: float, std: float, noise: float
    ) -> "_Posterior":
        """Return the posterior.

        Parameters
        ----------
        bias : size without a loss, and its variance
        p_value : of all tests
        std : of the mean flexibility, relative [-]
        noise : variance of the products over the expected one, alike for places and laws that are compared
        """
        closes = p_value < BREATHES
        thresholds = _OF_BOTH_SIDES if tests[0].symmetric else _THRESHOLDS
        grid = list(itertools.product(thresholds if closes else (tests[0].usual_threshold,), range(len(UNKNOWN))))
        least = max(test.log_density(noise) for test in tests) - PROBABLE
        cells = [(test, *values) for test in tests if test.log_density(noise) > least for values in grid]
        explained, width, share, variance, often, part = np.array(
            [test.fitted(*bias, *values) for test, *values in cells]
        ).T
        variance += (std**2 + _MODEL_STD**2) * share**2
        prior = np.array([test.prior + UNKNOWN_LOG_DENSITY[unknown] for test, _, unknown in cells])
        # the integral over the share, whose density is uniform
        log = prior + explained / noise + np.log(width * np.sqrt(noise))
        if closes:
            log, share, variance = _within_bounds(log, share, variance)
        log_evidence = float(scipy.special.logsumexp(log)) - np.log(len(grid))
        weight = np.exp(log - log.max())
        weight /= weight.sum()
        mean, open_time = float(weight @ share), float(weight @ often)
        of_law = _SYMMETRIC_STD * mean if tests[0].symmetric else 0.0
        spread = float(weight @ (variance + (share - mean) ** 2)) + of_law**2
        cell = float(np.ptp(thresholds)) / (len(thresholds) - 1)
        best = int(np.argmax(weight))
        test, opening, unknown = cells[best]
        side = test.side(bias[0])
        resolved = cell * test.open_time_slope(0.5, side)
        # a shift of m0 by a share of the moment's deviation changes the nonlinear part by about the same share of it
        of_model = _MODEL_STD * test.open_time_slope(open_time, side)
        of_time = float(weight @ (often - open_time) ** 2 + resolved**2 / 12 + of_model**2) ** 0.5
        whole = np.array([own.whole(number) for own, _, number in cells])
        opens = whole * [threshold for _, threshold, _ in cells]
        threshold = float(weight @ opens)
        size = side * float(share[best] / (part[best] * test.action.relief))
        return cls(
            breathing=Breathing(
                share=Quantity(value=mean, std=spread**0.5, unit="-"),
                open_time=Quantity(value=open_time, std=of_time, unit="-") if closes else None,
                p_value=p_value,
                law=test.law(bias[0]) if closes else None,
            ),
            bias=bias[0],
            threshold=(
                threshold,
                float(weight @ ((opens - threshold) ** 2 + (_MODEL_STD * whole) ** 2) + cell**2 / 12) ** 0.5,
            ),
            best=_Setting(test, opening, unknown, size),
            log_evidence=log_evidence,
            part=float(weight @ part),
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
    # densities at the bounds; `scipy.stats.truncnorm` has the same moments, but computes them one by one
    at_low, at_high = (np.exp(-0.5 * bound**2 - inside) / math.sqrt(2 * math.pi) for bound in (low, high))
    shift = at_low - at_high
    spread = 1 + low * at_low - high * at_high - shift**2
    return log + inside, mean + std * shift, variance * np.maximum(spread, 0.0)
