"""Figures of the page as pictures: matplotlib without a display."""

import base64
import io
from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from monitor.optional import run_optional
from oma.plots import FAINT, INK, SOFT

LIGHT = "#fefefe"  #: on dark parts of a picture, on a dark page as well: `data_uri` does not exchange it
WARN, REGION = "#d08a00", "#e3b341"
ADDED, REMOVED, SENSOR = "#cc3340", "#2f6fcc", "#1b86b8"
_MODES = ("#2f6fcc", "#dd7a1c", "#239a68", "#8a55d6", "#d8457b", "#1f9fb4", "#a08d12", "#5e6875", "#d1492e", "#6a9a1f")
_THEME = {
    "ink": (INK, "#e8ecf1"),
    "soft": (SOFT, "#9aa5b1"),
    "faint": (FAINT, "#323b46"),
    "paper": ("#ffffff", "#12161b"),
}  # colours of a light and of a dark page
_LIGHT, _DARK = ("".join(f"--{name}:{pair[i]};" for name, pair in _THEME.items()) for i in (0, 1))
_STYLE_ELEMENT = f"<style>:root{{{_LIGHT}}}@media (prefers-color-scheme:dark){{:root{{{_DARK}}}}}</style>"
_ADDRESS = "data:image/svg+xml;base64,"
_DPI = 220  # of PNG images


def mode_colour(number: int) -> str:
    """Return the colour of a mode, counted from 1."""
    return _MODES[(number - 1) % len(_MODES)]


def svg(figure: Figure) -> str:
    """Return a figure as an SVG picture.

    The canvas draws it once; `savefig` would once more before, to lay it out, which drawing does by itself.
    """
    buffer = io.BytesIO()
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    return buffer.getvalue().decode()


def data_uri(picture: str) -> str:
    """Return an SVG picture as an address, with text, lines and paper in the colours of a dark page on a dark page."""
    for name, (light, _) in _THEME.items():
        picture = picture.replace(f": {light}", f": var(--{name})")
    picture = picture.replace("<defs>", f"{_STYLE_ELEMENT}<defs>", 1)
    return _ADDRESS + base64.b64encode(picture.encode()).decode()


def svg_of(address: str) -> str:
    """Return the SVG picture of an address by `data_uri`, in the colours of paper."""
    picture = base64.b64decode(address.removeprefix(_ADDRESS)).decode().replace(_STYLE_ELEMENT, "", 1)
    for name, (light, _) in _THEME.items():
        picture = picture.replace(f"var(--{name})", light)
    return picture


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG image."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI)
    return buffer.getvalue()


def bare(axes: Axes) -> None:
    """Remove axes and grid, with one scale in both directions."""
    axes.set_axis_off()
    axes.set_aspect("equal")


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure of the page."""

    svg: str
    text: str  #: description, for readers who cannot see it

    @property
    def address(self) -> str:
        """Address of the picture, inlined."""
        return data_uri(self.svg)


def picture(draw: Callable[[], Figure | None], text: str) -> Picture | None:
    """Return a figure as a picture of the page; None for none, and where drawing it fails, which is logged.

    Parameters
    ----------
    draw : makes the figure
    text : description
    """

    def inlined() -> Picture | None:
        figure = draw()
        return None if figure is None else Picture(svg(figure), text)

    return run_optional(f"picture ({text})", inlined)
