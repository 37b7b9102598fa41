"""Links from the source code back to the reference.  Sphinx looks for all that a file defines in the
namespace of its first name; each name may have another one.
"""

from __future__ import annotations

import functools
import posixpath
import re
from collections import defaultdict
from typing import Any

from sphinx.application import Sphinx

BACK = re.compile(r'(?<=class="viewcode-back" href=")([^"#]*)#([\w.]+)')


@functools.cache
def names_by_page(app: Sphinx) -> dict[str, list[str]]:
    """The full names of all that a page of the reference describes."""
    names = defaultdict(list)
    for full, x in app.env.get_domain("py").objects.items():  # type: ignore[attr-defined]
        if not x.aliased:
            names[x.docname].append(full)
    return names


def lead_back(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Give each link the full name under which the page that it leads to has the thing."""

    def corrected(link: re.Match[str]) -> str:
        address, name = link.groups()
        target = posixpath.normpath(posixpath.join(posixpath.dirname(page), address)).removesuffix(
            ".html"
        )
        known = names_by_page(app)[target]
        tails = [name.split(".", k)[-1] for k in range(name.count(".") + 1)]
        return f"{address}#{next((full for tail in tails for full in known if f'.{full}'.endswith(f'.{tail}')), name)}"

    if page.startswith("_modules/"):
        context["body"] = BACK.sub(corrected, context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", lead_back)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
