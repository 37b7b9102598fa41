"""What the pages say is true: their Python runs, the examples run, and CI runs the commands of the README.

A page is one program: its ```python blocks share one namespace and run in order, in an empty
folder. A ```text block right after one is what that one prints. A block tagged
```python no-run is left out, and the paragraph before it must say that it is not run, and why.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import multiprocessing
import os
import re
import runpy
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [page for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))] if page.exists()]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

LANGUAGES = {"python", "python no-run", "sh", "bash", "text", "toml", "math", "json", "bibtex"}
"""Every fence says what it holds, so that no program hides from this test behind a misspelt tag."""

COMPILED = {
    *("chaos_in_a_galaxy", "energy_exchange", "banana_orbit", "binary_asteroid", "drop_of_water"),
    *("magnons", "real_time", "attitude_control", "rocket", "flight_code"),
    *("README", "native", "your_own_group", "choosing_a_step", "bodies_in_fields", "hamilton_jacobi"),
    *(
        "symplectic_methods",
        "time_transformations",
        "eccentric_orbit",
        "ensemble",
        "double_pendulum",
        "ensemble_in_the_browser",
    ),
    *("constrained_systems", "index_reduction", "chain", "tutorial"),
    *("estimation", "attitude_filter", "arm_gains", "exercises"),
}
"""Pages and examples about native code, or too long without it."""

QUICK = {"README", "conventions", "tableaus", "tennis_racket"}
"""Pages and examples that run whenever the tests run; the others are slow, and `.ci/run` runs a third of them."""

TIME_LIMIT = 300  # seconds for one page or one example


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: what its fence says, its lines, where they begin, and the paragraph before it."""

    language: str
    lines: tuple[str, ...]
    start: int
    before: str


def blocks(page: Path) -> list[Block]:
    found: list[Block] = []
    fence, language, start = "", "", 0
    lines = page.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines):
        if fence:
            if line.strip() == fence:
                before = "\n".join(lines[: start - 1]).rstrip().rpartition("\n\n")[2]
                found.append(Block(language, tuple(lines[start:number]), start, before))
                fence = ""
        elif mark := re.match(r"(`{3,})(.*)", line):
            fence, language, start = mark[1], mark[2].strip(), number + 1
    assert not fence, f"{page.name}: the fence opened in line {start} is not closed"
    return found


def programs(files: list[Path]) -> list[Any]:
    """The files as parameters of a test, with marks for those that need the compiler and for the slow ones."""
    native = {f: [pytest.mark.compiled] if f.stem in COMPILED else [] for f in files}
    slow = {f: [] if f.stem in QUICK else [pytest.mark.slow] for f in files}
    return [pytest.param(f, marks=[*native[f], *slow[f]]) for f in files]


def page_name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def run(program: Path, folder: Path) -> str:
    """What a program prints in a folder of its own: in a copy of this process, which has imported
    all, where there is fork.
    """
    printed = folder.with_name(f"{folder.name}.printed")
    if "fork" in multiprocessing.get_all_start_methods():
        for module in ("llvmlite.binding", "matplotlib.pyplot", "scipy.optimize", "scipy.spatial.transform"):
            with contextlib.suppress(ImportError):
                importlib.import_module(module)
        copy = multiprocessing.get_context("fork").Process(target=inside, args=(program, folder, printed))
        with warnings.catch_warnings():
            # a worker of xdist has a second thread, which only listens
            warnings.simplefilter("ignore", DeprecationWarning)
            copy.start()
        copy.join(TIME_LIMIT)
        copy.kill()
        copy.join()
        code = copy.exitcode
    else:
        with open(printed, "w", encoding="utf-8") as out:
            command = [sys.executable, str(program)]
            code = subprocess.run(
                command, cwd=folder, stdout=out, stderr=out, timeout=TIME_LIMIT, check=False
            ).returncode
    text = printed.read_text(encoding="utf-8")
    assert code == 0, f"{program.name} failed:\n{text[-6000:]}"
    return text


