"""Common parts of the content of a report: pictures, and numbers that may be missing."""

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from monitor.optional import run_optional
from monitor.views.report.svg import data_uri, svg


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


def optional(value: float | None, form: str) -> str:
    """Return a number as text, a dash for none."""
    return "–" if value is None else format(value, form)
