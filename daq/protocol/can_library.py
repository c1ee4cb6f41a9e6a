"""python-can, without the library for MDF files that it would load where that is installed: a second, and not used."""

import sys

_ABSENT = object()

_found = sys.modules.get("asammdf", _ABSENT)
if _found is _ABSENT:
    sys.modules["asammdf"] = None  # type: ignore[assignment]  # an import of it fails, as where it is not installed
try:
    import can
finally:
    if _found is _ABSENT:
        del sys.modules["asammdf"]

__all__ = ["can"]
