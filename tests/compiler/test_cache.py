"""The disk cache: found by the next process, missed after every edit that matters and no other, hard to break."""

from __future__ import annotations

import contextlib
import io
import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import pytest
import worlds  # noqa: F401 -- with all that it needs, for the copies of this process

import liemech
from liemech.compiler import kernel
from liemech.compiler.changes import cache

pytestmark = pytest.mark.compiled

HELPER = """
RATE = 0.5
POLYNOMIAL = (1.0, 2.0, 3.0)


class Settings:
    depth = 2.0


class Knob:
    def __init__(self, turn):
        self.turn = turn


KNOB = Knob(1.5)


def drag(x, power=2.0, *, sign=-1.0):
    return sign * power * x


def unrelated(x):
    return x + 1.0
"""

FORMULAS = '''
import helper
import helper as short
from helper import KNOB, POLYNOMIAL, Settings, drag
from liemech.formulas import Record, record, vec


def scaled(factor):
    def inner(x):
        return factor * x
    return inner


TWICE = scaled(2.0)


@record
class Base(Record):
    k: float
    order: int = 3
    gain = 1.25

    @property
    def stiff(self):
        return 2.0 * self.k

    def force(self, x):
        return self.stiff * x + self.more(x)

    def more(self, x):
        return x * self.gain

    @staticmethod
    def clip(x):
        return min(x, 10.0)


@record
class Child(Base):
    def force(self, x):
        """What it does."""
        return super().force(x) + drag(x) + helper.RATE  # a remark


CHILD = Child(2.0)


def formula(a, b, c, d, n):
    total = CHILD.clip(CHILD.force(a)) + TWICE(b) + short.drag(c, 3.0) + KNOB.turn
    for i in range(CHILD.order):
        total = total + POLYNOMIAL[i] * d
    return vec(total, Settings.depth)
'''

PROGRAM = """
import json, sys
sys.path[:0] = sys.argv[1:]
import formulas, worlds
from liemech.compiler import kernel
rows = [[1.0, 2.0, 3.0, 4.0], [-1.0, 0.5, 0.25, 8.0]]
found = worlds.native(formulas.formula, rows, 2, 3, 1)
right = [worlds.plain(formulas.formula, row, 3) for row in rows]
print(json.dumps({"cached": [k.cached for k in kernel.alive()], "right": found == right}))
"""


