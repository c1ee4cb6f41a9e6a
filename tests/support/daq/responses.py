"""Frequency responses of universal files, as the package pyuff writes them."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyuff

COHERENCE = {"func_type": 6, "ordinate_spec_data_type": 0, "orddenom_spec_data_type": 0}  #: fields of a coherence


#: fields of a multiple coherence
MULTIPLE = COHERENCE | {"ref_node": 0}
#: the record with the function type, of a coherence without a node of a force
_RECORD = re.compile(r"^    6(.{61} {9}0)", re.MULTILINE)


def write_sets(path: Path, sets: Sequence[Any]) -> Path:
    """Write datasets to a file; coherences without a node of a force are multiple ones, which pyuff does not write."""
    pyuff.UFF(str(path)).write_sets(list(sets), "overwrite")
    path.write_text(_RECORD.sub(r"   26\1", path.read_text(encoding="utf-8")), encoding="utf-8")
    return path


def frequency_response(values: Any, line: Any, **fields: Any) -> Any:
    """Return a dataset 58 of one response: complex values at spectral lines [Hz]; accelerance over force by default."""
    usual = {
        "func_type": 4,
        "rsp_dir": 1,
        "ref_dir": 1,
        "binary": 0,
        "abscissa_spacing": 1,
        "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": 12,
        "orddenom_spec_data_type": 13,
    }
    return pyuff.prepare_58(**usual | fields, data=values, x=line)
