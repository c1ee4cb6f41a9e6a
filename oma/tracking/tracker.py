"""Assignment of the modes of an estimate to those of a fixed reference.

References
----------
Magalhães, F., Cunha, Á., Caetano, E. (2009). Online automatic identification of the modal parameters of a long span
arch bridge. MSSP 23(2), 316-329.
"""

from dataclasses import dataclass

import numpy as np

from daq import FloatArray, IndexArray
from oma.mac import mac_matrix
from oma.preparation import BoolArray
from oma.tracking.pairing import assign
from oma.types import ComplexArray, ModalEstimate

_MIN_CHANNELS = 2  # that shapes are compared at


@dataclass(frozen=True, eq=False, kw_only=True)
class Tracker:
    """Assigns the modes of estimates to those of a reference; keeps no state, so that any order of calls agrees."""

    reference: ModalEstimate
    n_sigma: float = 3.0  #: standard deviations a frequency may be away, whatever the shape mixes with [-]
    floor: float = 2e-3  #: relative frequency difference always allowed for in the gate of standard deviations [-]
    max_shift: float = 0.08  #: relative frequency difference a real change may cause [-]
    min_mac: float = 0.8  #: smallest MAC of a mode whose frequency is outside the gate of standard deviations [-]
    #: rad: rotation by noise above which modes mix, so that their shapes do not distinguish them
    most_turned: float = 0.1
    #: smallest MAC of a mode inside that gate; above it no two orthogonal shapes can be exchanged [-]
    min_mac_near: float = 0.5

    def assign(self, estimate: ModalEstimate) -> IndexArray:
        """Find the mode of the estimate that continues each mode of the reference.

        A pair is possible within `n_sigma` standard deviations of both (not less than `floor`) if the shapes
        agree roughly, or within `max_shift` if they agree well: a structural change moves frequencies much and shapes
        little. Modes that a window cannot part mix: within `n_sigma` it is enough that a shape is made of theirs. Of
        all possible one-to-one assignments the one with the smallest sum of ``(1 - MAC) + |d ln f|`` is taken, after as
        many pairs as possible.

        Parameters
        ----------
        estimate : ModalEstimate

        Returns
        -------
        (n_reference_modes,) array of int
            Index into the estimate's modes, or -1 where the mode is missing; all are if fewer than two channels are
            common, as in a window without the data of a device.
        """
        if len(set(self.reference.channels) & set(estimate.channels)) < _MIN_CHANNELS:
            return np.full(self.reference.n_modes, -1)
        agreement = mac_matrix(*self._at_common_channels(estimate))
        shift = np.abs(np.log(estimate.frequency / self.reference.frequency[:, None]))
        ours = (self.reference.frequency_std / self.reference.frequency)[:, None]
        chance = np.asarray(np.hypot(ours, estimate.frequency_std / estimate.frequency))
        near = shift < np.maximum(self.n_sigma * chance, self.floor)
        possible = ((agreement >= self.min_mac) & (shift < self.max_shift)) | (
            ((agreement >= self.min_mac_near) | self._mixed(estimate, chance)) & near
        )
        return assign(1 - agreement + shift, possible)

    def _at_common_channels(self, estimate: ModalEstimate) -> tuple[ComplexArray, ComplexArray]:
        """Return both shapes at the channels that they share."""
        common = [name for name in self.reference.channels if name in estimate.channels]
        ours = [self.reference.channels.index(name) for name in common]
        theirs = [estimate.channels.index(name) for name in common]
        return self.reference.shape[:, ours], estimate.shape[:, theirs]

    def _mixed(self, estimate: ModalEstimate, chance: FloatArray) -> BoolArray:
        """Return which modes of an estimate are mixtures of modes that it does not separate.

        Noise rotates modes into each other by about their frequencies' deviation divided by the distance between them.
        A set of as many modes as channels contains every shape; this is then no evidence.
        """
        own, found = self._at_common_channels(estimate)
        apart = np.abs(np.log(self.reference.frequency / self.reference.frequency[:, None]))
        mixed = np.zeros(chance.shape, np.bool_)
        nearest = np.where(np.eye(len(apart), dtype=np.bool_), np.inf, apart).min(1, initial=np.inf)[:, None]
        for i, e in zip(*np.nonzero(nearest * self.most_turned < chance), strict=True):
            close = own[apart[i] * self.most_turned < chance[i, e]]
            if len(close) >= own.shape[1]:
                continue
            span = np.linalg.qr(close.T)[0]
            mixed[i, e] = np.linalg.norm(span.conj().T @ found[e]) ** 2 >= self.min_mac * np.linalg.norm(found[e]) ** 2
        return mixed
