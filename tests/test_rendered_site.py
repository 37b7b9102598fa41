"""The rendered documentation as a reader meets it: links that lead somewhere, no markup that is shown
as it was typed, no page that scrolls sideways.  `.ci/run` renders it; here LIEMECH_SITE is its folder.
"""

from __future__ import annotations

import functools
import html
import os
import posixpath
import re
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from liemech.viewer.chromium import Chromium, find

SITE = Path(os.environ.get("LIEMECH_SITE", ""))
pytestmark = pytest.mark.skipif("LIEMECH_SITE" not in os.environ, reason="LIEMECH_SITE is not the folder of a site")

MARKUP = re.compile(r":\w+:[`$]|``|\*\*(?=[\w\[`])|\]\(|\$\S[^$]*\$|^(?:#+ |:::|\.\. )|</?\w+>", re.MULTILINE)
"""Markdown, reStructuredText and HTML that nobody has read."""

WIDTHS = 1280, 400
"""Of a notebook computer and of a telephone, in pixels."""


@functools.cache
def pages() -> dict[str, str]:
    """The pages of the site by their places, without those of the viewer."""
    files = (file for file in SITE.rglob("*.html") if file.relative_to(SITE).parts[0] not in ("pages", "scenes"))
    return {file.relative_to(SITE).as_posix(): file.read_text(encoding="utf-8") for file in files}


@functools.cache
def anchors(page: str) -> set[str]:
    """The places in a page that a link can lead to."""
    return {html.unescape(name) for name in re.findall(r'\s(?:id|name)="([^"]*)"', pages()[page])}


def leads_nowhere(page: str, link: str) -> bool:
    """Is there no such file in the site, or no such place in its page?  Addresses elsewhere are not asked."""
    address = urlsplit(html.unescape(link))
    if address.scheme or address.netloc:
        return False
    target = (
        posixpath.normpath(posixpath.join(posixpath.dirname(page), unquote(address.path))) if address.path else page
    )
    if target in pages():
        return bool(address.fragment) and unquote(address.fragment) not in anchors(target)
    return not (SITE / target).is_file()


def text_of(page: str) -> str:
    """The text of a page, without its code, signatures and formulas."""
    shown = re.sub(r"(?s)<(script|style|svg|pre|code|math|dt)\b.*?</\1>", "", pages()[page])
    return html.unescape(re.sub(r"(?s)<[^>]*>", "", shown))


def test_the_site_is_there() -> None:
    assert {"index.html", "gallery.html", "generated/api/groups.html"} <= pages().keys()


def test_every_link_and_picture_is_there() -> None:
    links = {page: set(re.findall(r'\s(?:href|src)="([^"]*)"', text)) for page, text in pages().items()}
    assert sum(map(len, links.values())) > 10 * len(links)
    dead = [f"{page}: {link}" for page, found in links.items() for link in found if leads_nowhere(page, link)]
    assert not dead, f"{len(dead)} links lead nowhere: {dead[:20]}"


def test_no_markup_is_shown() -> None:
    texts = {page: text_of(page) for page in pages() if not page.startswith("_modules/")}
    raw = [
        f"{page}: {text[max(x.start() - 30, 0) : x.end() + 30]!r}"
        for page, text in texts.items()
        for x in MARKUP.finditer(text)
    ]
    assert not raw, f"{len(raw)} places show their markup: {raw[:20]}"


def frames(page: str) -> list[str]:
    """The pages that are shown in frames of a page."""
    return re.findall(r'<iframe[^>]* src="([^"]*)"', pages()[page])


def test_moving_pages_are_in_the_gallery_and_beside_their_code() -> None:
    moving = sorted(f"pages/{file.name}" for file in (SITE / "pages").glob("*.html"))
    assert moving and sorted(frames("gallery.html")) == moving
    beside = [frame for page in pages() if page.startswith("generated/examples/") for frame in frames(page)]
    assert sorted(beside) == [f"../../{page}" for page in moving]
    entries = re.findall(r"(?s)<li>.*?</li>", pages()["gallery.html"].partition('id="gallery">')[2])
    led = [entry for entry in entries if "<iframe" in entry and 'href="generated/examples/' in entry]
    assert len(led) == len(moving)


BEYOND = "[...document.querySelectorAll('{}')].map(e => e.scrollWidth - e.clientWidth).filter(x => x > 1)"
"""How many pixels of parts of a page are outside, of those of which some are."""

PARTS = {"page": "html, .content", "code": ".highlight-python pre", "tables": ".table-wrapper"}
"""The page and the column that scrolls on telephones; what scrolls in a box of its own."""

WIDE_TABLES = 4
"""As many tables of all pages have more columns than fit on a notebook computer."""


@pytest.mark.skipif(find() is None, reason="needs Chromium on the search path")
def test_no_page_scrolls_sideways() -> None:
    """On telephones wide tables, formulas and code do, each in its own box; on notebook computers no code does, and few
    tables.
    """
    wide, tables = [], []
    with Chromium() as browser:
        for page in sorted(pages()):
            if page.startswith(("_modules/", "generated/examples/", "contact_sheet")):
                continue
            tab = browser.open(SITE / page)
            for width in WIDTHS:
                tab.resize(width, 900)
                beyond = {part: tab.evaluate(BEYOND.format(where)) for part, where in PARTS.items()}
                told = {part: f"{page}: {x} pixels of {part} beyond {width}" for part, x in beyond.items() if x}
                wide += [told[part] for part in (("page", "code") if width == WIDTHS[0] else ("page",)) if part in told]
                tables += [f"{page}: {x} pixels" for x in beyond["tables"]] if width == WIDTHS[0] else []
            tab.close()
    assert not wide, wide
    assert len(tables) <= WIDE_TABLES, tables
