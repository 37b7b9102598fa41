"""The public names: one list of them, the page that explains them, and what a name says that is asked
for in a place where it is not.
"""

from __future__ import annotations

import functools
import importlib.util
import inspect
import re
import subprocess
import sys
import types
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

import liemech as lm
from liemech import names
from liemech.names.places import CLASSES, class_of, moved, place_of

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
SPACES = [name for name, home in names.listed("liemech").items() if home in names.OF_SPACES]
APART = {"errors", "formulas", "neighbours", "plots", "tableaus", "viewer"}


def page() -> Any:
    """The program that writes the page."""
    spec = importlib.util.spec_from_file_location("names_page", DOCS / "site" / "names.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_of_names_is_that_of_the_list() -> None:
    text = (DOCS / "names.md").read_text(encoding="utf-8")
    assert page().page() == text, "run: python docs/site/names.py"
    rows = re.findall(r"^\| `(lm\.[\w.]+)` \| (.+) \| \[.+\]\(([\w/]+)\.md(#[\w-]+)?\) \|$", text, re.M)
    listed = {f for f in names.public().values() if f.split(".")[1] not in APART}
    assert {row[0] for row in rows} == listed and len(rows) == len(listed)
    for full, about, where, _ in rows:
        assert len(about) > 10, full
        name = full.rpartition(".")[2]
        assert re.search(rf"\b{name}\b", (DOCS / f"{where}.md").read_text(encoding="utf-8")), full


def test_every_public_name_is_there_and_has_one_place() -> None:
    assert set(lm.__all__) == set(names.listed("liemech"))
    inner = [n for space in set(SPACES) - APART for n in names.members(space)]
    assert all(count == 1 for count in Counter([*lm.__all__, *inner]).values())
    things = names.everything()
    assert set(things) == set(names.public())
    for name, full in names.public().items():
        thing = things[name]
        assert eval(full, {"lm": lm}) is thing
        if inspect.isclass(thing) and thing.__module__.startswith("liemech"):
            assert thing.__name__ == name, "one name for one thing"


def test_a_namespace_shows_its_names_and_no_others() -> None:
    for space in set(SPACES) - APART:
        module = getattr(lm, space)
        shown = {name for name in dir(module) if not name.startswith("__")}
        assert shown == set(module.__all__) == set(names.members(space))
        assert not any(isinstance(getattr(module, name), types.ModuleType) for name in shown)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("lm.HeavyTop", "lm.HeavyTop is lm.models.HeavyTop"),
        ("lm.models.RigidBody", "lm.models.RigidBody is lm.RigidBody"),
        ("lm.joints.HeavyTop", "lm.joints.HeavyTop is lm.models.HeavyTop"),
        ("lm.ButcherTableau", "lm.ButcherTableau is lm.tableaus.ButcherTableau"),
        ("lm.NoConvergence", "lm.NoConvergence is lm.errors.NoConvergence"),
        ("lm.FixedPoint", "lm.FixedPoint is lm.joints.BallJoint(body, None, at, point)"),
        ("lm.Straight", "lm.Straight is lm.parts.StraightLineFlow"),
        ("lm.models.heavytop", "Did you mean lm.models.HeavyTop?"),
        ("lm.RigidBodi", "Did you mean lm.RigidBody?"),
    ],
)
def test_a_name_in_another_place_says_where_it_is(asked: str, words: str) -> None:
    with pytest.raises(AttributeError, match=re.escape(words)):
        eval(asked, {"lm": lm})


def test_a_name_that_is_imported_from_another_place_says_where_it_is() -> None:
    with pytest.raises(ImportError, match=r"lm\.HeavyTop is lm\.models\.HeavyTop"):
        exec("from liemech import HeavyTop")
    with pytest.raises(ImportError, match="cannot import name 'zzzzzz'"):
        exec("from liemech import zzzzzz")
    exec("from liemech import errors, solvers\nfrom liemech.models import HeavyTop")


def test_what_stands_for_former_names_is_there() -> None:
    for name, now in names.FORMER.items():
        assert name not in names.public()
        path = re.search(r"lm(\.\w+)+", now)
        assert path is not None and eval(path[0], {"lm": lm}) is not None


def test_tools_that_look_for_names_of_their_own_load_nothing() -> None:
    code = (
        "import sys, liemech\n"
        "before = set(sys.modules)\n"
        "for name in ('__wrapped__', '_ipython_display_', '__path'): assert not hasattr(liemech, name)\n"
        "liemech.__all__, dir(liemech)\n"
        "assert set(sys.modules) == before\n"
        "liemech.models.HeavyTop\n"
        "assert 'liemech.models.planets.planetary_system' not in sys.modules\n"
        "assert 'liemech.simulation.integrate' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT, timeout=120)


def test_public_names_stay() -> None:
    """Names of November 2026; one that has to go is made to work with a warning, and stays in the list."""
    known = (Path(__file__).parent / "public_names.txt").read_text(encoding="utf-8").split()
    assert len(known) > 500
    gone = [
        name
        for name in known
        if functools.reduce(lambda x, part: getattr(x, part, None), name.split(".")[1:], lm) is None
    ]
    assert not gone, f"public names that are no longer there: {gone}"


FORMER = ("integrators.lie_rattle", "systems.constrained_body", "models.joints", "simulation.sites.run", "retractions")


@pytest.mark.parametrize("module", FORMER)
def test_modules_are_found_by_their_former_names(module: str) -> None:
    name = f"liemech.{module}"
    sys.modules.pop(name, None)
    with pytest.warns(DeprecationWarning, match=place_of(name)):
        found = importlib.import_module(name)
    assert found is importlib.import_module(place_of(name))


def test_every_module_that_moved_is_where_the_table_says() -> None:
    places = [place_of(f"liemech.{former}") for former in moved()]
    assert len(places) > 200
    lost = [name for name in places if importlib.util.find_spec(name) is None]
    assert not lost


def test_every_class_that_moved_is_where_the_table_says() -> None:
    """A file of last year names both by what they were called: the module, and the class in it."""
    assert class_of("liemech.models.lotka_volterra:Species") == "liemech.models.lattices.lotka_volterra:SpeciesEnergy"
    assert class_of("elsewhere.models:Species") == "elsewhere.models:Species"
    for former, today in CLASSES.items():
        module, _, name = class_of(f"liemech.{former}").partition(":")
        assert f"{module}:{name}" == f"liemech.{today}"
        assert isinstance(getattr(importlib.import_module(module), name), type)


def test_finders_of_other_packages_stay() -> None:
    """Whatever their classes are called; and a library that is imported anew has one finder."""
    program = """
import importlib, sys
class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None): return None
sys.meta_path.append(foreign := Finder())
import liemech
for name in [name for name in sys.modules if name.partition(".")[0] == "liemech"]: del sys.modules[name]
importlib.import_module("liemech")
assert foreign in sys.meta_path
assert [type(x).__module__ for x in sys.meta_path].count("liemech.names.finder") == 1
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
