"""Measured modes that cannot be right, refused by name before anything is computed from them."""

import numpy as np

from daq import FloatArray, IndexArray
from oma import mac_matrix, pair_modes
from updater.errors import ModalDataError
from updater.modal_data.tracked import ModalMean

_UNITS = {  # one hertz in units in which frequencies are entered by mistake
    "rad/s": 2 * np.pi,
    "kHz": 1e-3,
    "revolutions a minute": 60.0,
}
_UNIT_REACH = 0.2  # ln f: possible change of the structure itself
_SAME_STD = 3.0  # standard deviations within which two frequencies may be one
_SAME_MAC = 0.95  # of two shapes that may be one mode's


def check_baseline(modes: ModalMean) -> None:
    """Refuse a baseline that has one mode on two tracks.

    Raises
    ------
    ModalDataError
        Naming the two.
    """
    for one, other in _alike(modes):
        _refuse_doubled(modes, one, other)


def doubles(modes: ModalMean) -> IndexArray:
    """Return the tracks (n_doubles,) that have the mode of another track: of both, the one of the less certain shape.

    Where one of two close modes is hardly excited, identification may find the other one twice.

    Parameters
    ----------
    modes : (n_tracks,)
    """
    return _less_certain(modes, _alike(modes))


def doubles_since(baseline: ModalMean, event: ModalMean) -> IndexArray:
    """Return the tracks (n_doubles,) of an event that have the mode of another track, which the baseline separates.

    Parameters
    ----------
    baseline, event : as for `check_event`, which refuses such an event
    """
    return _less_certain(event, _now_alike(baseline, event))


def check_event(baseline: ModalMean, event: ModalMean) -> None:
    """Refuse an event that is not of the baseline's structure, or not in its unit.

    Parameters
    ----------
    baseline, event : (n_tracks,) the same tracks at the same channels; the event's shapes may be NaN

    Raises
    ------
    ModalDataError
        Naming the track without a deviation, the unit, or the two tracks that have become one mode.
    """
    unsure = np.flatnonzero(~(event.log_frequency_std >= 0) | ~np.isfinite(event.log_frequency_std))
    if len(unsure):
        found = event.log_frequency_std[unsure[0]]
        raise ModalDataError(f"track {unsure[0]}: expected a standard deviation of its frequency, found {found:g}")
    ratio = float(np.median(event.log_frequency - baseline.log_frequency))
    for unit, factor in _UNITS.items():
        if abs(ratio - np.log(factor)) < _UNIT_REACH:
            raise ModalDataError(
                f"frequencies: expected hertz, found {np.exp(ratio):.4g} times the baseline's: are they in {unit}?"
            )
    for one, other in _now_alike(baseline, event):
        _refuse_doubled(event, one, other)


def _refuse_doubled(modes: ModalMean, one: int, other: int) -> None:
    both = np.exp(modes.log_frequency[[one, other]])
    raise ModalDataError(
        f"tracks {one} and {other} are one mode twice: {both[0]:.5g} and {both[1]:.5g} Hz with the same shape"
    )


def _less_certain(modes: ModalMean, pairs: list[tuple[int, int]]) -> IndexArray:
    """Return of each pair of tracks the one whose shape is less certain."""
    unknown = (modes.shape_std**2).sum(1)
    return np.unique([max(pair, key=lambda track: unknown[track]) for pair in pairs]).astype(np.intp)


def _now_alike(baseline: ModalMean, event: ModalMean) -> list[tuple[int, int]]:
    """Return pairs of tracks that agree in an event, and of which the sensors separate the shapes in the baseline."""
    once = mac_matrix(baseline.shape, baseline.shape)
    return [(one, other) for one, other in _alike(event) if once[one, other] < _SAME_MAC]


def _alike(modes: ModalMean) -> list[tuple[int, int]]:
    """Return pairs of tracks that agree in frequency and shape."""
    shaped = np.flatnonzero(np.isfinite(modes.shape).all(1) & np.isfinite(modes.log_frequency))
    frequency, std, shape = modes.log_frequency[shaped], modes.log_frequency_std[shaped], modes.shape[shaped]
    near = np.abs(frequency[:, None] - frequency) <= _SAME_STD * np.hypot(std[:, None], std)
    found = np.argwhere(np.triu(near & (mac_matrix(shape, shape) > _SAME_MAC), 1))
    return [(int(shaped[i]), int(shaped[j])) for i, j in found]


def check_unit(frequency: FloatArray, shape: FloatArray, known_frequency: FloatArray, known_shape: FloatArray) -> None:
    """Refuse frequencies of which clearly more are paired with known ones in another unit.

    Parameters
    ----------
    frequency, shape : (n,) and (n, n_channels) measured; NaN for a mode that was never seen
    known_frequency, known_shape : (k,) [Hz] and (k, n_channels) of a model or of a baseline

    Raises
    ------
    ModalDataError
        Naming the unit.
    """

    def partners(factor: float) -> int:
        return int((pair_modes(frequency / factor, shape, known_frequency, known_shape) >= 0).sum())

    unit = max(_UNITS, key=lambda name: partners(_UNITS[name]))
    if partners(_UNITS[unit]) >= max(3, 2 * partners(1.0)):
        raise ModalDataError(
            f"frequencies: expected hertz, found {np.round(frequency, 2).tolist()}, which are paired with "
            f"{np.round(known_frequency[:12], 2).tolist()} Hz if they are in {unit}"
        )
