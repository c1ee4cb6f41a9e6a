"""Modes and a structure in; a calibrated reference, mass updates and located changes out."""

from updater.errors import ModelError, PairingError, StructureError, UpdaterError
from updater.fe.model import Model, Modes, build_model
from updater.fe.simulate import Ambient, AmbientResponse
from updater.structure import (
    Body,
    Joint,
    Member,
    Sensor,
    Structure,
    Support,
    load_structure,
    parse_structure,
    t_structure_toml,
)

__all__ = [
    "Ambient",
    "AmbientResponse",
    "Body",
    "Joint",
    "Member",
    "Model",
    "ModelError",
    "Modes",
    "PairingError",
    "Sensor",
    "Structure",
    "StructureError",
    "Support",
    "UpdaterError",
    "build_model",
    "load_structure",
    "parse_structure",
    "t_structure_toml",
]
