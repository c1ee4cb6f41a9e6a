"""Equations as MathML, which browsers draw themselves: no script and no network."""

from html import escape

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.logging import getLogger
from sphinx.util.typing import ExtensionMetadata
from sphinx.writers.html5 import HTML5Translator


def _mathml(equation: str, *, as_block: bool) -> str:
    """Return an equation as MathML, or as it is, with a warning, if it cannot be converted."""
    try:
        return str(tex2mathml(equation, as_block=as_block))
    except MathError as error:
        getLogger(__name__).warning("equation: %s", error)
        return escape(equation)


def inline_equation(translator: HTML5Translator, node: nodes.math) -> None:
    """Write an equation within a line."""
    translator.body.append(_mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def display_equation(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Write an equation of its own, with its number if it has one."""
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    anchor = f' id="equation-{node["label"]}"' if node.get("label") else ""
    translator.body.append(f'<div class="math"{anchor}>{number}{_mathml(node.astext(), as_block=True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> ExtensionMetadata:
    """Register the renderer `mathml`."""
    app.add_html_math_renderer("mathml", (inline_equation, None), (display_equation, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
