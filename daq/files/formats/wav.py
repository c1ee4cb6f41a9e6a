"""WAV files, of sound cards and recorders; read with scipy."""

from pathlib import Path
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.io import wavfile

from daq.errors import DataError
from daq.files.archive_size import damage_named
from daq.files.formats.arrays import Arrays
from daq.files.options import DataOptions

_OTHER_CHUNK = "Chunk (non-data) not understood"  # as of comments


def read(path: Path, options: DataOptions) -> Arrays:
    """Read the channels ch1, ch2, .. of a file; integers are shares of full scale.

    Raises
    ------
    DataError
        Naming the file that is damaged or of another format.
    """
    with damage_named(path, "WAV", UnboundLocalError), path.open("rb") as file, catch_warnings(record=True) as found:
        simplefilter("always")
        rate, data = wavfile.read(file)
    values = np.asarray(data, np.float64)
    warned = dict.fromkeys(str(warning.message) for warning in found)
    remarks = tuple(f"scipy: {text:.200}" for text in warned if not text.startswith(_OTHER_CHUNK))
    if data.dtype.kind in "iu":
        limits = np.iinfo(data.dtype)
        middle = 0 if data.dtype.kind == "i" else (limits.max + 1) // 2
        values = (values - middle) / (limits.max + 1 - middle)
        given = options.unit is not None or options.factor is not None or bool(options.calibration)
        scale = "numbers are shares of full scale" if given else "shares of full scale are taken as m/s2"
        remarks = (*remarks, scale)
    values = values.reshape(len(values), -1)
    if not values.size or not np.isfinite(values).all():
        raise DataError(path, "expected finite samples")
    names = tuple(f"ch{k + 1}" for k in range(values.shape[1]))
    return Arrays(names=names, values=values, rate=float(rate), t=None, remarks=remarks)
