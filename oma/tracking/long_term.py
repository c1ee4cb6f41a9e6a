"""Modes followed for years: they drift with the seasons, cross, vanish and return, and keep their identities.

`Tracker` compares with a constant reference. Here the reference follows: log frequencies as a random walk, part of it
common to all modes (temperature), so that measured modes predict the others; shapes as a slow mean. The complete state
is in a `Tracks`, passed in and returned: the same windows give the same identities, live or replayed.

References
----------
Kalman, R. E. (1960). A new approach to linear filtering and prediction problems. Journal of Basic Engineering 82(1).
Blackman, S., Popoli, R. (1999). Design and analysis of modern tracking systems. Artech House: gates, global nearest
neighbour assignment, tracks confirmed by repeated sightings.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from oma.mac import mac_matrix, normalise
from oma.preparation import BoolArray
from oma.tracking.pairing import assign, assign_gains
from oma.tracking.track_state import Tracks, common_places, joined, no_tracks, only, relative_variance
from oma.types import ComplexArray, ModalEstimate

_HOUR = 3.6e12  # ns
_TAIL = 4.0  # degrees of freedom of frequency errors: a change of the structure is not noise
# windows without the mode that are assumed before its first one: a new mode is not assumed to be frequent
_UNSEEN = 100.0
_DOUBT = 4.0  # of the cost, -2 ln likelihood: an exchange of two identities that costs less is no unlikely one


@dataclass(frozen=True, eq=False, kw_only=True)
class FollowedModes:
    """Tracks of the modes of one window."""

    tracks: Tracks  #: state for the next window
    identity: IndexArray  #: (n_modes,) of each mode of the estimate
    known: BoolArray  #: (n_modes,) seen often enough before to be a mode of the structure
    doubtful: BoolArray  #: (n_modes,) could be exchanged with another: modes so close that they mix have no identity


@dataclass(frozen=True, kw_only=True)
class LongTermTracker:
    """Assigns modes of a window to tracks, and updates the tracks."""

    common_drift: float = 4e-3  #: standard deviation of all log frequencies together after an hour (temperature) [-]
    own_drift: float = 2e-3  #: standard deviation of each log frequency alone after an hour [-]
    most_drift: float = 0.03  #: largest deviation of a mode that was not measured for long [-]
    n_sigma: float = 4.0  #: gate of prediction and estimate together, for any mode [-]
    min_mac: float = 0.5  #: smallest MAC of a known mode within the gate; two orthogonal shapes cannot both have it [-]
    min_mac_new: float = 0.8  #: the same for a mode that is not known yet, and for a mode with its successor
    max_jump: float = 0.08  #: largest change of ln f by which a changed structure may move a mode to its successor
    novelty: float = 45.0  #: -2 ln likelihood from which a mode is rather a new one
    shape_noise: float = 0.05  #: 1 - MAC of a shape with itself, in addition to its standard deviations [-]
    memory: int = 100  #: windows over which shapes are averaged
    confirm: int = 4  #: windows that make a mode known
    patience: float = 48.0  #: after which one seen in fewer is forgotten [h]

    def follow(self, tracks: Tracks | None, estimate: ModalEstimate) -> FollowedModes:
        """Give each mode of a window its identity.

        One to one with the least sum of -2 ln likelihood: of Student's t about the predicted frequency, of the shape,
        and of the rate at which a mode is measured. Shapes decide where modes cross, frequencies where sensors do not
        distinguish shapes. A mode that continues no track begins one. If it is measured again and the similar mode is
        not, a change of the structure has moved that mode, and the new one inherits its identity once it is known.

        Parameters
        ----------
        tracks : Tracks, optional
            From the window before; None begins.
        estimate : ModalEstimate

        Returns
        -------
        FollowedModes

        Raises
        ------
        ValueError
            If fewer than two channels are common to both.
        """
        tracks = self._predicted(tracks or no_tracks(estimate), estimate.end)
        cost, possible = self._cost(tracks, estimate)
        place = assign_gains(np.where(possible, self.novelty - cost, 0.0))
        new = np.setdiff1d(np.arange(estimate.n_modes), place)
        updated = joined(self._updated(tracks, estimate, place), estimate, new)
        inherited, left = self._inherited(updated)
        identity = np.full(estimate.n_modes, -1, np.intp)
        identity[place[place >= 0]] = inherited[: len(place)][place >= 0]
        identity[new] = inherited[len(place) :]
        updated = only(replace(updated, identity=inherited), left)
        known = np.isin(identity, updated.identity[updated.seen >= self.confirm])
        doubtful = np.zeros(estimate.n_modes, np.bool_)
        doubtful[place[place >= 0]] = _doubtful(cost, possible, place)[place >= 0]
        return FollowedModes(
            tracks=self._without_strangers(updated),
            identity=identity,
            known=known,
            doubtful=doubtful,
        )

    def _predicted(self, tracks: Tracks, time: int) -> Tracks:
        """Let time pass: a random walk, but not beyond `most_drift`."""
        n, hours = len(tracks.identity), max(time - tracks.time, 0) / _HOUR
        walk = self.common_drift**2 * np.ones((n, n)) + self.own_drift**2 * np.eye(n)
        covariance = tracks.covariance + hours * walk
        shrink = np.minimum(1, self.most_drift / np.sqrt(np.diag(covariance)))
        return replace(tracks, covariance=covariance * np.outer(shrink, shrink), time=max(time, tracks.time))

    def _cost(self, tracks: Tracks, estimate: ModalEstimate) -> tuple[FloatArray, BoolArray]:
        """Return -2 ln likelihood of each pair (n_tracks, n_modes), but for a constant, and which can be."""
        agreement, noise = _agreement(tracks, estimate)
        shift = np.abs(np.log(estimate.frequency) - tracks.log_frequency[:, None])
        z = shift / np.sqrt(np.diag(tracks.covariance)[:, None] + relative_variance(estimate))
        known = (tracks.seen >= self.confirm)[:, None]
        possible = (z < self.n_sigma) & (agreement >= np.where(known, self.min_mac, self.min_mac_new) - noise)
        often = (tracks.seen / (tracks.since + _UNSEEN))[:, None]
        cost = (_TAIL + 1) * np.log1p(z**2 / _TAIL) + (1 - agreement) / (self.shape_noise + noise)
        return cost - 2 * np.log(often / (1 - often)), possible

    def _updated(self, tracks: Tracks, estimate: ModalEstimate, place: IndexArray) -> Tracks:
        """Update with the measured modes: a Kalman filter for frequencies, a slow mean for shapes."""
        rows = np.flatnonzero(place >= 0)
        columns = place[rows]
        seen, last = tracks.seen.copy(), tracks.last.copy()
        seen[rows] += 1
        last[rows] = estimate.end
        innovation = np.log(estimate.frequency[columns]) - tracks.log_frequency[rows]
        variance = relative_variance(estimate)[columns]
        expected = tracks.covariance[rows]
        gain = np.linalg.solve(expected[:, rows] + np.diag(variance), expected).T
        covariance = tracks.covariance - gain @ expected
        return replace(
            tracks,
            log_frequency=tracks.log_frequency + gain @ innovation,
            covariance=(covariance + covariance.T) / 2,
            shape=self._mean_shapes(tracks, estimate, rows, columns),
            seen=seen,
            since=tracks.since + 1,
            last=last,
        )

    def _mean_shapes(
        self, tracks: Tracks, estimate: ModalEstimate, rows: IndexArray, columns: IndexArray
    ) -> ComplexArray:
        """Return the shapes with those of a window that has all channels averaged in."""
        if estimate.channels != tracks.channels or not len(rows):
            return tracks.shape
        shape, now = tracks.shape.copy(), estimate.shape[columns]
        turn = np.exp(1j * np.angle(np.sum(shape[rows] * now.conj(), axis=1)))[:, None]
        share = 1 / np.minimum(tracks.seen[rows] + 1, self.memory)[:, None]
        shape[rows] = normalise((1 - share) * shape[rows] + share * turn * now)
        return shape

    def _inherited(self, tracks: Tracks) -> tuple[IndexArray, IndexArray]:
        """Let modes that just became known inherit from those they resemble and that were not seen since their first.

        A single window cannot move a mode far: one false pole with a similar shape would change it. Nor does a single
        window keep it: if the first window of a mode had a wrong shape, later ones replace it.

        Returns
        -------
        identity : (n_tracks,) array of int
        left : array of int
            Tracks without those that were inherited from.
        """
        heirs = (tracks.seen == self.confirm) & (tracks.last == tracks.time)
        shift = np.abs(tracks.log_frequency[:, None] - tracks.log_frequency)
        variance = np.diag(tracks.covariance)
        agreement = mac_matrix(tracks.shape, tracks.shape)
        near = (shift**2 < self.n_sigma**2 * (variance[:, None] + variance)) & (agreement >= self.min_mac)
        known = (tracks.seen >= self.confirm)[:, None]
        fits = near | (known & (shift < self.max_jump) & (agreement >= self.min_mac_new))
        fits &= heirs & (tracks.last[:, None] < tracks.first)
        heir = assign(shift + ~known, fits)  # known modes before others
        old = np.flatnonzero(heir >= 0)
        identity = tracks.identity.copy()
        identity[heir[old]] = identity[old]
        return identity, np.flatnonzero(heir < 0)

    def _without_strangers(self, tracks: Tracks) -> Tracks:
        """Delete modes that were measured rarely and long ago."""
        waiting = (tracks.time - tracks.last) / _HOUR
        return only(tracks, np.flatnonzero((tracks.seen >= self.confirm) | (waiting <= self.patience)))


def _agreement(tracks: Tracks, estimate: ModalEstimate) -> tuple[FloatArray, FloatArray]:
    """Return the MAC of all pairs at the common channels (n_tracks, n_modes), and its loss by noise (n_modes,)."""
    ours, theirs = common_places(tracks, estimate)
    shape, std = estimate.shape[:, theirs], estimate.shape_std[:, theirs]
    noise = np.sum(std**2, axis=1) / np.maximum(np.sum(np.abs(shape) ** 2, axis=1), 1e-30)
    return mac_matrix(tracks.shape[:, ours], shape), np.minimum(noise, 0.5)


def _doubtful(cost: FloatArray, possible: BoolArray, place: IndexArray) -> BoolArray:
    """Return the tracks that could exchange modes, or take an unassigned one, at little more cost."""
    rows = np.flatnonzero(place >= 0)
    doubtful = np.zeros(len(place), np.bool_)
    for i in rows:
        own = cost[i, place[i]]
        left = np.setdiff1d(np.flatnonzero(possible[i]), place)
        doubtful[i] |= bool((cost[i, left] < own + _DOUBT).any())
        for k in rows[(rows != i) & possible[i, place[rows]] & possible[rows, place[i]]]:
            exchanged = cost[i, place[k]] + cost[k, place[i]] - own - cost[k, place[k]]
            doubtful[i] |= exchanged < _DOUBT
    return doubtful
