"""Posterior density of the accepted causes over all places of the structure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from daq import FloatArray, IndexArray
from updater.causes.base import Cause
from updater.fit import Fit
from updater.structure import Structure

_NOTHING = 1e-300


@dataclass(frozen=True, eq=False, kw_only=True)
class Density:
    """A cause's posterior over places, in order along each member."""

    cause: str
    member: tuple[str, ...]  #: (n,) of each place
    position: FloatArray  #: (n, 3) [m]
    density: FloatArray  #: (n,) [1/m]


@runtime_checkable
class _Along(Protocol):
    """Alternatives that are positions along members."""

    @property
    def member(self) -> IndexArray: ...

    @property
    def position(self) -> FloatArray: ...

    @property
    def weight(self) -> FloatArray: ...


def densities(structure: Structure, parts: Sequence[Fit[Cause]]) -> tuple[Density, ...]:
    """Return the posterior over places of each accepted cause whose alternatives are positions.

    Parameters
    ----------
    structure : that was diagnosed
    parts : the fit of each accepted cause
    """
    return tuple(_density(structure, part, part.hypotheses) for part in parts if isinstance(part.hypotheses, _Along))


def _density(structure: Structure, part: Fit[Cause], along: _Along) -> Density:
    members = [structure.member[int(i)] for i in along.member]
    return Density(
        cause=part.hypotheses.name,
        member=tuple(member.name for member in members),
        position=np.array([member.point(s) for member, s in zip(members, along.position.tolist(), strict=True)]),
        density=np.maximum(part.probability / along.weight, _NOTHING),
    )
