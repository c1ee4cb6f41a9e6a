"""One palette for all views."""

import numpy as np
import numpy.typing as npt

from daq import FloatArray

Colour = tuple[int, int, int]

OK, WARN, ALARM, LEARN = (62, 178, 110), (245, 184, 61), (232, 72, 77), (86, 120, 190)
STEEL, GREY, DIM, TEXT = (150, 158, 172), (150, 156, 168), (74, 80, 92), (235, 238, 245)
BACKGROUND = [16, 18, 22]
_MODES: tuple[Colour, ...] = (
    (86, 156, 255),
    (255, 166, 64),
    (72, 199, 142),
    (190, 132, 255),
    (255, 120, 160),
    (120, 214, 230),
    (214, 200, 90),
    (176, 184, 200),
    (64, 150, 140),
    (196, 130, 90),
    (140, 120, 220),
    (120, 180, 80),
)
_HEAT = np.array([[96, 104, 118], [120, 132, 150], [214, 178, 74], [240, 120, 50], [232, 48, 60]], float)


def mode_colour(number: int) -> Colour:
    """Return the colour of a mode, counted from 1."""
    return _MODES[(number - 1) % len(_MODES)]


def heat(level: FloatArray) -> npt.NDArray[np.uint8]:
    """Return colours (n, 3) from steel to red for levels (n,) from 0 to 1."""
    x = np.clip(level, 0, 1) * (len(_HEAT) - 1)
    i = np.minimum(x.astype(np.intp), len(_HEAT) - 2)
    return np.asarray(_HEAT[i] + (_HEAT[i + 1] - _HEAT[i]) * (x - i)[:, None], np.uint8)