def inside(program: Path, folder: Path, printed: Path) -> None:
    """Run a program in a folder as `python program` does."""
    os.chdir(folder)
    sys.stdout = sys.stderr = out = open(printed, "w", encoding="utf-8", buffering=1)  # noqa: SIM115
    os.dup2(out.fileno(), 1)
    os.dup2(out.fileno(), 2)
    sys.argv, sys.path[0:0] = [str(program)], [str(program.parent)]
    runpy.run_path(str(program), run_name="__main__")


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_fences_say_what_they_hold(page: Path) -> None:
    for block in blocks(page):
        place = f"{page_name(page)}, line {block.start}"
        assert block.language in LANGUAGES, f"{place}: ```{block.language} is not known here"
        if block.language == "python no-run":
            assert "not run" in " ".join(block.before.split()), (
                f"{place}: say in the paragraph before it why it is not run"
            )


@pytest.mark.sample(4)
@pytest.mark.parametrize("page", programs(PAGES), ids=page_name)
def test_page_runs(page: Path, tmp_path: Path) -> None:
    # The program has its lines where the page has them, so a traceback points into the page; and a
    # file, which the compiler of formulas reads.
    outputs, text = printing(), page.read_text(encoding="utf-8")
    program = outputs.program(text)
    if not any(program):
        return
    file = tmp_path / f"{page.stem}.md.py"
    file.write_text("\n".join(program) + "\n", encoding="utf-8")
    found = outputs.outputs(run(file, tmp_path))
    for line, wanted in outputs.promised(text).items():
        wrong = outputs.difference(wanted, found[line])
        assert wrong is None, f"{page_name(page)}, line {line}: {wrong}"


def printing() -> Any:
    """The program that knows what a page promises to print."""
    file = ROOT / "docs" / "site" / "outputs.py"
    spec = importlib.util.spec_from_file_location("outputs", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_every_block_that_prints_shows_what(page: Path) -> None:
    lines = [line + 1 for line in printing().silent(page.read_text(encoding="utf-8"))]
    assert not lines, f"{page_name(page)}: run docs/site/outputs.py for the blocks at the lines {lines}"


def test_an_output_that_is_not_printed_is_noticed() -> None:
    outputs = printing()
    page = "text\n```python\nprint(2.0, 'x')\n```\n\n```text\n2.001 x\n```\nmore\n"
    assert outputs.promised(page) == {2: "2.001 x\n"}
    assert outputs.silent(page) == [] and outputs.silent("```python\nprint(1)\n```\n") == [1]
    assert outputs.written("```python\nprint(1)\n```\n", {1: "1\n"}) == "```python\nprint(1)\n```\n\n```text\n1\n```\n"
    assert outputs.program(page)[2] == "print(2.0, 'x')"
    assert outputs.outputs("a\x1e2 2.0 x \n\x1fb") == {2: "2.0 x\n"}
    alike = [("2.0 x", "2.001 x"), ("1e-15", "-3e-14"), ("a\n...\nb 1", "a\nq\nr\nb 1"), ("a  1", "a 1")]
    unlike = [("2.0 x", "2.0 y"), ("2.0", "2.1"), ("1e-15", "1e-9"), ("a", "a\nb"), ("a\nb", "a"), ("...\nb", "a")]
    for wanted, found in alike:
        assert outputs.difference(wanted + "\n", found + "\n") is None, wanted
    for wanted, found in unlike:
        assert outputs.difference(wanted + "\n", found + "\n") is not None, wanted


@pytest.mark.parametrize("example", programs(EXAMPLES), ids=lambda example: example.stem)
def test_example_runs_and_shows_something(example: Path, tmp_path: Path) -> None:
    printed = run(example, tmp_path)
    assert printed.strip() or any(tmp_path.iterdir()), f"{example.name} ends with neither a number nor a picture"


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_links_inside_the_tree_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    # links stand outside code
    text = re.sub(r"^```.*?^```$|`[^`\n]+`", "", text, flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        if "://" not in target and not target.startswith("mailto:"):
            assert (page.parent / target).exists(), f"{page_name(page)} links to {target}, which does not exist"


def test_readme_has_two_commands_and_ci_runs_them() -> None:
    readme = ROOT / "README.md"
    if not readme.exists():
        pytest.skip("no README yet")
    commands = [list(block.lines) for block in blocks(readme) if block.language in ("sh", "bash")]
    assert commands == [
        ['pip install ".[plot,viewer]" && python -m liemech'],
        ['pip install ".[test]" && python -m pytest -n auto'],
    ]
    for number, expected in enumerate(commands, start=1):
        show = ["bash", str(ROOT / ".ci" / "run"), "--show", str(number)]
        shown = subprocess.run(show, capture_output=True, text=True, check=True, timeout=60)
        assert shown.stdout.splitlines() == expected
