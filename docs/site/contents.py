"""The table of contents at the side of every page, read from the lists of `index.md`: a heading
there is a group of pages here.  Tables in `measured` are no pages; links lead to their files.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

MEASURED = re.compile(r"\]\(((?:[\w./]+/)?measured/\w+\.md)(?:#[\w-]+)?\)")
"""A link to tables that are not part of the site."""

GENERATED = {"Reference": ("generated/api/index",)}
"""Pages that are written while the site is built, by the heading under which they stand."""


def groups(index: str) -> dict[str, list[str]]:
    """The pages that the items of lists link to, by heading, each once."""
    found: dict[str, list[str]] = {}
    heading, seen = "", set()
    for line in index.splitlines():
        if line.startswith("## "):
            heading = line.removeprefix("## ").strip()
        elif re.match(r"([*-]|\d+\.| ) ?", line):
            for page in re.findall(r"\]\(([\w/]+)\.md\)", line):
                if page not in seen:
                    found.setdefault(heading, []).append(page)
                    seen.add(page)
    for heading, pages in GENERATED.items():
        found[heading] = [*pages, *found.get(heading, [])]
    return found


def add(app: Sphinx, name: str, source: list[str]) -> None:
    """Give the first page the groups as hidden tables of contents."""
    if name == "index":
        for heading, pages in groups(source[0]).items():
            source[0] += "\n".join(
                ["\n\n```{toctree}", ":hidden:", f":caption: {heading}", "", *pages, "```\n"]
            )


def lead_to_files(app: Sphinx, name: str, source: list[str]) -> None:
    """Mark links to measured tables as links to files, which are copied into the site."""
    source[0] = MEASURED.sub(r"](path:\1)", source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", add)
    app.connect("source-read", lead_to_files)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
