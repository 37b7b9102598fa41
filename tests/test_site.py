"""What the rendered documentation relies on, as far as it can be told without rendering it;
`.ci/run` renders it.
"""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"


def test_every_page_is_in_the_lists_of_the_first_page() -> None:
    spec = importlib.util.spec_from_file_location("contents", DOCS / "site" / "contents.py")
    assert spec is not None and spec.loader is not None
    contents = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(contents)
    groups = contents.groups((DOCS / "index.md").read_text(encoding="utf-8"))
    assert all(groups), "a page is linked from a list above the first heading"
    listed = [page for pages in groups.values() for page in pages if not page.startswith("generated/")]
    pages = {str(page.relative_to(DOCS).with_suffix("")) for page in DOCS.rglob("*.md")} - {"index"}
    assert sorted(listed) == sorted(page for page in pages if not page.startswith("proof/measured/"))


@pytest.mark.parametrize("name", ["proof/verification", "proof/equations", "proof/reliability"])
def test_tests_that_the_pages_name_exist(name: str) -> None:
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    named = re.findall(r"`(?:tests/)?([a-z_]+/[\w/]*test_\w+\.py|test_\w+\.py)(?:::(\w+))?`", text)
    assert len(named) > 15
    for file, function in named:
        path = ROOT / "tests" / file
        assert path.exists(), f"{name}.md names {file}, which does not exist"
        if function:
            assert f"def {function}(" in path.read_text(encoding="utf-8"), f"{name}.md names {function} in {file}"


WORDS = {"": 49_200, "proof": 25_000}
"""Of the pages in these folders, what stands in tables and programs counted too, but not what programs print."""


