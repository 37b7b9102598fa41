"""On the first page the moving picture of a body that flips is one to play with: the exact motion, by `flip.js`."""

from __future__ import annotations

import re

from sphinx.application import Sphinx

PLAYED = """<div class="flip"></div>
<p class="caption">The exact motion, computed on this page. Choose the moments of inertia, and by how much, and to
which side, the momentum is tilted from axis 2; a click on the sphere sets it, too.</p>
<script defer src="_static/flip.js"></script>
<noscript>

{picture}

</noscript>"""


def play(app: Sphinx, name: str, source: list[str]) -> None:
    """Put it where the picture is."""
    if name == "index":
        source[0] = re.sub(
            r"!\[[^\]]*\]\(figures/flip\.gif\)",
            lambda found: PLAYED.format(picture=found[0]),
            source[0],
        )


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", play)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
