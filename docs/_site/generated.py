"""Reference pages written from the program when the site is built.

A line `<!-- generated: NAME -->` of a page is replaced by the Markdown that the function NAME of GENERATORS returns.
"""

import re
from collections.abc import Callable

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

GENERATORS: dict[str, Callable[[], str]] = {}
_MARK = re.compile(r"^<!-- generated: ([\w.]+) -->$", re.MULTILINE)


def filled(text: str) -> str:
    """Return the text of a page with what is generated in it."""
    return _MARK.sub(lambda mark: GENERATORS[mark[1]](), text)


def _fill(_app: Sphinx, _page: str, source: list[str]) -> None:
    source[0] = filled(source[0])


def setup(app: Sphinx) -> ExtensionMetadata:
    """Fill pages as they are read."""
    app.connect("source-read", _fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
