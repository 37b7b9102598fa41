"""The quick comparison of what native code was made of sees every change that the slow one sees."""

from __future__ import annotations

import contextlib
import functools
import types
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.compiler.changes.content_hashes import Known, digest
from liemech.compiler.changes.dependencies import Reads
from liemech.compiler.changes.staleness import Guard, Step, value_read

TEXT = """
import functools

K, _values, DEFAULT = 1.5, 2.5, 3.5


class Above:
    gain = 1.25

    @functools.cached_property
    def table(self):
        return 1.0


class Base(Above):
    def method(self):
        return 1.0


class Child(Base):
    def method(self):
        return super().method()


def formula(x=1.0, *, y=2.0):
    return len(x)


def made():
    k = 1.0

    def inner():
        return k

    def change(value):
        nonlocal k
        k = value

    return inner, change


inner, change = made()
"""

PATHS: tuple[Step, ...] = (
    (-1, "entry", 0),
    (0, "attribute", "__code__"),
    (0, "attribute", "__defaults__"),
    (0, "global", "K"),
    (0, "global", "_values"),
    (0, "global", "len"),
    (0, "global", "inner"),
    (6, "cell", "k"),
    (0, "global", "Child"),
    (8, "member 0", "method"),
    (8, "member 1", "method"),
    (8, "member 0", "gain"),
    (8, "member 0", "table"),
    (8, "has", "late"),
)


def guarded(paths: tuple[Step, ...] = PATHS) -> tuple[Any, Guard]:
    """A module, and the guard of these reads in it."""
    module = types.ModuleType("guarded")
    exec(TEXT, vars(module))
    values: list[Any] = []
    for parent, how, name in paths:
        values.append(value_read(values[parent] if parent >= 0 else (vars(module)["formula"], ()), how, name))
    known: Known = {}
    return module, Guard(list(paths), values, ["", *[digest(x, known) for x in values[1:]]], known)


def quick(guard: Guard, args: Any = ()) -> bool:
    words, expressions = guard.glance or (None, ())
    return words is not None and words.same() and all(h(args, guard.values) for h in expressions)


def other_code(m: Any) -> None:
    m.formula.__code__ = (lambda x=1.0, *, y=2.0: 2.0 * x).__code__


CHANGES: dict[str, Callable[[Any], Any]] = {
    "code": other_code,
    "default": lambda m: setattr(m.formula, "__defaults__", (2.0,)),
    "global": lambda m: setattr(m, "K", 1.75),
    "deleted global": lambda m: delattr(m, "K"),
    "global by one bit": lambda m: setattr(m, "K", 1.5000000000000002),
    "global of the guard's own names": lambda m: setattr(m, "_values", 7.0),
    "hidden builtin": lambda m: setattr(m, "len", abs),
    "cell": lambda m: m.change(2.0),
    "method": lambda m: setattr(m.Child, "method", lambda self: 2.0),
    "method above": lambda m: setattr(m.Base, "method", lambda self: 2.0),
    "class attribute": lambda m: setattr(m.Above, "gain", 3.0),
    "class attribute hidden": lambda m: setattr(m.Base, "gain", 3.0),
    "cached property": lambda m: setattr(m.Above, "table", functools.cached_property(lambda self: 2.0)),
    "cached property hidden": lambda m: setattr(m.Child, "table", 2.0),
    "bases": lambda m: setattr(
        m.Child, "__bases__", (type("Base", (), {"method": m.Base.method, "gain": 2.0, "table": 1.0}),)
    ),
    "late attribute": lambda m: setattr(m.Child, "late", 1.0),
}


@pytest.mark.parametrize("what", CHANGES)
def test_every_change_is_seen(what: str) -> None:
    module, guard = guarded()
    assert guard.verdict(()) is True
    CHANGES[what](module)
    with contextlib.suppress(NameError, AttributeError):
        assert not quick(guard)
    assert guard.verdict(()) is not True


def test_the_quick_comparison_is_the_one_that_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    paths = tuple((parent, how, "DEFAULT" if name == "_values" else name) for parent, how, name in PATHS)
    _, guard = guarded(paths)
    assert guard.verdict(()) is True  # asked one by one, and from then on by words
    monkeypatch.setattr(Guard, "_by_parts", lambda *_: pytest.fail("asked one by one"))
    assert guard.verdict(()) is True


def test_equal_objects_made_anew_are_the_same() -> None:
    module, guard = guarded()
    assert guard.verdict(()) is True and quick(guard)
    module.K = float("1.5")
    assert not quick(guard)
    assert guard.verdict(()) is True


def test_parts_of_arguments_are_compared_by_their_tokens() -> None:
    """Another argument with the same numbers passes, and from then on at once; one with others does not."""
    first, equal, other = (types.SimpleNamespace(b=(0.5, float(x))) for x in ("0.5", "0.5", "0.25"))
    paths: tuple[Step, ...] = ((-1, "argument", 0), (0, "attribute", "b"))
    guard = Guard(list(paths), [first, first.b], ["", digest(first.b)], {})
    assert guard.verdict((first,)) is True and quick(guard, (first,))
    assert not quick(guard, (equal,)) and guard.verdict((equal,)) is True
    assert quick(guard, (equal,))
    assert not guard.verdict((other,))
    assert guard.verdict((types.SimpleNamespace(),)) is False


@pytest.mark.compiled
def test_equal_systems_take_turns_without_a_comparison_of_all_that_was_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two tops that share native code: each run of one had every path followed anew, for
    milliseconds, after one of the other.
    """
    plans = []
    for _ in range(2):
        top = lm.models.HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8])
        plans.append((lm.Plan(top, lm.RKMK(order=4), 0.01, compiled=True), top.state([0.1, 0.2, 1.0], np.eye(3))))
    first = [[plan.run(start, steps=3).mu for plan, start in plans] for _ in range(2)]
    monkeypatch.setattr(Reads, "_values_from", None)  # whoever follows paths now fails
    again = [plan.run(start, steps=3).mu for plan, start in plans]
    assert all(np.array_equal(x, y) for x, y in zip(first[0], again, strict=True))
