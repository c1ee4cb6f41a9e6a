"""Selection of modes among the poles of all model orders."""

from oma.selection.modes import Mode as Mode
from oma.selection.modes import candidates as candidates
from oma.selection.modes import distinct as distinct
from oma.selection.modes import physical as physical
from oma.selection.modes import repeats_of_tones as repeats_of_tones
from oma.selection.pole_uncertainty import PoleInfluence as PoleInfluence
from oma.selection.pole_uncertainty import block_std as block_std
from oma.selection.pole_uncertainty import normalised_move as normalised_move
from oma.selection.pole_uncertainty import pole_moves as pole_moves
from oma.selection.selection import BAND as BAND
from oma.selection.selection import Selection as Selection
from oma.selection.selection import groups as groups
from oma.selection.selection import uncertainty_law as uncertainty_law
from oma.selection.stabilization_diagram import join as join
from oma.selection.stabilization_diagram import stabilization as stabilization
