"""What the tests would miss: one token of a formula is changed at a time, and the tests that reach it must notice.

`python tests/mutation.py 200 --seed 1` tries two hundred changes in a copy of the tree; `--list`
only shows them, `--under groups compiler/machine/guard_words.py` takes those of some folders and files.  Numbers
of all kinds (sizes, indices, thresholds), signs, operators, comparisons, guards (`and`, `or`,
`not`), truth values, what ends loops, and `min`, `max`, `any`, `all` are changed; of groups,
methods, tableaus, systems, models and formulas, if nothing else is asked for.

First all tests run once in plain Python, and which lines each of them reaches is kept (`--reach` names the file).  Then
each change is put into the functions of a process that has collected all tests, and those that reach its line run in a
fork, the quickest and most particular first, until one fails.  What no function holds (a tableau, a default), and what
was not noticed, meets whole files of tests in a new process, native code and all.  Survivors are listed, to be judged
by a reader: some change nothing that can be observed.  Those that the table tests/unnoticed.md names, with a reason,
are not tried and not counted.  Needs Python 3.12 and a system that can fork.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import functools
import gc
import importlib
import io
import itertools
import os
import pickle
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import tokenize
import types
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _pytest.runner import runtestprotocol

ROOT = Path(__file__).parent.parent
FOLDERS = "groups", "integrators", "tableaus", "systems", "models", "formulas"
"""Whose changes are tried unless others are asked for."""
OTHERS = {
    "+": "-",
    "-": "+",
    "*": "+",
    "/": "*",
    "<": ">",
    ">": "<",
    "<=": ">",
    ">=": "<",
    "==": "!=",
    "!=": "==",
    "//": "*",
    "%": "//",
    "+=": "-=",
    "-=": "+=",
    "*=": "/=",
    "/=": "*=",
}
WORDS = {
    "and": "or",
    "or": "and",
    "not": "",
    "True": "False",
    "False": "True",
    "min": "max",
    "max": "min",
    "break": "continue",
    "continue": "break",
    "all": "any",
    "any": "all",
}
"""Guards, and what ends loops and chooses among numbers."""
ELSEWHERE = "test_documentation.py", "test_site.py", "viewer"
"""Tests whose formulas run in other processes, where what they reach is not seen."""
LONGEST = 1.0
"""Seconds of processor time for a test in plain Python; longer ones are left to native code."""
PLAIN, NATIVE = 40.0, 90.0
"""Seconds of processor time for one change, in a fork and in a new process."""
PRELOADED = ("llvmlite.binding", "matplotlib", "mpmath", "scipy.integrate", "scipy.linalg", "scipy.special", "sympy")
SURVIVED, CAUGHT, HUNG, UNDECIDED = "SURVIVED", "caught", "hung", "undecided"
JUDGED = re.compile(r"\| `(\S+\.py)` \| `(.+?)` \| .+ \|")
"""A row of the table of changes that nobody can see: file, the line with the change, why."""


@dataclass(frozen=True)
class Change:
    """One token of one file, and what stands in its place."""

    file: Path
    line: int
    column: int
    old: str
    new: str

    def text(self) -> str:
        """The file with the change."""
        lines = (ROOT / self.file).read_text(encoding="utf-8").splitlines(keepends=True)
        line = lines[self.line - 1]
        assert line[self.column :].startswith(self.old)
        lines[self.line - 1] = line[: self.column] + self.new + line[self.column + len(self.old) :]
        return "".join(lines)

    @property
    def line_after(self) -> str:
        """The changed line."""
        return self.text().splitlines()[self.line - 1].strip()

    @contextlib.contextmanager
    def made(self, tree: Path) -> Iterator[None]:
        """A copy of the tree has the change for a while."""
        write(tree / self.file, self.text())
        yield
        write(tree / self.file, (ROOT / self.file).read_text(encoding="utf-8"))

    def __str__(self) -> str:
        text = (ROOT / self.file).read_text(encoding="utf-8").splitlines()[self.line - 1].strip()
        return f"{self.file}:{self.line}: {self.old} -> {self.new} in `{text}`"


OUTPUT = os.dup(1)
"""Where this program writes, also while pytest keeps what tests write."""


def say(text: str) -> None:
    """A line of the report, at once."""
    os.write(OUTPUT, f"{text}\n".encode())


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
        if text.startswith(("import ", "from ", "@", "class ", "def ", "raise ", "__all__", '"', 'f"')):
            continue
        if re.search(r"reshape\(.*-$", token.line[:column]):
            continue  # any negative length is the one that NumPy finds
        if token.type == tokenize.NUMBER:
            number = ast.literal_eval(token.string)
            whole = isinstance(number, int)
            new = str(number + 1) if whole else repr(number * 1.25 if number else number + 1.0)
            found.append(Change(file, line, column, token.string, new))
        elif token.type == tokenize.NAME and token.string in WORDS:
            before = token.line[:column].split()[-1:]
            after = token.line[column + len(token.string) :].lstrip()
            called = token.string in ("min", "max", "all", "any")
            if token.string == "not" and (before == ["is"] or after.startswith("in ")):
                continue  # parts of another word
            if called and (not after.startswith("(") or token.line[column - 1 : column] == "."):
                continue  # a name of something else
            found.append(Change(file, line, column, token.string, WORDS[token.string]))
        elif token.type == tokenize.OP and token.string in OTHERS and not text.startswith("*") and "->" not in text:
            left, right = (
                token.line[column - 1 : column],
                token.line[column + len(token.string) : column + len(token.string) + 1],
            )
            if left == right == " ":  # an operator between two values, by the habits of this tree
                found.append(Change(file, line, column, token.string, OTHERS[token.string]))
    return found


def judged() -> set[tuple[str, str]]:
    """The changes that a reader has found to change nothing that can be observed, of any line."""
    page = (ROOT / "tests" / "unnoticed.md").read_text(encoding="utf-8")
    rows = (JUDGED.fullmatch(line) for line in page.splitlines())
    return {(f"liemech/{row[1]}", row[2].replace("\\|", "|")) for row in rows if row}


def statement(change: Change) -> tuple[range, str]:
    """The lines of the statement that is changed (of a loop or a branch its head), and the name at
    the top that it belongs to.
    """
    tree = ast.parse((ROOT / change.file).read_text(encoding="utf-8"))
    inside = [n for n in ast.walk(tree) if isinstance(n, ast.stmt) and n.lineno <= change.line <= (n.end_lineno or 0)]
    top, last = inside[0], inside[-1]
    body = getattr(last, "body", None)
    names = [n.id for n in ast.walk(top) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
    owner = top.name if isinstance(top, ast.ClassDef | ast.FunctionDef) else (names or [""])[0]
    return range(last.lineno, body[0].lineno if body else (last.end_lineno or 0) + 1), owner


# Which test reaches which line.


class TooLong(BaseException):
    """The time of a test is over."""


@contextlib.contextmanager
def processor_time(seconds: float) -> Iterator[None]:
    """No longer than so many seconds of the processor, or ten times as long for what waits; again,
    if the exception is caught.
    """

    def stop(*_: Any) -> None:
        raise TooLong

    for number in (signal.SIGPROF, signal.SIGALRM):
        signal.signal(number, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)
    signal.setitimer(signal.ITIMER_REAL, 10.0 * seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def outcome(item: pytest.Item, following: pytest.Item | None, seconds: float) -> str:
    """Run a test: does it pass in this time?"""
    try:
        with processor_time(seconds):
            reports = runtestprotocol(item, nextitem=following, log=False)
    except TooLong:
        return HUNG
    failed = [r for r in reports if r.failed]
    return HUNG if any("TooLong" in str(r.longrepr) for r in failed) else CAUGHT if failed else SURVIVED


def in_forks(works: list[Callable[[], Any]], folder: Path) -> list[Any]:
    """What each of these gives in a child of this process, side by side; None if the child dies."""
    sys.stdout.flush()
    begun = []
    for work in works:
        handle, name = tempfile.mkstemp(dir=folder)
        os.close(handle)
        file = Path(name)
        child = os.fork()
        if child == 0:
            try:
                file.write_bytes(pickle.dumps(work()))
            finally:
                os._exit(0)
        begun.append((child, file))
    results = []
    for child, file in begun:
        os.waitpid(child, 0)
        content = file.read_bytes()
        file.unlink()
        results.append(pickle.loads(content) if content else None)
    return results


def in_fork(work: Callable[[], Any], folder: Path) -> Any:
    """What some work gives in a child of this process; None if the child dies."""
    return in_forks([work], folder)[0]


@dataclass
class Reach:
    """The lines that tests reach in plain Python, the time they need, and those that pass."""

    names: list[str]
    places: dict[tuple[str, int], int]
    reached: Any
    """Tests times places, in bits."""
    seconds: Any
    passed: Any

    def of(self, file: Path, lines: range) -> Any:
        """Which tests reach one of the lines."""
        columns = [self.places[str(file), line] for line in lines if (str(file), line) in self.places]
        found = np.zeros(len(self.names), bool)
        for k in columns:
            found |= (self.reached[:, k // 8] >> (7 - k % 8)) & 1 == 1
        return found

    @classmethod
    def joined(cls, parts: list[Reach]) -> Reach:
        """What was seen in several processes."""
        places: dict[tuple[str, int], int] = {}
        for place in itertools.chain(*(part.places for part in parts)):
            places.setdefault(place, len(places))
        blocks = []
        for part in parts:
            block = np.zeros((len(part.names), len(places)), bool)
            seen = np.unpackbits(part.reached, axis=1, count=len(part.places))
            block[:, [places[place] for place in part.places]] = seen
            blocks.append(np.packbits(block, axis=1))
        return cls(
            [name for part in parts for name in part.names],
            places,
            np.concatenate(blocks),
            np.concatenate([part.seconds for part in parts]),
            np.concatenate([part.passed for part in parts]),
        )


def reach(items: list[pytest.Item], tree: Path) -> Reach:
    """Run tests in plain Python and see what each of them reaches."""
    monitoring, tool, prefix = (sys.monitoring, sys.monitoring.COVERAGE_ID, str(tree / "liemech") + os.sep)
    places: dict[tuple[str, int], int] = {}
    lines: set[int] = set()
    rows, seconds, passed = [], [], []

    def line(code: types.CodeType, number: int) -> Any:
        if code.co_filename.startswith(prefix):
            lines.add(places.setdefault((code.co_filename[len(str(tree)) + 1 :], number), len(places)))
        return monitoring.DISABLE

    monitoring.use_tool_id(tool, "mutation")
    monitoring.register_callback(tool, monitoring.events.LINE, line)
    monitoring.set_events(tool, monitoring.events.LINE)
    for item, following in itertools.zip_longest(items, items[1:]):
        lines.clear()
        begin = time.process_time()
        monitoring.restart_events()
        passed.append(not item.get_closest_marker("compiled") and outcome(item, following, LONGEST) == SURVIVED)
        seconds.append(time.process_time() - begin)
        rows.append(np.array(sorted(lines), np.int64))
        if len(rows) % 500 == 0:
            say(f"{len(rows)} of {len(items)} tests have run, {sum(seconds):.0f} s")
    bits = np.zeros((len(items), len(places)), bool)
    for row, found in zip(bits, rows, strict=True):
        row[found] = True
    return Reach([i.nodeid for i in items], places, np.packbits(bits, axis=1), np.array(seconds), np.array(passed))


# Changes of functions, in forks of a process that has collected all tests.


def nested(code: types.CodeType) -> Iterator[types.CodeType]:
    for c in code.co_consts:
        if isinstance(c, types.CodeType):
            yield c
            yield from nested(c)


class Trials:
    """A plugin of pytest that runs the tests once and again, in forks, with one change after another."""

    def __init__(self, tree: Path, chosen: list[Change], kept: Path) -> None:
        self.tree, self.chosen, self.kept = tree, chosen, kept
        self.verdicts: dict[Change, str] = {}
        self.reach: Reach | None = None

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        os.environ["LIEMECH_COMPILE"] = "0"
        gc.unfreeze()
        functions = defaultdict(list)
        for found in gc.get_objects():
            if isinstance(found, types.FunctionType):
                functions[found.__code__.co_filename].append(found)
        gc.freeze()
        items = {item.nodeid: item for item in session.items}
        if not self.kept.exists():
            parts = [[], []]  # by whole files, on two processors
            for k, (_, found) in enumerate(itertools.groupby(session.items, lambda i: i.path)):
                parts[k % 2] += found
            seen = in_forks([functools.partial(reach, p, self.tree) for p in parts], self.tree)
            self.kept.write_bytes(pickle.dumps(Reach.joined(seen)))
        self.reach = pickle.loads(self.kept.read_bytes())
        for i, change in enumerate(self.chosen, 1):
            with change.made(self.tree):
                path, old = (self.tree / change.file, (ROOT / change.file).read_text(encoding="utf-8"))
                before, after = (compile(t, str(path), "exec", dont_inherit=True) for t in (old, change.text()))
                other = {a: b for a, b in zip(nested(before), nested(after), strict=True) if a != b}
                swapped = [(f, other[f.__code__]) for f in functions[str(path)] if f.__code__ in other]
                if swapped:
                    tests = self.ordered(change, items)
                    self.verdicts[change] = in_fork(functools.partial(self.trial, swapped, tests), self.tree) or HUNG
                    say(f"{i:4} {self.verdicts[change]:9} {len(tests):4} tests {change}")
        return True

    def ordered(self, change: Change, items: dict[str, pytest.Item]) -> list[tuple[pytest.Item, float]]:
        """The tests that reach the change: of each test function one variant, then one more, the
        quick and particular first.
        """
        assert self.reach
        found = self.reach.of(change.file, statement(change)[0]) & self.reach.passed
        lines = np.bitwise_count(self.reach.reached).sum(axis=1)
        turns: dict[str, int] = defaultdict(int)
        order = []
        for k in sorted(np.flatnonzero(found), key=lambda k: self.reach.seconds[k] * lines[k]):
            name = self.reach.names[k]
            function = name.partition("[")[0]
            order.append((turns[function], self.reach.seconds[k] * lines[k], name, self.reach.seconds[k]))
            turns[function] += 1
        return [(items[name], seconds) for _, _, name, seconds in sorted(order) if name in items]

    @staticmethod
    def trial(swapped: list[tuple[types.FunctionType, types.CodeType]], tests: list[tuple[pytest.Item, float]]) -> str:
        """Does a test fail with other code in these functions?"""
        for function, code in swapped:
            function.__code__ = code
        begin = time.process_time()
        for (item, seconds), following in itertools.zip_longest(tests, tests[1:]):
            found = outcome(item, following and following[0], 5.0 + 10.0 * seconds)
            if found != SURVIVED:
                return found
            if time.process_time() - begin > PLAIN:
                return UNDECIDED
        return SURVIVED


# Changes of what is made once, and of functions whose tests have not noticed: a new process, whole
# files, native code.


def test_files(change: Change, reached: Reach) -> list[str]:
    """The files of tests that know what is changed, those that know most about it first."""
    module, home, owner = (
        ".".join(change.file.with_suffix("").parts),
        f"tests/{change.file.parts[1]}",
        statement(change)[1],
    )
    reaching = {
        name.partition("::")[0] for name, yes in zip(reached.names, reached.of(change.file, range(10**5))) if yes
    }
    points = {}
    for path in sorted(Path("tests").rglob("test_*.py")):  # those of the copy
        name, text = str(path), path.read_text(encoding="utf-8")
        points[name] = 2 * (change.file.stem in path.stem) + 3 * name.startswith(home) + 2 * (module in text)
        points[name] += (name in reaching) + (3 * bool(re.search(rf"\b{owner}\b", text)) if owner else 0)
    return sorted([name for name in points if points[name] > 1], key=lambda name: -points[name])


def verdict(tree: Path, files: list[str], seconds: float, native: bool) -> str:
    """Does a test of these files fail?  Native code of what was not changed is found on disk."""

    def run() -> int:
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
        os.environ["LIEMECH_COMPILE"] = "1" if native else "0"
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
        return int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *files]))

    code = in_fork(run, tree)
    return UNDECIDED if code is None else SURVIVED if code in (0, 5) else CAUGHT  # 5: no test there


def main() -> None:
    """Try the changes and print who survives."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--under", nargs="+", default=FOLDERS, help="only these folders and files of liemech")
    parser.add_argument("--list", action="store_true", help="only show the changes")
    parser.add_argument("--reach", type=Path, help="what each test reaches: written here, or read if it is there")
    options = parser.parse_args()
    files = []
    for name in options.under:
        place = ROOT / "liemech" / name
        inside = [place] if place.is_file() else sorted(place.rglob("*.py"))
        if not inside:
            parser.error(f"--under: there is no file under liemech/{name}")
        files += [p.relative_to(ROOT) for p in inside]
    chosen = random.Random(options.seed).sample([c for file in files for c in changes(file)], options.count)
    unseen = judged()
    equal = [c for c in chosen if (str(c.file), c.line_after) in unseen]
    chosen = [c for c in chosen if c not in equal]
    if options.list:
        print(*chosen, sep="\n")
        return
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder).resolve()
        for name in ("liemech", "tests", "docs", "examples"):
            shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("pyproject.toml", "README.md"):
            shutil.copy(ROOT / name, tree)
        os.chdir(tree)
        os.environ |= {"PYTHONPATH": str(tree), "LIEMECH_CACHE_DIR": str(tree / "cache")}
        sys.path[:] = [str(tree), *(p for p in sys.path if not p.startswith(str(ROOT)))]
        kept = (ROOT / options.reach).resolve() if options.reach else tree / "reach.pickle"

        def in_memory() -> dict[Change, str]:
            trials = Trials(tree, chosen, kept)
            quiet = (
                "-q",
                "-p",
                "no:cacheprovider",
                "-p",
                "no:xdist",
                "-W",
                "ignore::pluggy.PluggyTeardownRaisedWarning",
            )
            pytest.main([*quiet, *(f"--ignore={tree / 'tests' / name}" for name in ELSEWHERE)], plugins=[trials])
            return trials.verdicts

        for name in PRELOADED:
            importlib.import_module(name)
        verdicts = in_fork(in_memory, tree)
        reached = pickle.loads(kept.read_bytes())
        left = [c for c in chosen if verdicts.get(c, UNDECIDED) in (SURVIVED, UNDECIDED)]
        for native, seconds in ((False, PLAIN), (True, NATIVE)):
            for change in tuple(left):
                known = test_files(change, reached)[: None if native else 3]
                with change.made(tree):
                    verdicts[change] = verdict(tree, known, seconds, native)
                say(f"{verdicts[change]:9} {len(known):4} files {change}")
                if verdicts[change] == CAUGHT:
                    left.remove(change)
    say(f"\n{len(chosen) - len(left)} of {len(chosen)} changes were noticed; the others:")
    for change in left:
        say(f"  {verdicts[change]} {change}")
    say(f"{len(equal)} more are known to change nothing that can be seen:")
    for change in equal:
        say(f"  {change}")


if __name__ == "__main__":
    main()
