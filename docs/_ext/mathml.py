"""Formulas as MathML, which browsers draw without any script: a math renderer for Sphinx's HTML."""

import re

from latex2mathml.converter import convert

_TAG = re.compile(r"\\tag\{([^}]*)\}")
_THREE_DOTS = "&#x020DB;"  # a combining character that few fonts place well


def to_mathml(latex: str, *, block: bool) -> str:
    """Return a formula as a <math> element."""
    markup = convert(latex.strip(), display="block" if block else "inline")
    return markup.replace(_THREE_DOTS, "&#x002D9;&#x002D9;&#x002D9;")


def block_html(latex: str) -> str:
    r"""Return a displayed formula; what its \tag says stands in brackets at the right."""
    tag = _TAG.search(latex)
    number = f'<span class="number">({tag.group(1)})</span>' if tag else ""
    return f'<div class="math">{to_mathml(_TAG.sub("", latex), block=True)}{number}</div>'


def _visit_inline(writer, node):
    from docutils import nodes

    writer.body.append(to_mathml(node.astext(), block=False))
    raise nodes.SkipNode


def _visit_block(writer, node):
    from docutils import nodes

    writer.body.append(block_html(node.astext()))
    raise nodes.SkipNode


def setup(app):
    app.add_html_math_renderer("mathml", inline_renderers=(_visit_inline, None), block_renderers=(_visit_block, None))
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
