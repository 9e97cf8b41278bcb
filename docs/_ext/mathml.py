"""Formulas as MathML, which browsers draw without any script: a math renderer for Sphinx's HTML."""

import re

from latex2mathml.converter import convert

_TAG = re.compile(r"\\tag\{([^}]*)\}")
_TEXT = re.compile(r"\\text\{[^}]*\}")
_BAR = re.compile(r"\\[lr]vert\b ?")
_THREE_DOTS = "<mo>&#x020DB;</mo>"  # a combining character that few fonts place well


def to_mathml(latex: str, *, block: bool) -> str:
    """Return a formula as a <math> element."""
    latex = _TEXT.sub(lambda text: text[0].replace(r"\_", "_"), _BAR.sub("|", latex.strip()))
    markup = convert(latex, display="block" if block else "inline")
    return markup.replace(_THREE_DOTS, '<mo mathsize="60%">&#x022EF;</mo>')


def block_html(latex: str) -> str:
    r"""Return a displayed formula; what its \tag says stands in brackets at the right."""
    tag = _TAG.search(latex)
    number = f'<span class="number">({tag.group(1)})</span>' if tag else ""
    return f'<div class="formula">{to_mathml(_TAG.sub("", latex), block=True)}{number}</div>'


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
