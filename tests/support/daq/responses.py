"""Frequency responses of universal files, as the package pyuff writes them."""

from typing import Any

import pyuff

COHERENCE = {"func_type": 6, "ordinate_spec_data_type": 0, "orddenom_spec_data_type": 0}  #: fields of a coherence


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
