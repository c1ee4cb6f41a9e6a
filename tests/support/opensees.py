"""OpenSeesPy, whose tests are skipped where the BLAS library of the system that it needs is not installed."""

from importlib import import_module
from typing import Any

import pytest

ops: Any = None
_problem = ""
try:
    ops = import_module("openseespy.opensees")
except (ImportError, RuntimeError) as error:  # a RuntimeError where a library of the system is missing
    _problem = f"OpenSeesPy cannot be loaded ({error}); on Debian it needs libblas3"

needs_opensees = pytest.mark.skipif(ops is None, reason=_problem)
