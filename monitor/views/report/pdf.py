"""The report as a PDF: the elements of the page, laid out on paper by Typst."""

import json
from html.parser import HTMLParser
from importlib.resources import files
from typing import Any

from monitor.views.report.svg import svg_of

_EMPTY = frozenset({"br", "img", "link", "meta"})  # elements without an end
_HEAD = frozenset({"title", "style"})  # elements that are not shown


def load_typst() -> None:
    """Import Typst, the package of the extra `pdf`.

    Raises
    ------
    ImportError
        Naming the extra, if it is not installed.
    """
    try:
        import typst  # noqa: F401
    except ImportError as error:
        raise ImportError("typst is not installed: pip install 'modalwatch[pdf]'", name=error.name) from error


def pdf_of(page: str) -> bytes:
    """Return the PDF of a page of `templates`.

    The same page gives the same bytes: fonts are those that come with Typst, and there is no time of creation.

    Raises
    ------
    ImportError
        Naming the extra, if Typst is not installed.
    """
    load_typst()
    import typst

    template = files("monitor.views.report") / "templates" / "page.typ"
    tree = json.dumps(tree_of(page))
    return typst.compile(template.read_bytes(), sys_inputs={"page": tree}, ignore_system_fonts=True, timestamp=0)


def tree_of(page: str) -> dict[str, Any]:
    """Return title and elements of a page: dictionaries of tag, class and children, which are elements or texts."""
    return _Tree(page).root


class _Tree(HTMLParser):
    """Reader of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.root: dict[str, Any] = {"title": "", "children": []}
        self._open, self._head = [self.root], ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in _HEAD:
            self._head = tag
        values = {name: value or "" for name, value in attrs}
        element: dict[str, Any] = {"tag": tag, "class": values.get("class", ""), "children": []}
        if tag == "img":
            element |= {"svg": svg_of(values["src"]), "alt": values["alt"]}
        self._open[-1]["children"].append(element)
        if tag not in _EMPTY:
            self._open.append(element)

    def handle_endtag(self, tag: str) -> None:
        self._open.pop()
        if tag == self._head:
            self._open[-1]["children"].pop()
            self._head = ""

    def handle_data(self, data: str) -> None:
        if self._head == "title":
            self.root["title"] = data
        preformatted = self._open[-1].get("tag") == "pre"
        if preformatted or data.strip() or "\n" not in data:  # no line breaks between elements
            self._open[-1]["children"].append(data if preformatted else " ".join(f"<{data}>".split())[1:-1])
