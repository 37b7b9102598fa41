"""What the tests would miss: one token of a formula is changed at a time, and the tests that know the file must notice.

`python tests/mutation.py 200 --seed 1` tries two hundred changes, one after another, in a copy of the tree; `--list` only shows
them.  Numbers, signs, operators, comparisons and small indices of groups, methods, tableaus, systems, models and formulas are
changed.  A change that the tests of the file do not notice meets those of its folder, and then the whole default suite, unless
`--quick`.  Survivors are listed, to be judged by a reader: some change nothing that can be observed.
"""

from __future__ import annotations

import argparse
import io
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tokenize
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
FOLDERS = "groups", "integrators", "tableaus", "systems", "models", "formulas"
OTHERS = {"+": "-", "-": "+", "*": "+", "/": "*", "<": ">", ">": "<", "<=": ">", ">=": "<", "==": "!=", "!=": "=="}
TIME_LIMIT = 900
"""Seconds for the tests of one change; one that makes them hang is noticed, and said to hang, for the machine may be busy."""


@dataclass(frozen=True)
class Change:
    """One token of one file, and what stands in its place."""

    file: Path
    line: int
    column: int
    old: str
    new: str

    def apply(self, tree: Path) -> None:
        """Write it into a copy of the tree."""
        path = tree / self.file
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        text = lines[self.line - 1]
        assert text[self.column :].startswith(self.old)
        lines[self.line - 1] = text[: self.column] + self.new + text[self.column + len(self.old) :]
        write(path, "".join(lines))

    def undo(self, tree: Path) -> None:
        """Write what was there before."""
        write(tree / self.file, (ROOT / self.file).read_text(encoding="utf-8"))

    def __str__(self) -> str:
        text = (ROOT / self.file).read_text(encoding="utf-8").splitlines()[self.line - 1].strip()
        return f"{self.file}:{self.line}: {self.old} -> {self.new} in `{text}`"


def write(path: Path, text: str) -> None:
    """Change a file such that Python sees it: its time is one that the file never had."""
    last = path.stat().st_mtime
    path.write_text(text, encoding="utf-8")
    os.utime(path, (last + 2.0, last + 2.0))


def changes(file: Path) -> list[Change]:
    """All changes of a file, without those of its annotations, imports, messages and decorators."""
    found: list[Change] = []
    source = (ROOT / file).read_text(encoding="utf-8")
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        (line, column), text = token.start, token.line.strip()
        if text.startswith(("import ", "from ", "@", "class ", "def ", "raise ", "__all__", '"', "f\"")):
            continue
        if token.type == tokenize.NUMBER and token.string.replace(".", "").isdigit():
            value = float(token.string)
            new = str(int(value) + 1) if token.string.isdigit() else repr(value * 1.25 if value else 1.0)
            found.append(Change(file, line, column, token.string, new))
        elif token.type == tokenize.OP and token.string in OTHERS and not text.startswith("*") and "->" not in text:
            left, right = token.line[column - 1 : column], token.line[column + len(token.string) : column + len(token.string) + 1]
            if left == right == " ":  # an operator between two values, by the habits of this tree
                found.append(Change(file, line, column, token.string, OTHERS[token.string]))
    return found


def tests_of(file: Path) -> list[list[str]]:
    """Test files that import or name the module, the one of its name first; then those of its folder or that name its classes."""
    module, home = ".".join(file.with_suffix("").parts), ROOT / "tests" / file.parts[1]
    everything = sorted((ROOT / "tests").rglob("test_*.py"))
    own = [p for p in everything if file.stem in p.stem]
    named = [p for p in everything if module in p.read_text(encoding="utf-8")]
    first = dict.fromkeys((*own, *named))
    classes = re.findall(r"^class (\w+)", (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
    users = [p for p in everything if classes and re.search(rf"\b({'|'.join(classes)})\b", p.read_text(encoding="utf-8"))]
    stages = list(first), [p for p in everything if (p.is_relative_to(home) or p in users) and p not in first]
    return [[str(p.relative_to(ROOT)) for p in stage] for stage in stages if stage]


def verdict(tree: Path, tests: list[str]) -> str:
    """Does a test fail?  Native code of what was not changed is found on disk."""
    environment = os.environ | {"PYTHONPATH": str(tree), "LIEMECH_CACHE_DIR": str(tree / "cache")}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, timeout=TIME_LIMIT, check=False)
    except subprocess.TimeoutExpired:
        return "hung"
    return "SURVIVED" if done.returncode in (0, 5) else "caught"  # 5: no test there


def main() -> None:
    """Try the changes and print who survives."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="only show the changes")
    parser.add_argument("--quick", action="store_true", help="not the whole suite")
    options = parser.parse_args()
    files = [p.relative_to(ROOT) for folder in FOLDERS for p in sorted((ROOT / "liemech" / folder).rglob("*.py"))]
    chosen = random.Random(options.seed).sample([c for file in files for c in changes(file)], options.count)
    survivors: list[Change] = []
    if options.list:
        print(*chosen, sep="\n")
        return
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for name in ("liemech", "tests", "docs", "examples"):
            shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("pyproject.toml", "README.md"):
            shutil.copy(ROOT / name, tree)
        for i, change in enumerate(chosen, 1):
            change.apply(tree)
            stages = tests_of(change.file) + ([] if options.quick else [[]])
            verdicts = (verdict(tree, tests) for tests in stages)
            found = next((word for word in verdicts if word != "SURVIVED"), "SURVIVED")
            change.undo(tree)
            print(f"{i:4} {found:8} {change}", flush=True)
            survivors += [change] if found == "SURVIVED" else []
    print(f"\n{len(chosen) - len(survivors)} of {len(chosen)} changes were noticed; survivors:", *survivors, sep="\n  ")


if __name__ == "__main__":
    main()
