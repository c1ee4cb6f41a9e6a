"""Errors concerning modes, a structure and its model.

UpdaterError
    StructureError      the file that describes the structure
    ModelError          the model built from it (a point that lies on no member)
        MechanismError  one that can move without deforming
    PairingError        measured modes that no model modes answer to
    ModalDataError      measured modes or signals that cannot be right or are too few (a ValueError as well)
    SelectionError      causes or parameters that were chosen and do not exist or apply (a ValueError as well)
"""

from daq.errors import FileError, OneLineError


class UpdaterError(OneLineError):
    """Base of all errors of this package."""


class StructureError(FileError, UpdaterError):
    """A structure file that cannot be used; names the file and the entry."""


class ModelError(UpdaterError):
    """A model that cannot be built or solved."""


class MechanismError(ModelError):
    """A model that can move without deforming, so that its stiffness is singular."""


class PairingError(UpdaterError):
    """Too few measured modes are paired with modes of the model."""


class ModalDataError(UpdaterError, ValueError):
    """Measured modes that cannot be compared: too few, doubled, a shape of zeros, frequencies in a wrong unit."""


class SelectionError(UpdaterError, ValueError):
    """Causes or model parameters that were chosen and do not exist, or do not apply."""
