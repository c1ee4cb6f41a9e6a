"""Docstrings for Sphinx: sections of numpydoc with a text after each name, Markdown's code, and links to our names."""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise

from docutils import nodes
from pydantic import BaseModel
from sphinx.addnodes import desc_annotation, desc_returns, desc_sig_name, pending_xref
from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

from docs._site.program import documented_names

_LITERAL = re.compile(r"(?<![`:\w])`([^`\n]+)`(?!`)")
_LISTS = ("Parameters", "Returns", "Yields", "Raises")
_SECTIONS = (*_LISTS, "References", "Notes", "Examples")


def converted(lines: Sequence[str]) -> list[str]:
    """Return a docstring as reStructuredText."""
    text: list[str] = []
    for title, body in _sections(lines):
        if not title:
            text += map(_escaped, body)
        elif title in _LISTS:
            text += [f":{title}:", *_entries(body), ""]
        else:
            text += [f".. rubric:: {title}", "", *map(_escaped, body), ""]
    return text


def _sections(lines: Sequence[str]) -> Iterator[tuple[str, Sequence[str]]]:
    starts = [i for i, line in enumerate(lines[:-1]) if line in _SECTIONS and set(lines[i + 1]) == {"-"}]
    yield "", lines[: starts[0] if starts else len(lines)]
    for start, end in pairwise([*starts, len(lines)]):
        yield lines[start], lines[start + 2 : end]


def _entries(body: Sequence[str]) -> Iterator[str]:
    """Yield a list of the names with their texts, which follow a colon or are indented below."""
    for line, following in pairwise([*body, ""]):
        if line and not line.startswith(" "):
            name, _, text = line.partition(" : ")
            stop = "." if text and following.strip()[:1].isupper() else ""  # a type, then a sentence
            yield f"    - ``{name}``: {_escaped(text)}{stop}"
        else:
            yield f"      {_escaped(line.strip())}" if line.strip() else ""


def _escaped(line: str) -> str:
    """Return a line with `code` as reStructuredText has it, and without other markup."""
    parts = _LITERAL.split(line)
    return "".join(f"``{part}``" if i % 2 else _plain(part) for i, part in enumerate(parts))


def _plain(text: str) -> str:
    if "``" in text or text.lstrip().startswith((".. ", ">>>")):
        return text
    return re.sub(r"(\w)_(?=\W|$)", r"\1\_", re.sub(r"([*|])", r"\\\1", text))


def _process(_app: Sphinx, _kind: str, _name: str, _thing: object, _options: object, lines: list[str]) -> None:
    lines[:] = converted(lines)


_ARRAY = re.compile(r"(?:numpy\.)?ndarray\[tuple\[Any, \.\.\.\], dtype\[(\w+)\]\]")
_ARRAYS = {"float64": "FloatArray", "complex128": "ComplexArray", "int64": "IndexArray", "int32": "IntArray"}


def _name_arrays(_app: Sphinx, page: nodes.document) -> None:
    """Put the names of the types of arrays in the place of what they stand for."""
    for node in list(page.findall(lambda n: isinstance(n, desc_annotation | desc_sig_name | desc_returns))):
        text = node.astext().removeprefix(" -> ")  # which the page has as an arrow
        if _ARRAY.search(text):
            node.children = [nodes.Text(_ARRAY.sub(lambda found: _ARRAYS.get(found[1], "NDArray"), text))]


def _without_fields(
    _app: Sphinx, _kind: str, _name: str, thing: object, _options: object, _signature: str, _returns: str
) -> tuple[str, str] | None:
    """Leave out the fields of a model from its signature: a table has them."""
    return ("(**fields)", "") if isinstance(thing, type) and issubclass(thing, BaseModel) else None


def _link_types(_app: Sphinx, page: nodes.document) -> None:
    """Link types to the names that pages describe; make plain text of others, which Sphinx would compare with all."""
    known = documented_names()
    for reference in list(page.findall(pending_xref)):
        if reference.get("refdomain") == "py":
            name = known.get(reference["reftarget"]) or known.get(reference["reftarget"].rpartition(".")[2])
            if name is None:
                reference.replace_self(reference.children)
            else:
                reference["reftarget"] = name


def setup(app: Sphinx) -> ExtensionMetadata:
    """Process every docstring and every page."""
    app.connect("autodoc-process-docstring", _process)
    app.connect("autodoc-process-signature", _without_fields)
    app.connect("doctree-read", _name_arrays)
    app.connect("doctree-read", _link_types)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
