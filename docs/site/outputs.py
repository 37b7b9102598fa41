"""What the code of a page prints stands below it: the blocks of the page are run as one program
while the site is built, so that it is true.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parent.parent.parent
PAGES = ("index", "tutorial")
BLOCK = re.compile(r"^```python\n(.*?)^```\n", flags=re.MULTILINE | re.DOTALL)
END = "\0\n"


def printed(blocks: list[str]) -> list[str]:
    """What each block of a program prints."""
    program = "".join(f"{block}\nprint(chr(0))\n" for block in blocks)
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "page.py"  # native code is made from the source of classes
        file.write_text(program, encoding="utf-8")
        done = subprocess.run(
            [sys.executable, str(file)],
            cwd=folder,
            check=True,
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": paths, "MPLBACKEND": "Agg"},
        )
    return done.stdout.split(END)


def add(app: Sphinx, name: str, source: list[str]) -> None:
    """Put the output below every block that prints something."""
    if name not in PAGES:
        return
    outputs = iter(printed(BLOCK.findall(source[0])))

    def with_output(block: re.Match[str]) -> str:
        output = next(outputs).rstrip()
        below = f"\n```{{code-block}} text\n:class: output\n\n{output}\n```\n" if output else ""
        return block[0] + below

    source[0] = BLOCK.sub(with_output, source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", add)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
