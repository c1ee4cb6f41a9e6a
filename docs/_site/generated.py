"""Reference pages written from the program when the site is built.

A line `<!-- generated: NAME ARGUMENTS -->` of a page is replaced by the Markdown that the function NAME of `program`
returns for these arguments.
"""

import re

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

from docs._site import program

_MARK = re.compile(r"^<!-- generated: (\w+)((?: [\w.]+)*) -->$", re.MULTILINE)


def filled(text: str) -> str:
    """Return the text of a page with what is generated in it."""
    return _MARK.sub(lambda mark: getattr(program, mark[1])(*mark[2].split()), text)


def _fill(_app: Sphinx, _page: str, source: list[str]) -> None:
    source[0] = filled(source[0])


def setup(app: Sphinx) -> ExtensionMetadata:
    """Fill pages as they are read."""
    app.connect("source-read", _fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
