"""The disk cache: found by the next process, missed after every edit that matters and no other, hard to break."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import liemech
from liemech.compiler import cache
from liemech.compiler.source import fingerprint

pytestmark = pytest.mark.compiled

HELPER = '''
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
'''

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

PROGRAM = '''
import json, sys
sys.path[:0] = sys.argv[1:]
import formulas, worlds
from liemech.compiler import kernel
rows = [[1.0, 2.0, 3.0, 4.0], [-1.0, 0.5, 0.25, 8.0]]
found = worlds.native(formulas.formula, rows, 2, 3, 1)
right = [worlds.plain(formulas.formula, row, 3) for row in rows]
print(json.dumps({"cached": [k.cached for k in kernel.alive()], "right": found == right}))
'''


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
        return subprocess.Popen(command, cwd=self.place, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def hits(self, **environment: str) -> bool:
        """Run the formula in a new process: was its code found?  The result is right in any case."""
        return self.result(self.start(**environment))

    @staticmethod
    def result(process: subprocess.Popen[str]) -> bool:
        out, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
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


def test_found_by_the_next_process_and_missed_after_every_edit_that_matters(project: Project) -> None:
    assert [project.hits(), project.hits()] == [False, True]
    for what, (file, old, new) in EDITS.items():
        project.edit(file, old, new)
        assert not project.hits(), f"stale code was run after an edit of {what}"
    objects = list(project.cache.glob("*.o"))
    assert len(objects) == 1 + len(EDITS)
    assert all(500 < f.stat().st_size < 20_000 for f in objects)


def test_found_after_edits_that_do_not_matter(project: Project) -> None:
    assert not project.hits()
    project.edit("formulas", "# a remark", "# another remark")
    project.edit("formulas", '"""What it does."""', '"""What it has always done."""')
    project.edit("formulas", "def scaled", "\n\n\n# lines move\ndef scaled")
    project.edit("helper", "return x + 1.0", "return x + 2.0")
    project.edit("helper", "def unrelated", "def another(x):\n    return x\n\n\ndef unrelated")
    assert project.hits()


def test_numbers_known_at_run_time_share_the_code(project: Project) -> None:
    """Only what is static belongs to the key: a body with another inertia needs no compiler."""
    program = """
import liemech as lm, numpy as np
from liemech.compiler import kernel
from liemech.marching import march
for moments in ([1.0, 1.5, 2.0], [3.0, 2.5, 2.0]):
    body = lm.RigidBody(moments)
    lm.integrate(body, lm.RKMK(order=4), body.state(mu=[0.5, 0.0, 0.5]), h=0.1, steps=3, compiled=True)
print(sum(k.entry is march for k in kernel.alive()))
"""
    env = os.environ | {"LIEMECH_CACHE_DIR": str(project.cache)}
    run = subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True, timeout=120, check=True)
    assert run.stdout.split() == ["1"]


def test_many_processes_fill_one_empty_cache(project: Project) -> None:
    running = [project.start() for _ in range(6)]
    for process in running:
        Project.result(process)
    assert len(list(project.cache.glob("*.o"))) == 1
    assert not list(project.cache.glob("*.tmp"))
    assert project.hits()


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


def test_an_installation_keeps_its_code_beside_itself_or_with_the_user_or_nowhere(project: Project, tmp_path: Path) -> None:
    """A file where the folder should be is as bad as a disk that cannot be written, and stops even the super-user."""
    beside = copy_of_the_package(tmp_path / "site")
    user = tmp_path / "home"
    places = {
        "PYTHONPATH": str(tmp_path / "site"),
        "LIEMECH_CACHE_DIR": "",
        "XDG_CACHE_HOME": str(user),
        "HOME": str(user),
        "LOCALAPPDATA": str(user),
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


def test_a_chosen_folder_is_used_and_no_other(project: Project, tmp_path: Path) -> None:
    project.hits(LIEMECH_CACHE_DIR=str(tmp_path / "a" / "b"))
    assert len(list((tmp_path / "a" / "b").glob("*.o"))) == 1 and not project.cache.exists()
    (tmp_path / "file").write_text("")
    assert not project.hits(LIEMECH_CACHE_DIR=str(tmp_path / "file"))  # cannot be written: works, keeps nothing


def test_the_cache_does_not_grow_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "folder", lambda: tmp_path)
    monkeypatch.setattr(cache, "KEEP", 5)
    for i in range(12):
        cache.store(f"{i:02}", bytes([i]))
        os.utime(tmp_path / f"{i:02}.o", (i, i))
    assert [cache.load(f"{i:02}") for i in range(12)] == [None] * 7 + [bytes([i]) for i in range(7, 12)]


def test_keys_do_not_collide() -> None:
    """What looks alike when written one after the other is not alike."""
    row, other = (1.0, 2.0), (3.0, 4.0)
    things = [
        ((1, 23),), ((12, 3),), ((1,), 23), (("1", "23"),), (("12", "3"),), ((1.0, 23),), (0.0,), (-0.0,), (0,), (False,), (None,),
        ((row, other, row),), ((row, other, other),), ((row, (other, row)),), ([1, 23],), (b"1", "23"), ("b'1'", "23"),
        (float("nan"),), (1e400,),
    ]  # fmt: skip
    keys = [fingerprint(*t) for t in things]
    assert len(set(keys)) == len(things)
    assert keys == [fingerprint(*t) for t in things]
