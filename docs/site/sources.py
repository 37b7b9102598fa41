"""Links from the source code back to the reference.  Sphinx looks for all that a file defines in the
namespace of its first name; each name may have another one.
"""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

BACK = re.compile(r'(?<=class="viewcode-back" href=")([^"#]*)#([\w.]+)')


def lead_back(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Give each link the full name under which the page that it leads to has the thing."""
    objects = app.env.get_domain("py").objects  # type: ignore[attr-defined]
    places = {full: x.docname for full, x in objects.items() if not x.aliased}

    def corrected(link: re.Match[str]) -> str:
        address, name = link.groups()
        if name in places:
            return link[0]
        tails = [name.split(".", k)[-1] for k in range(1, name.count(".") + 1)]
        here = [full for full, docname in places.items() if address.endswith(f"{docname}.html")]
        known = (full for tail in tails for full in here if full.endswith(f".{tail}"))
        return f"{address}#{next(known, name)}"

    if page.startswith("_modules/"):
        context["body"] = BACK.sub(corrected, context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", lead_back)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
