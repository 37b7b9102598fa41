"""The contact sheet: every picture and every page that the library makes, photographed, on one
page of the site, `contact_sheet.html`, to be looked at before anything visible is called done.

Chromium takes the photographs, of the pages of this site too, wide and as on a telephone.  Without
it the moving pages themselves stand in the sheet.  `sphinx-build -D contact_sheet=0` leaves it out.
"""

from __future__ import annotations

import html
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util import logging

import liemech as lm
from liemech.command_line.scenes import SCENES
from liemech.errors import InvalidInput
from liemech.viewer.chromium import Chromium, find

ROOT = Path(__file__).parent.parent.parent
MOMENT = 0.6
"""Where in the playing time a moving page is photographed."""
SITE = (
    "index",
    "install",
    "tutorial",
    "gallery",
    "viewer",
    "proof/equations",
    "proof/leader_board",
)
"""Pages of the site that are photographed, each at these widths."""
WIDTHS = {"wide": (1280, 900), "narrow": (390, 800)}

HEAD = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Contact sheet of liemech</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body { font: 14px/1.4 system-ui, sans-serif; margin: 1.5em; color: #1a1a1a; background: #fff; }
section { display: grid; grid-template-columns: repeat(auto-fill, minmax(19em, 1fr)); gap: 1em; align-items: start; }
figure { margin: 0; border: 1px solid #dde2ea; border-radius: 5px; overflow: hidden; }
figure img, figure iframe { display: block; width: 100%; border: 0; }
figure iframe { height: 15em; }
figcaption { padding: 0.3em 0.6em; background: #f3f5f8; overflow-wrap: anywhere; }
a { color: #0b5394; }
</style></head><body>
<h1>Contact sheet</h1>
<p>Every picture and every page that the library makes. Look at each: is it true, is it clear, is it beautiful?</p>
"""


def scenes(folder: Path) -> Iterator[tuple[str, Path]]:
    """A page for every scene of the command line that has one."""
    for name, make in SCENES.items():
        scene = make()
        try:
            record = scene.parts(saved=False, viewed=True, plotted=False)
        except InvalidInput:  # a system without a moving picture
            continue
        run = scene.run(record, scene.sampling(False), False)
        page = lm.viewer.Scene(run, scene.view, title=scene.title)
        yield name, page.save(folder / f"{name}.html", compressed=True)


def moving(out: Path) -> dict[str, Path]:
    """All pages that move, by their names: of scenes, of examples and of the main job."""
    folder = out / "scenes"
    folder.mkdir(exist_ok=True)
    here = Path.cwd()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = dict(scenes(folder))
        os.chdir(folder)
        try:
            from liemech.command_line.main import main

            main(["--quiet"])
        finally:
            os.chdir(here)
    examples = {f"example {page.stem}": page for page in sorted((out / "pages").glob("*.html"))}
    return {"the main job": folder / "rigid_body.html"} | found | examples


def photographs(out: Path, pages: dict[str, Path]) -> Iterator[tuple[str, str, str, str]]:
    """The section, the name, the picture and the page of everything that Chromium sees."""
    folder = out / "scenes" / "photographs"
    folder.mkdir(exist_ok=True)

    def seen(page: Any, name: str) -> str:
        file = folder / f"{name.replace(' ', '_').replace('/', '_')}.png"
        file.write_bytes(page.picture())
        page.close()
        return file.relative_to(out).as_posix()

    with Chromium((720, 480)) as browser:
        for name, path in pages.items():
            page = browser.open(path.resolve())
            page.wait("window.ready || window.failed", 120.0)
            page.evaluate(f"seekTo({MOMENT} * player.duration); player.draw()")
            yield "Moving pages", name, seen(page, name), path.relative_to(out).as_posix()
        for name in SITE:
            for kind, size in WIDTHS.items():
                page = browser.open((out / f"{name}.html").resolve())
                page.resize(*size)
                browser.listen(0.3)
                yield (
                    "Pages of the site",
                    f"{name}, {kind}",
                    seen(page, f"{name} {kind}"),
                    f"{name}.html",
                )


def write(app: Sphinx, exception: Exception | None) -> None:
    """The sheet, when the pages are written."""
    if exception is not None or app.builder.name != "html" or not app.config.contact_sheet:
        return
    out = Path(app.outdir)
    pages = moving(out)
    if find():
        shown = list(photographs(out, pages))
    else:
        logging.getLogger(__name__).info("contact sheet: no Chromium, so no photographs")
        shown = [
            ("Moving pages", name, "", page.relative_to(out).as_posix())
            for name, page in pages.items()
        ]
    for file in sorted((out / "_images").iterdir()):
        shown.append(("Pictures", file.stem, f"_images/{file.name}", f"_images/{file.name}"))
    text, last = HEAD, ""
    for section, name, picture, page in shown:
        if section != last:
            text += f"{'</section>' if last else ''}<h2>{section}</h2><section>\n"
            last = section
        what = (
            f'<img loading="lazy" src="{picture}" alt="">'
            if picture
            else f'<iframe loading="lazy" src="{page}" title="{html.escape(name)}"></iframe>'
        )
        text += f'<figure><a href="{page}">{what}</a><figcaption>{html.escape(name)}</figcaption></figure>\n'
    (out / "contact_sheet.html").write_text(text + "</section></body></html>\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("contact_sheet", True, "")
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
