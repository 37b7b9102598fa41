"""Formulas as MathML, which browsers draw themselves, with the font in `static/fonts`: a page needs no
script and no network to show them.
"""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml import converter
from sphinx.application import Sphinx

SIGN = re.compile(r"(<mo[^>]*>&#x000(?:28|2C|3D|5B|7B);</mo>)<mo>(?=&#x(?:0002B|02212);)")
"""A plus or minus behind an opening bracket, a comma or a sign of equality."""
WORD = re.compile(r"<mo>([A-Za-z]{2,})</mo>")
"""A name such as Ad, which is no sign with room on both sides."""


def convert(tex: str, display: str = "inline") -> str:
    """MathML of a formula."""
    found = SIGN.sub(r'\1<mo form="prefix">', converter.convert(tex, display=display))
    return WORD.sub(r"<mi>\1</mi>", found)


def inline(writer: Any, node: nodes.Element) -> None:
    """A formula in the text."""
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def block(writer: Any, node: nodes.Element) -> None:
    """A formula on a line of its own, which scrolls where it is wider than the page."""
    writer.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
