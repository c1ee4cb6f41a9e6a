"""Identification methods behind one interface: SSI, pLSCF, FDD and its kin."""

from oma.methods.base import LevelModes as LevelModes
from oma.methods.base import Method as Method
from oma.methods.efdd import EFDD as EFDD
from oma.methods.efdd import FSDD as FSDD
from oma.methods.fdd import FDD as FDD
from oma.methods.matrix_fraction import HalfSpectrum as HalfSpectrum
from oma.methods.matrix_fraction import MatrixFraction as MatrixFraction
from oma.methods.matrix_fraction import matrix_fractions as matrix_fractions
from oma.methods.plscf import PLSCF as PLSCF
from oma.methods.ssi import CovarianceSSI as CovarianceSSI
from oma.methods.ssi import DataSSI as DataSSI
