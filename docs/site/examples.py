"""Each example has a page with its code.  Those that write a page for the browser are run, and the
gallery links to it.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parent.parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
IN_THE_BROWSER = {
    e.stem: found[1]
    for e in EXAMPLES
    if (found := re.search(r'"(\w+)\.html"', e.read_text(encoding="utf-8")))
}
"""The examples that write a page, and its name."""


def frame(example: str, root: str = "") -> str:
    """The page that an example writes, as part of another one; root : the way from that one to the
    root of the site.
    """
    page = f"{root}pages/{IN_THE_BROWSER[example]}.html"
    return f'<iframe loading="lazy" src="{page}" title="{example.replace("_", " ")}"></iframe>'


def write(app: Sphinx) -> None:
    """A page for every example, and the pages that examples write."""
    folder = Path(app.srcdir) / "generated" / "examples"
    folder.mkdir(parents=True, exist_ok=True)
    outputs = json.loads((ROOT / "docs" / "figures" / "outputs.json").read_text(encoding="utf-8"))
    for example in EXAMPLES:
        title = example.stem.replace("_", " ").capitalize()
        text = f":orphan:\n\n{title}\n{'=' * len(title)}\n\nOne of the examples of :doc:`the gallery </gallery>`.\n\n"
        if example.stem in IN_THE_BROWSER:
            text += f".. raw:: html\n\n   {frame(example.stem, '../../')}\n\n"
        text += f".. literalinclude:: ../../../examples/{example.name}\n   :language: python\n   :class: whole\n"
        if output := outputs.get(example.stem, "").rstrip():
            text += "\nIt prints\n\n.. code-block:: text\n   :class: output\n\n"
            text += textwrap.indent(output, "   ") + "\n"
        for picture in re.findall(r'"(\w+\.png)"', example.read_text(encoding="utf-8")):
            if (ROOT / "docs" / "figures" / picture).exists():
                text += f"\n.. image:: ../../figures/{picture}\n   :alt: {title}\n"
        file = folder / f"{example.stem}.rst"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")
    pages = Path(app.srcdir) / "generated" / "extra" / "pages"
    pages.mkdir(parents=True, exist_ok=True)
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    surroundings = os.environ | {"PYTHONPATH": paths, "MPLBACKEND": "Agg"}
    for name, page in IN_THE_BROWSER.items():
        if not (pages / f"{page}.html").exists():
            program = [sys.executable, str(ROOT / "examples" / f"{name}.py")]
            subprocess.run(program, cwd=pages, check=True, capture_output=True, env=surroundings)
            for picture in pages.glob("*.png"):
                picture.unlink()


def link(app: Sphinx, name: str, source: list[str]) -> None:
    """Links to examples lead to their pages; the gallery shows what they write for the browser."""
    depth = "../" * name.count("/")
    source[0] = re.sub(
        r"\]\((?:\.\./)+examples/(\w+)\.py\)", rf"]({depth}generated/examples/\1.rst)", source[0]
    )
    if name == "gallery":
        for example in IN_THE_BROWSER:  # a blank line ends what is HTML
            source[0] = re.sub(
                rf"!\[[^\]]*\]\(figures/\w+\.png\)\s*(?=\*\*\[{example}\]\()",
                f"{frame(example)}\n\n  ",
                source[0],
            )


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write)
    app.connect("source-read", link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
