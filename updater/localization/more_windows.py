"""Accuracy of a located mass against the number of windows, and its limits.

The noise of a mean of n windows decreases with 1 / sqrt(n). The uncertainty of the baseline and the errors of the
reference do not: from some number of windows on they dominate, and more windows are of no use.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes import AddedMass, Bodies
from updater.inference import Fit, compare, linearised
from updater.localization.one_mass import MassChange, fit_mass, mass_change
from updater.modal_data import ModalMean
from updater.reference import Reference

_MAX = 1 << 16  # windows: two months of a window a minute and a half; more are as good as endless
Limit = Literal["windows", "baseline", "model"]


@dataclass(frozen=True, eq=False, kw_only=True)
class AccuracyForecast:
    """Standard deviations of place and mass over the number of windows since the change."""

    n: IndexArray  #: (n_steps,) windows: 1, 2, 4, ...
    distance_std: FloatArray  #: (n_steps,) [m]
    mass_std: FloatArray  #: (n_steps,) [kg]
    windows: int  #: present number of windows of the event
    least_distance_std: float  #: deviation with an infinite number of windows [m]
    least_mass_std: float  #: [kg]
    enough: int  #: number of windows from which their own noise is the smaller part of the deviation of the place
    limited_by: Limit  #: limiting part of the present deviation of the place


def sharpening(reference: Reference, event: ModalMean) -> AccuracyForecast:
    """Estimate the accuracy of one located mass with more windows of the same kind.

    About the most probable place the deviations are those of Gauss-Newton, with the event's own deviations scaled to n
    windows, to none (the limit), and with the baseline's to none as well (error of the model).

    Parameters
    ----------
    reference : learned before the change
    event : (n_tracks,) mean of the windows since the change

    Raises
    ------
    ModalDataError
        If fewer than three modes can be compared, or the input is invalid.
    """
    return _sharpened(reference, event, *fit_mass(reference, event))


def locate_mass_with_forecast(reference: Reference, event: ModalMean) -> tuple[MassChange, AccuracyForecast]:
    """Return the results of `locate_mass` and `sharpening` from one fit; parameters and errors are theirs."""
    found, error = fit_mass(reference, event)
    return mass_change(found, error), _sharpened(reference, event, found, error)


def _sharpened(reference: Reference, event: ModalMean, found: Fit[AddedMass], error: float) -> AccuracyForecast:
    body = _best(found)
    windows = max(int(event.n.max()), 1)

    def std(n: float) -> FloatArray:
        return _std(reference, _scaled(event, np.sqrt(windows / n)), body, error)

    steps = 2 ** np.arange(int(np.log2(max(windows, 64))) + 1)
    steps = np.append(steps, windows) if windows not in steps else steps
    table = np.array([std(n) for n in np.sort(steps)])
    least, sure = std(np.inf), replace(reference, baseline=_scaled(reference.baseline, 0.0))
    return AccuracyForecast(
        n=np.sort(steps),
        distance_std=table[:, 0],
        mass_std=table[:, 1],
        windows=windows,
        least_distance_std=float(least[0]),
        least_mass_std=float(least[1]),
        enough=_first(lambda n: bool(std(n)[0] ** 2 <= 2 * least[0] ** 2)),
        limited_by=_limit(std(windows)[0], least[0], _std(sure, _scaled(event, 0.0), body, error)[0]),
    )


def _best(found: Fit[AddedMass]) -> Bodies:
    """Return the most probable body, its position a parameter."""
    cause, row = found.hypotheses, found.best
    return Bodies(
        grid=cause,
        member=cause.member[row].reshape(1, 1),
        place=cause.position[row].reshape(1, 1),
        start=np.r_[0.0, found.theta[row]][None],
    )


def _scaled(event: ModalMean, factor: float) -> ModalMean:
    return replace(event, log_frequency_std=factor * event.log_frequency_std, shape_std=factor * event.shape_std)


def _std(reference: Reference, event: ModalMean, body: Bodies, error: float) -> FloatArray:
    """Return standard deviations of distance [m] and mass [kg]."""
    data = compare(reference, event, model_error=error)
    slope = linearised(data, replace(body, grid=replace(body.grid, comparison=data)))[1][0]
    covariance = np.linalg.inv(slope.T @ slope + np.diag(body.prior_std**-2.0))
    place, mass = np.sqrt(np.diag(covariance)[:2])
    return np.array([place, np.hypot(mass, reference.calibration.mass_error * body.start[0, 1])])


def _first(enough: Callable[[int], bool]) -> int:
    """Return the least number of windows that is enough, by bisection; they only get better."""
    low, high = 0, 1
    while not enough(high) and high < _MAX:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def _limit(now: float, least: float, by_model: float) -> Limit:
    """Return which variance is the largest: that of the windows, of the baseline or of the model."""
    parts: dict[Limit, float] = {
        "windows": now**2 - least**2,
        "baseline": least**2 - by_model**2,
        "model": by_model**2,
    }
    return max(parts, key=parts.__getitem__)
