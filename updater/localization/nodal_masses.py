"""Mass at every node by the iterative sensitivity method, the paper's alternative to one step.

Same data and covariances as the localization's, but no hypothesis of one body: as many parameters as nodes, more than
data, so that the prior decides how the mass is spread. Its strength is the one of most evidence (MacKay 1992).

References
----------
MacKay, D. J. C. (1992). Bayesian interpolation. Neural Computation 4(3), 415-447.
"""

from dataclasses import dataclass, replace

import numpy as np

from daq import FloatArray, IndexArray
from updater.fe import build_model
from updater.inference import Comparison, Effect, Tangent, compare, no_effect, picked, predict, reanalyse, residual
from updater.modal_data import ModalMean
from updater.reference import Convergence, Prior, Reference, fit_parameters

_STRENGTHS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # prior of one node's mass, of the structure's
_STEP = 1e-5  # kg, of the derivatives of residuals
_MAX_NODES = 150  # of a larger model every n-th is taken
_MAX_TAKEN = 0.9  # share of a node's own mass that a bound permits to remove


@dataclass(frozen=True, eq=False, kw_only=True)
class NodalMasses:
    """Masses added at nodes, as the iterative sensitivity method has them."""

    node: IndexArray  #: (n,) of the reference's model
    mass: FloatArray  #: (n,) [kg]
    mass_std: FloatArray  #: (n,) of noise and prior [kg]
    at_bound: IndexArray  #: nodes that would give more than they have
    prior_std: float  #: standard deviation of one node's mass, selected by evidence [kg]
    iterations: int  #: models solved with the chosen prior
    reason: Convergence  #: why the iteration ended


def spread_mass(reference: Reference, event: ModalMean) -> NodalMasses:
    """Fit a mass at every node that is free to move.

    Parameters
    ----------
    reference : learned before the change
    event : (n_tracks,) mean of the windows since the change

    Raises
    ------
    ValueError
        If fewer than three modes or two channels can be compared.
    """
    node, own = _free_nodes(reference)
    problem = _Spread(compare(reference, event), _translations(reference, node))
    total = reference.model.total_mass()
    fits = {share * total: fit_parameters(problem, _prior(own, share * total)) for share in _STRENGTHS}
    strength, best = max(fits.items(), key=lambda pair: pair[1].log_evidence)
    return NodalMasses(
        node=node,
        mass=best.value,
        mass_std=best.std,
        at_bound=node[best.at_bound],
        prior_std=strength,
        iterations=best.iterations,
        reason=best.reason,
    )


def _prior(own: FloatArray, strength: float) -> Prior:
    zero = np.zeros(len(own))
    return Prior(
        mean=zero,
        std=np.full(len(own), strength),
        lower=-_MAX_TAKEN * own,
        upper=np.full(len(own), np.inf),
        start=zero,
    )


def _free_nodes(reference: Reference) -> tuple[IndexArray, FloatArray]:
    """Return the nodes (n,) that move, one of each pair of twins, and their own masses (n,) [kg]."""
    model = build_model(reference.structure)
    mass = np.append(model.mass.diagonal(), 0.0)[model.dofs[:, :3]].max(1)
    mass[[twin for _, twin, _ in model.twins]] = 0.0
    node = np.flatnonzero(mass > 0)
    node = node[:: -(-len(node) // _MAX_NODES)]
    return node, mass[node]


def _translations(reference: Reference, node: IndexArray) -> FloatArray:
    """Return the reference's modes (n, 3, n_modes) at nodes; zeros where one is held."""
    shape = np.vstack([reference.shape, np.zeros(reference.shape.shape[1])])
    return np.asarray(shape[reference.model.dofs[node, :3]])


class _Spread:
    """Residuals of masses x at points where the modes are `translation` (n, 3, n_modes), by exact re-analysis."""

    def __init__(self, comparison: Comparison, translation: FloatArray) -> None:
        self._comparison = comparison
        self._by_mass = translation.transpose(0, 2, 1) @ translation  # (n, n_modes, n_modes)

    def _effect(self, x: FloatArray) -> Effect:
        return replace(no_effect(1, self._comparison), mass=np.tensordot(x, self._by_mass, 1)[None])

    def _residual(self, value: FloatArray, vector: FloatArray) -> FloatArray:
        nothing = no_effect(1, self._comparison)
        return residual(self._comparison, predict(self._comparison, value, vector, nothing), self._comparison.drifting)

    def residual(self, x: FloatArray) -> FloatArray:
        return np.asarray(self._residual(*picked(reanalyse(self._comparison, self._effect(x))))[0])

    def slope(self, x: FloatArray) -> FloatArray:
        effect, alike = self._effect(x), np.zeros(len(x), np.intp)
        changed = reanalyse(self._comparison, effect).rows(alike)
        value, vector = picked(changed)
        tangent = Tangent(changed, effect.rows(alike))
        d_value, d_vector = tangent.by(_STEP * self._by_mass, np.zeros_like(self._by_mass))
        ahead = self._residual(value + d_value, vector + d_vector)
        behind = self._residual(value - d_value, vector - d_vector)
        return np.asarray((ahead - behind).T / (2 * _STEP))
