"""What the Python of a page prints: a ```text block right after a ```python block is the output of that
block.  The tests compare it with what is printed; this writes it anew, and where there is none yet:

    python docs/site/outputs.py docs/tutorial.md ...

Text counts as it is, numbers to two digits; two numbers below 1e-11 are both rounding.  A line `...` in
the page stands for any lines.
"""

from __future__ import annotations

import os
import re
import runpy
import sys
import tempfile
from pathlib import Path

BEGIN, END = "\x1e", "\x1f"
ROUNDING = 1e-11
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w])")
CAPTURE = "import io, sys; sys.stdout, _whole = io.StringIO(), sys.stdout"
TELL = (
    "sys.stdout, _part = _whole, sys.stdout; "
    """print("{0}{1} " + _part.getvalue() + "{2}", end="")"""
)
"""Lines before and after a block: its output alone, without progress and warnings."""
CLOCK = re.compile(r" (compiled|plain);")
"""How a run was made: the clock decides."""
BLOCK = re.compile(
    r"^```python\n(?P<code>(?:(?!^```).)*)^```$(?:\n\n^```text\n(?P<text>.*?)^```$)?",
    re.MULTILINE | re.DOTALL,
)
"""A block of code, and its output if the page has it."""


def promised(page: str) -> dict[int, str]:
    """The outputs in a page, by the number of the line in which their program begins."""
    return {
        page.count("\n", 0, block.start("code")): block["text"]
        for block in BLOCK.finditer(page)
        if block["text"] is not None
    }


def silent(page: str) -> list[int]:
    """The lines in which programs begin that print something the page does not show."""
    return [
        page.count("\n", 0, block.start("code"))
        for block in BLOCK.finditer(page)
        if block["text"] is None and re.search(r"\bprint\(", block["code"])
    ]


def program(page: str) -> list[str]:
    """The lines of the program of a page, at their places, which says where the output of a block begins
    and ends if it prints something.
    """
    lines = [""] * (page.count("\n") + 1)
    told = {*promised(page), *silent(page)}
    for block in BLOCK.finditer(page):
        start = page.count("\n", 0, block.start("code"))
        code = block["code"].splitlines()
        lines[start : start + len(code)] = code
        if start in told:
            lines[start - 1] = CAPTURE
            lines[start + len(code)] = TELL.format(escaped(BEGIN), start, escaped(END))
    return lines


def escaped(mark: str) -> str:
    """As Python writes it in a text."""
    return f"\\x{ord(mark):02x}"


def outputs(printed: str) -> dict[int, str]:
    """What was printed by blocks."""
    found = {}
    for match in re.finditer(f"{BEGIN}(\\d+) (.*?){END}", printed, re.DOTALL):
        found[int(match[1])] = "".join(f"{line.rstrip()}\n" for line in match[2].splitlines())
    return found


def difference(wanted: str, found: str) -> str | None:
    """What is different in an output; None if nothing is."""
    left, right = wanted.splitlines(), found.splitlines()
    while left and right:
        if left[0].strip() == "...":
            if len(left) == 1:
                return None
            while right and not same(left[1], right[0]):
                right.pop(0)
            left.pop(0)
        elif not same(left[0], right[0]):
            return f"it prints\n  {right[0]}\nwhere the page has\n  {left[0]}"
        else:
            left.pop(0)
            right.pop(0)
    if [line for line in left if line.strip() != "..."] or right:
        return f"it prints{chr(10)}{found}where the page has{chr(10)}{wanted}"
    return None


def same(wanted: str, found: str) -> bool:
    """Are two lines equal, numbers to two digits?"""
    if _words(wanted) != _words(found):
        return False
    pairs = zip(map(float, NUMBER.findall(wanted)), map(float, NUMBER.findall(found)))
    return all(
        max(abs(a), abs(b)) < ROUNDING or abs(a - b) <= 0.01 * max(abs(a), abs(b)) for a, b in pairs
    )


def _words(line: str) -> list[str]:
    return NUMBER.sub(" # ", CLOCK.sub(" either;", line)).split()


def written(page: str, found: dict[int, str]) -> str:
    """The page with these outputs; those with `...` stay."""

    def anew(match: re.Match[str]) -> str:
        text = found.get(page.count("\n", 0, match.start("code")))
        if text is None or "...\n" in (match["text"] or ""):
            return match[0]
        return f"```python\n{match['code']}```\n\n```text\n{text}```"

    return BLOCK.sub(anew, page)


def main() -> None:
    for name in sys.argv[1:]:
        path = Path(name).resolve()
        page = path.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"{path.stem}.md.py"
            file.write_text("\n".join(program(page)) + "\n", encoding="utf-8")
            out = Path(folder) / "printed"
            back, kept = os.getcwd(), sys.stdout
            with out.open("w", encoding="utf-8") as sys.stdout:
                os.chdir(folder)
                try:
                    runpy.run_path(str(file), run_name="__main__")
                finally:
                    os.chdir(back)
            sys.stdout = kept
            path.write_text(
                written(page, outputs(out.read_text(encoding="utf-8"))), encoding="utf-8"
            )


if __name__ == "__main__":
    main()