def in_a_copy(program: str, *arguments: str, folder: Path) -> str:
    """What a program prints in a process of its own: a copy of this one, which has imported the
    compiler, where there is fork.

    Whatever this process compiled is forgotten there; the folder is that of the cache.
    """
    if "fork" not in multiprocessing.get_all_start_methods():
        env = os.environ | {"LIEMECH_CACHE_DIR": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-c", program, *arguments]
        return subprocess.run(command, env=env, capture_output=True, text=True, timeout=120, check=True).stdout

    def inside(channel: Any) -> None:
        os.environ["LIEMECH_CACHE_DIR"] = str(folder)
        sys.argv, sys.dont_write_bytecode = ["-c", *arguments], True
        kernel.forget()
        cache.folder.cache_clear()
        printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(printed):
                exec(compile(program, "<program>", "exec"), {"__name__": "__main__"})
        except BaseException:
            channel.send((False, traceback.format_exc()))
        else:
            channel.send((True, printed.getvalue()))

    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    copy = context.Process(target=inside, args=(there,))
    with warnings.catch_warnings():
        # a worker of xdist has a second thread, which only listens
        warnings.simplefilter("ignore", DeprecationWarning)
        copy.start()
    assert here.poll(120)
    worked, text = here.recv()
    copy.join(120)
    assert worked, text
    return text


class Project:
    """Two modules in a folder, and a cache."""

    def __init__(self, place: Path) -> None:
        self.place, self.cache = place, place / "cache"
        (place / "helper.py").write_text(HELPER)
        (place / "formulas.py").write_text(FORMULAS)

    def edit(self, file: str, old: str, new: str) -> None:
        path = self.place / f"{file}.py"
        text = path.read_text()
        assert text.count(old) == 1, old
        path.write_text(text.replace(old, new))

    def start(self, **environment: str) -> subprocess.Popen[str]:
        env = os.environ | {"LIEMECH_CACHE_DIR": str(self.cache), "PYTHONDONTWRITEBYTECODE": "1"} | environment
        command = [sys.executable, "-c", PROGRAM, str(self.place), str(Path(__file__).parent)]
        return subprocess.Popen(
            command, cwd=self.place, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def hits(self, **environment: str) -> bool:
        """Run the formula in another process, of a new Python if it has its own environment: was its code found?

        The result is right in any case.
        """
        if environment:
            return self.result(self.start(**environment))
        return self.verdict(in_a_copy(PROGRAM, str(self.place), str(Path(__file__).parent), folder=self.cache))

    @classmethod
    def result(cls, process: subprocess.Popen[str]) -> bool:
        out, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
        return cls.verdict(out)

    @staticmethod
    def verdict(out: str) -> bool:
        answer = json.loads(out.splitlines()[-1])
        assert answer["right"] and len(answer["cached"]) == 1
        return answer["cached"][0]


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path)


EDITS = {
    "the method itself": ("formulas", "super().force(x) + drag(x)", "super().force(x) - drag(x)"),
    "a method of the base class": ("formulas", "return x * self.gain", "return x / self.gain"),
    "a property": ("formulas", "return 2.0 * self.k", "return 2.5 * self.k"),
    "a static method": ("formulas", "min(x, 10.0)", "min(x, 1.0)"),
    "a class attribute": ("formulas", "gain = 1.25", "gain = 1.5"),
    "a static field": ("formulas", "order: int = 3", "order: int = 2"),
    "a closure's value": ("formulas", "scaled(2.0)", "scaled(4.0)"),
    "a closure's code": ("formulas", "factor * x", "factor + x"),
    "a function of another module": ("helper", "sign * power * x", "power * x"),
    "a default": ("helper", "power=2.0", "power=2.25"),
    "a default of a keyword": ("helper", "sign=-1.0", "sign=1.0"),
    "a constant, reached as module.name": ("helper", "RATE = 0.5", "RATE = 0.25"),
    "a tuple": ("helper", "(1.0, 2.0, 3.0)", "(1.0, 2.0, 3.5)"),
    "an attribute of another class": ("helper", "depth = 2.0", "depth = 3.0"),
    "an attribute of an object": ("helper", "Knob(1.5)", "Knob(1.75)"),
}
"""Each is reached by the formula, each in its own way."""


@pytest.mark.slow
def test_found_by_the_next_process_and_missed_after_every_edit_that_matters(project: Project) -> None:
    assert [project.hits(), project.hits()] == [False, True]
    for what, (file, old, new) in EDITS.items():
        project.edit(file, old, new)
        assert not project.hits(), f"stale code was run after an edit of {what}"
    objects = list(project.cache.glob("*.o"))
    assert len(objects) == cache.VARIANTS < len(EDITS)  # the last ones used
    assert all(500 < f.stat().st_size < 40_000 for f in objects)
    assert Project.result(project.start()), "a new Python found nothing of what the others have made"


def test_found_after_edits_that_do_not_matter(project: Project) -> None:
    assert not project.hits()
    project.edit("formulas", "# a remark", "# another remark")
    project.edit("formulas", '"""What it does."""', '"""What it has always done."""')
    project.edit("formulas", "def scaled", "\n\n\n# lines move\ndef scaled")
    project.edit("helper", "return x + 1.0", "return x + 2.0")
    project.edit("helper", "def unrelated", "def another(x):\n    return x\n\n\ndef unrelated")
    assert project.hits()


@pytest.mark.slow
def test_numbers_known_at_run_time_share_the_code(project: Project) -> None:
    """Only what is static belongs to the key: a body with another inertia needs no compiler."""
    program = """
import liemech as lm, numpy as np
from liemech.compiler import kernel
from liemech.simulation.compiled.driver import advance
for moments in ([1.0, 1.5, 2.0], [3.0, 2.5, 2.0]):
    body = lm.RigidBody(moments)
    lm.integrate(body, lm.RKMK(order=4), body.state(mu=[0.5, 0.0, 0.5]), h=0.1, steps=3, compiled=True)
print(sum(k.entry is advance for k in kernel.alive()))
"""
    env = os.environ | {"LIEMECH_CACHE_DIR": str(project.cache)}
    run = subprocess.run(
        [sys.executable, "-c", program], env=env, capture_output=True, text=True, timeout=120, check=True
    )
    assert run.stdout.split() == ["1"]


@pytest.mark.slow
def test_many_processes_fill_one_empty_cache(project: Project) -> None:
    running = [project.start() for _ in range(4)]
    for process in running:
        Project.result(process)
    assert len(list(project.cache.glob("*.o"))) == 1
    assert not list(project.cache.glob("*.tmp"))
    assert project.hits()


@pytest.mark.slow
@pytest.mark.parametrize(
    "damage",
    [
        lambda code: b"",
        lambda code: code[: len(code) // 2],
        lambda code: code[:100] + b"\0" * 100 + code[200:],
        lambda code: b"no code",
    ],
    ids=["empty", "truncated", "corrupted", "something else"],
)
def test_damaged_files_are_made_again(project: Project, damage) -> None:
    project.hits()
    (file,) = project.cache.glob("*.o")
    file.write_bytes(damage(file.read_bytes()))
    assert [project.hits(), project.hits()] == [False, True]


def copy_of_the_package(place: Path) -> Path:
    """liemech.formulas in a place of its own, as an installation."""
    shutil.copytree(Path(liemech.__file__).parent, place / "liemech", ignore=shutil.ignore_patterns("__pycache__"))
    return place / "liemech" / "compiler" / "__pycache__"


@pytest.mark.slow
def test_an_installation_keeps_its_code_beside_itself_or_with_the_user_or_nowhere(
    project: Project, tmp_path: Path
) -> None:
    """A file where the folder should be is as bad as a disk that cannot be written, and stops even the super-user."""
    beside = copy_of_the_package(tmp_path / "site")
    user = tmp_path / "home"
    places = {
        "PYTHONPATH": str(tmp_path / "site"),
        "LIEMECH_CACHE_DIR": "",
        "XDG_CACHE_HOME": str(user),
        "HOME": str(user),
        "LOCALAPPDATA": str(user),
        "PYTHONDONTWRITEBYTECODE": "",
    }
    assert [project.hits(**places), project.hits(**places)] == [False, True]
    assert len(list(beside.glob("*.o"))) == 1 and not user.exists()

    for file in beside.glob("*"):
        file.unlink()
    beside.rmdir()
    beside.write_text("no folder")
    assert [project.hits(**places), project.hits(**places)] == [False, True]
    assert len(list(user.rglob("*.o"))) == 1

    shutil.rmtree(user)
    user.write_text("no folder either")
    assert [project.hits(**places), project.hits(**places)] == [False, False]


@pytest.mark.slow
def test_a_chosen_folder_is_used_and_no_other(project: Project, tmp_path: Path) -> None:
    project.hits(LIEMECH_CACHE_DIR=str(tmp_path / "a" / "b"))
    assert len(list((tmp_path / "a" / "b").glob("*.o"))) == 1 and not project.cache.exists()
    (tmp_path / "file").write_text("")
    # cannot be written: works, keeps nothing
    assert not project.hits(LIEMECH_CACHE_DIR=str(tmp_path / "file"))


# --- the folder and its files
# ----------------------------------------------------------------------------------------


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(cache, "folder", lambda: tmp_path)
    return tmp_path


def load(key: str) -> bytes | None:
    found = cache.load(key, lambda manifest: manifest)
    return found and found[1]


def test_what_was_not_used_for_the_longest_time_goes_first(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for i in range(6):
        cache.store(f"{i:02}", ["read"], bytes([i]) * 1000)
        os.utime(place / f"{i:02}-0.o", (i, i))
    assert load("00") == b"\0" * 1000  # used now
    monkeypatch.setattr(cache, "LIMIT", 5000)
    cache.store("06", ["read"], b"\6" * 1000)
    assert [i for i in range(7) if load(f"{i:02}")] == [0, 4, 5, 6]


def test_files_that_interrupted_processes_left_behind_go_after_an_hour(place: Path) -> None:
    for name, age in (("old.tmp", 4000.0), ("new.tmp", 10.0)):
        (place / name).write_bytes(b"half")
        os.utime(place / name, (time.time() - age,) * 2)
    cache.store("key", [], b"code")
    assert sorted(f.name for f in place.iterdir()) == ["key-0.o", "new.tmp"]


def test_several_codes_for_one_key_are_told_apart_by_what_they_read(place: Path) -> None:
    for i in range(cache.VARIANTS + 2):
        cache.store("key", [i], bytes([i]))
        os.utime(place / f"key-{min(i, cache.VARIANTS - 1)}.o", (i, i))
    cache.store("key", [cache.VARIANTS + 1], b"again")  # the same manifest: the same file
    found = {i: cache.load("key", lambda manifest, i=i: manifest == [i] or None) for i in range(cache.VARIANTS + 2)}
    assert sum(f is not None for f in found.values()) == cache.VARIANTS == len(list(place.iterdir()))
    assert found[cache.VARIANTS + 1] == (True, b"again")


@pytest.mark.skipif(os.name == "nt", reason="about users and links")
@pytest.mark.parametrize("swap", ["other key", "link"])
def test_a_file_in_the_place_of_another_is_a_miss(place: Path, tmp_path: Path, swap: str) -> None:
    cache.store("one", [], b"one")
    cache.store("two", [], b"two")
    (place / "one-0.o").unlink()
    if swap == "link":
        shutil.copy(place / "two-0.o", place / "elsewhere")
        (place / "two-0.o").rename(place / "kept")
        (place / "two-0.o").symlink_to(place / "kept")
        assert load("two") is None
    else:
        shutil.copy(place / "two-0.o", place / "one-0.o")
        assert load("one") is None and load("two") == b"two"


@pytest.mark.skipif(os.name == "nt", reason="about users and links")
def test_a_folder_that_others_can_write_or_own_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = tmp_path / "shared"
    monkeypatch.setenv("LIEMECH_CACHE_DIR", str(place))
    for mode, safe in ((0o700, True), (0o755, True), (0o775, False), (0o757, False), (0o777, False)):
        place.mkdir(exist_ok=True)
        place.chmod(mode)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            assert (cache.folder.__wrapped__() == place) == safe, oct(mode)
        assert [f"chmod 700 {place}" in str(w.message) for w in told] == [True] * (not safe)
    place.chmod(0o700)
    monkeypatch.setattr(os, "getuid", lambda: place.stat().st_uid + 1)
    with pytest.warns(RuntimeWarning, match="is not used: others may write to it or it is another"):
        assert cache.folder.__wrapped__() is None


def test_a_folder_that_was_named_and_cannot_be_used_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LIEMECH_CACHE_DIR", str(tmp_path / "file"))
    with pytest.warns(RuntimeWarning, match="every process compiles anew"):
        assert cache.folder.__wrapped__() is None
    monkeypatch.setenv("LIEMECH_CACHE_DIR", os.devnull)  # nowhere, as was wanted
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cache.folder.__wrapped__() is None


def test_a_compiler_edited_while_it_runs_keeps_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert cache.own_source.__wrapped__() is not None
    monkeypatch.setattr(cache, "IMPORTED", 0.0)
    assert cache.own_source.__wrapped__() is None


# --- edits while a process runs, and what only a process of its own can show
# -----------------------------------------

EDITED = """
import json, os, sys
from pathlib import Path
sys.path[:0] = sys.argv[1:3]
text, edit = Path(sys.argv[1], "edited.py"), json.loads(sys.argv[3])
import edited, worlds
from liemech.compiler import kernel
from liemech.errors import NotCompilable
if edit:
    text.write_text(text.read_text().replace(*edit))
rows = [[1.5, 2.0, 3.0, 4.0]]
try:
    found = worlds.native(edited.formula, rows, 2, 3, 1)
    right = found == [worlds.plain(edited.formula, rows[0], 3)]
    print(json.dumps([right, [k.cached for k in kernel.alive()][0]]))
except NotCompilable as error:
    print(json.dumps(["refused", "has changed" in str(error)]))
"""

EDITABLE = """
import enum, types
from decimal import Decimal
from fractions import Fraction
import elsewhere
from liemech.formulas import vec

class Empty:
    __slots__ = ()

class Slotted:
    __slots__ = ("x",)
    def __init__(self, x): self.x = x
    def of(self, y): return 1.5 * y

class Mode(enum.Enum):
    FAST = 2

    @property
    def factor(self): return 3.0 * self.value

E, S, F, D = Empty(), Slotted(2.5), Fraction(1, 3), Decimal("0.25")
BOX = types.SimpleNamespace(module=elsewhere)

def through(module):
    return lambda x: module.RATE * x

captured = through(elsewhere)

def formula(a, b, c, d, n, unused=0.125):
    twice = lambda x: 2.0 * x
    total = sum_of([3.0 * x for x in (a, b)])
    exact = float(F) + float(D) + S.x + Mode.FAST.factor
    return vec(twice(a) * exact + captured(b), total + S.of(c) + BOX.module.RATE + defaulted(d))

def sum_of(items):
    total = 0.0
    for x in items:
        total = total + x
    return total

def defaulted(x, k=4.5):
    return k * x
"""

IN_PLACE = {
    "a nested lambda": ["2.0 * x", "2.5 * x"],
    "a comprehension": ["[3.0 * x for", "[3.5 * x for"],
    "a default": ["k=4.5", "k=5.5"],
    "a constant of another type": ["total = 0.0", "total = 0"],
    "a fraction": ["Fraction(1, 3)", "Fraction(1, 7)"],
    "a decimal": ['Decimal("0.25")', 'Decimal("0.125")'],
    "a member of an enum": ["FAST = 2", "FAST = 5"],
    "a method of an enum": ["3.0 * self.value", "5.0 * self.value"],
    "a slot": ["Slotted(2.5)", "Slotted(3.5)"],
    "a method of an object with slots": ["1.5 * y", "1.75 * y"],
    "a module reached through a closure": [
        "captured = through(elsewhere)",
        "captured = through(types.SimpleNamespace(RATE=7.0))",
    ],
    "a module reached through an attribute": ["module=elsewhere", "module=types.SimpleNamespace(RATE=7.0)"],
}


QUICK = {"a nested lambda", "a default", "a slot", "a module reached through a closure"}
"""What is edited whenever the tests run; the others are slow, for each needs four processes."""


@pytest.mark.parametrize(
    "what", [what if what in QUICK else pytest.param(what, marks=pytest.mark.slow) for what in IN_PLACE]
)
def test_an_edit_while_the_process_runs_poisons_nothing(what: str, tmp_path: Path) -> None:
    """The process that was there before the edit runs what it has read, or refuses; the next one runs the new text."""
    (tmp_path / "edited.py").write_text(EDITABLE)
    (tmp_path / "elsewhere.py").write_text("RATE = 0.5\n")

    def run(edit: list[str] | None) -> list[bool | str]:
        arguments = str(tmp_path), str(Path(__file__).parent), json.dumps(edit)
        return json.loads(in_a_copy(EDITED, *arguments, folder=tmp_path / "cache"))

    assert EDITABLE.count(IN_PLACE[what][0]) == 1
    assert run(IN_PLACE[what]) in ([True, False], ["refused", True])
    assert run(None) == [True, False], "the code of the old text was stored for the new one"
    assert run(None) == [True, True]
    (tmp_path / "elsewhere.py").write_text("RATE = 0.25\n")
    if "module" not in what:
        assert run(None) == [True, False], "an edit of a module reached in another way was missed"


def test_a_global_of_a_script_that_has_the_name_of_an_attribute_is_no_miss(project: Project) -> None:
    assert not project.hits()
    path = project.place / "formulas.py"
    path.write_text(path.read_text() + "\n\nmore = stiff = gain = turn = depth = order = 12.0\n")
    assert project.hits()


@pytest.mark.slow
def test_another_global_in_the_process_finds_its_own_code_on_disk(project: Project) -> None:
    """Variants: two processes with different constants do not drive each other's code out."""
    texts = [("helper", "RATE = 0.5", "RATE = 0.75"), ("helper", "RATE = 0.75", "RATE = 0.5")]
    assert not project.hits()
    project.edit(*texts[0])
    assert not project.hits()
    project.edit(*texts[1])
    assert project.hits()
    project.edit(*texts[0])
    assert project.hits()
