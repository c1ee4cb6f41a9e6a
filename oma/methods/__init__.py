"""Identification methods behind one interface: SSI, pLSCF, FDD and its kin."""

from oma.methods.base import LevelModes, Method
from oma.methods.efdd import EFDD
from oma.methods.fdd import FDD
from oma.methods.fsdd import FSDD
from oma.methods.matrix_fraction import HalfSpectrum, MatrixFraction, matrix_fractions
from oma.methods.plscf import PLSCF
from oma.methods.ssi import CovarianceSSI, DataSSI

__all__ = [
    "EFDD",
    "FDD",
    "FSDD",
    "PLSCF",
    "CovarianceSSI",
    "DataSSI",
    "HalfSpectrum",
    "LevelModes",
    "MatrixFraction",
    "Method",
    "matrix_fractions",
]
