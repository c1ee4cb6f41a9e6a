"""Errors concerning modes, a structure and its model.

UpdaterError
    StructureError      the file that describes the structure
    ModelError          the model built from it (a point that lies on no member)
        MechanismError  one that can move without deforming
    PairingError        measured modes that no model modes answer to
    ModalDataError      measured modes or signals that cannot be right or are too few (a ValueError as well)
    SelectionError      causes or parameters that were chosen and do not exist or apply (a ValueError as well)
"""

from pathlib import Path

from daq.bounded_text import one_line


class UpdaterError(Exception):
    """Base of all errors of this package; the message is one printable line of bounded length."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class StructureError(UpdaterError):
    """A structure file that cannot be used; names the file and the entry."""

    def __init__(self, path: Path | str, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path = path


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