@pytest.mark.parametrize("folder", WORDS)
def test_the_guide_and_the_proof_stay_short(folder: str) -> None:
    """The page of names is written from the library."""
    pages = [page for page in (DOCS / folder).glob("*.md") if page.stem != "names"]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    words = sum(len(re.sub(r"^```text\n.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL).split()) for text in texts)
    assert words <= WORDS[folder], f"{words} words: say what is new in the place of something else"


FITS = 100
"""Letters of code fit beside the table of contents on a notebook computer."""


def test_code_fits_on_the_page() -> None:
    for page in DOCS.glob("*.md"):
        for code in re.findall(
            r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL
        ):
            longest = max(code.splitlines(), key=len)
            assert len(longest) <= FITS, f"{page.name}: {longest}"


def test_every_link_to_a_term_of_the_glossary_finds_it() -> None:
    terms = re.findall(r"^### (.+)$", (DOCS / "glossary.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert len(terms) == len(set(terms))
    anchors = {re.sub(r"[^\w -]", "", term.lower()).replace(" ", "-") for term in terms}
    for page in DOCS.rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        links = re.findall(r"glossary\.md#([\w-]+)", text) + (
            re.findall(r"\(#([\w-]+)\)", text) if page.stem == "glossary" else []
        )
        assert set(links) <= anchors, f"{page.name}: no such terms: {sorted(set(links) - anchors)}"


def test_every_row_of_a_table_has_as_many_cells_as_its_head() -> None:
    """A bar inside a cell parts it, in code too, unless a backslash stands before it; what is too much is not shown."""
    for page in [ROOT / "README.md", *DOCS.rglob("*.md")]:
        cells = None
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
            if not line.startswith("|"):
                cells = None
                continue
            here = len(re.split(r"(?<!\\)\|", line.strip())) - 2
            cells = cells or here
            assert here == cells, f"{page.name}, line {number}: {here} cells under a head of {cells}"


def test_no_picture_of_the_gallery_is_shown_twice() -> None:
    pictures = re.findall(r"\]\((figures/\w+\.png)\)", (DOCS / "gallery.md").read_text(encoding="utf-8"))
    assert len(pictures) == len(set(pictures))


def _typeset() -> Any:
    spec = importlib.util.spec_from_file_location("typeset", DOCS / "site" / "typeset.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("typed", "set_"),
    [
        ("mu' = ad*_xi mu", r"\mu ' = \operatorname{ad}^{*}_{\xi }\, \mu"),
        ("mu_n+1 = Ad*_tau(x) mu_n", r"\mu _{n+1} = \operatorname{Ad}^{*}_{\tau (x)}\, \mu _{n}"),
        ("mu_n + 1", r"\mu _{n} + 1"),
        ("Ad*_g^-1 f", r"\operatorname{Ad}^{*}_{g^{-1}}\, f"),
        ("mu' = mu x w", r"\mu ' = \mu \, \times \, w"),
        ("x = h xi", r"x = h\, \xi"),
        ("(dtau^-1_xi)* dS/dxi", r"(\mathrm{d}\tau ^{-1}_{\xi })^{*}\, \mathrm{d}S/\mathrm{d}\xi"),
        ("E_i+1,i+1 - E_ij", "E_{i+1,i+1} - E_{ij}"),
        ("R^2n", "R^{2n}"),
        ("<mu, xi> = mu . xi", r"\langle \mu , \xi \rangle = \mu \cdot \xi"),
        ("{q, p} != d2l/dxi2", r"\{q, p\} \neq \mathrm{d}^2 l/\mathrm{d}\xi ^2"),
        ("|mu| <= sqrt(J_1 J_2)", r"\vert \mu \vert \le \sqrt{J_{1}\, J_{2}}"),
    ],
)
def test_formulas_are_set_as_they_are_meant(typed: str, set_: str) -> None:
    assert _typeset().read(typed) == set_


@pytest.mark.parametrize(
    "code",
    [
        *("t_end", "dexp_inv", "run.mu[-1]", "h=0.1", "steps == 3", "lm.SE3()", "m[0]", "A @ B"),
        *("g = [[R, p], [0, 1]]", "exp_Ad_star", "t0 + n*h", "print(x)", "a ** b", "python -m x"),
    ],
)
def test_programs_are_no_formulas(code: str) -> None:
    assert _typeset().read(code) is None


def test_words_stand_in_formulas_of_their_own_lines() -> None:
    read = _typeset().read
    assert read("P = F n, the first row first", True) == r"P = F\, n, \text{ the first row first}"
    assert read("rho = density exp(-z/height)", True) == (r"\rho = \text{ density }\exp (-z/\text{height})")
    assert read('y = u  first="kick"', True) == r'y = u\quad \text{ first="kick"}'
    lines = _typeset().lines
    assert lines(["body = plan.stepper(start)"]) is None
    assert lines(["for k in range(3):"]) is None
    assert lines(["drawn over each other look bold."]) is None


@pytest.mark.parametrize(
    ("sentence", "formulas"),
    [
        ("A canonical system of H = T(p) + V(q), a SeparableSystem.", ["H = T(p) + V(q)"]),
        ("Motion by mu' = ad*_xi mu with xi = dH/dmu.", ["mu' = ad*_xi mu", "xi = dH/dmu"]),
        ("Elements with g . x = x + g: every one.", ["g . x = x + g"]),
        ("A chart y = (q, p, c) of it.", ["y = (q, p, c)"]),
        ("P(g) = -tr(Ad_g)/k, k the largest.", ["P(g) = -tr(Ad_g)/k"]),
        ("The product in the other order, g * h = h g.", []),
        ("A place, z = R^T (point - p), is measured.", []),
        ("It does not glide, v2 - behind w = 0.", []),
        ("Use side = right, or h = 3 of them.", ["h = 3"]),
        ("A method in R^2n, or on T*G, and y = (q, p) in R^3.", ["R^2n", "y = (q, p)", "R^3"]),
    ],
)
def test_formulas_in_sentences_are_found_whole(sentence: str, formulas: list[str]) -> None:
    found = [sentence[a:b] for a, b in _typeset().inside(sentence)]
    assert found == formulas
