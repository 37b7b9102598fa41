"""Where code in the text may break at the end of a line: after signs, and before the words of a
name, but not within them; and numbers such as 1e-6, which may not.
"""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

PLACE = re.compile(r"(?<=[/.,(=])(?=\w)|(?<=_)(?=[a-z]{2})")
HUMP = re.compile(r"(?<=[a-z])(?=[A-Z][a-z])")
NUMBER = re.compile(r"(?<![\w.\"=/-])(\d[\d.]*e-\d+)(?!\w)")
LONG = 16
"""A word with more letters may break before its capitals."""


def breakable(word: str) -> str:
    """A word of code with its places marked."""
    word = PLACE.sub("<wbr>", word)
    return "<wbr>".join(HUMP.sub("<wbr>", w) if len(w) > LONG else w for w in word.split("<wbr>"))


def allow(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Mark these places in inline code, which Sphinx writes word by word, and the numbers."""
    if "body" in context:
        context["body"] = NUMBER.sub(r'<span class="number">\1</span>', context["body"])
        context["body"] = re.sub(
            r'(<span class="pre">)([^<]+)(</span>)',
            lambda word: word[1] + breakable(word[2]) + word[3],
            context["body"],
        )


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", allow)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
