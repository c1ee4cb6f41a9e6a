"""Recordings in, modes with uncertainty out: operational modal analysis without a user."""

from oma.estimate import ComplexArray, ModalEstimate

__all__ = ["ComplexArray", "ModalEstimate"]
