"""One palette for all views."""

import colorsys

import numpy as np
import numpy.typing as npt

from daq import FloatArray

Colour = tuple[int, int, int]

OK: Colour = (62, 178, 110)
WARN: Colour = (245, 184, 61)
ALARM: Colour = (232, 72, 77)
LEARN: Colour = (86, 120, 190)
STEEL: Colour = (150, 158, 172)
GREY: Colour = (150, 156, 168)
DIM: Colour = (74, 80, 92)
FAINT: Colour = (46, 50, 58)
TEXT: Colour = (235, 238, 245)
SENSOR: Colour = (120, 200, 240)
LIGHTER: Colour = (110, 170, 255)  # a mass that was taken away
REGION: Colour = (255, 210, 90)
BACKGROUND: Colour = (16, 18, 22)

_MODES: tuple[Colour, ...] = (
    (86, 156, 255),
    (255, 166, 64),
    (72, 199, 142),
    (190, 132, 255),
    (255, 120, 160),
    (120, 214, 230),
    (226, 212, 84),
    (206, 210, 220),
    (255, 104, 84),
    (158, 224, 92),
)
_GOLDEN = 0.618034  # of a turn: neighbours in number are far apart in hue
_COLD = np.array([[110, 118, 132], [96, 132, 190], [70, 140, 255]], float)
_HEAT = np.array([[110, 118, 132], [138, 148, 164], [222, 182, 74], [244, 124, 50], [236, 48, 60]], float)


def mode_colour(number: int) -> Colour:
    """Return the colour of a mode, counted from 1; no two modes share one."""
    if number <= len(_MODES):
        return _MODES[number - 1]
    red, green, blue = colorsys.hls_to_rgb(number * _GOLDEN % 1.0, 0.68, 0.72)
    return round(255 * red), round(255 * green), round(255 * blue)


def heat(level: FloatArray) -> npt.NDArray[np.uint8]:
    """Return colours (n, 3) from steel to red for levels (n,) from 0 to 1."""
    x = np.clip(level, 0, 1) * (len(_HEAT) - 1)
    i = np.minimum(x.astype(np.intp), len(_HEAT) - 2)
    return np.asarray(_HEAT[i] + (_HEAT[i + 1] - _HEAT[i]) * (x - i)[:, None], np.uint8)


def signed_heat(level: FloatArray) -> npt.NDArray[np.uint8]:
    """Return colours (n, 3) from blue (-1) over steel (0) to red (1); steel where the level is not a number."""
    known = np.nan_to_num(level)
    x = np.clip(-known, 0, 1) * (len(_COLD) - 1)
    i = np.minimum(x.astype(np.intp), len(_COLD) - 2)
    cold = np.asarray(_COLD[i] + (_COLD[i + 1] - _COLD[i]) * (x - i)[:, None], np.uint8)
    return np.where((known < 0)[:, None], cold, heat(known))
