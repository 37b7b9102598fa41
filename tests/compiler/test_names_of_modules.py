"""What an ordinary user edits between two runs is seen by the next one, whatever it is called."""

from __future__ import annotations

import linecache
import types
from typing import Any

import numpy as np
import pytest

import liemech as lm

pytestmark = pytest.mark.compiled

SOURCE = """
import liemech as lm
from liemech.formulas import dot, vec

_0 = 1.0
__1__ = 1.0
_args = 1.0
_values = 1.0
_v3 = 1.0
k = 1.0


def tilt(t, power=1.0):
    return power * (1.0 + t)


class Base(lm.LinearGroupEquation):
    factor = 1.0

    def scaled(self, t):
        return self.factor * (2.0 - t)


@lm.record
class Turning(Base):
    def drive(self, t):
        a = dot(vec(_0, __1__, k), vec(tilt(t), self.scaled(t), 1.0))
        return vec(a, 0.3 * _args + 0.2 * _values, 0.4 * _v3)
"""


def made() -> Any:
    """A module like a notebook's."""
    module = types.ModuleType("notebook_of_names")
    module.__file__ = "notebook_of_names.py"
    linecache.cache[module.__file__] = (len(SOURCE), None, SOURCE.splitlines(True), module.__file__)
    exec(compile(SOURCE, module.__file__, "exec"), vars(module))
    return module


def louder(self: Any, t: Any) -> Any:
    return 5.0 - t


def still(self: Any, t: Any) -> Any:
    return 0.5


EDITS = {
    "a name with one underscore": lambda m: setattr(m, "_0", 2.0),
    "a name with two": lambda m: setattr(m, "__1__", 2.0),
    "a name like an argument": lambda m: setattr(m, "_args", 2.0),
    "a name like a value": lambda m: setattr(m, "_v3", 2.0),
    "by the dict": lambda m: vars(m).__setitem__("k", 2.0),
    "a subclass hides it": lambda m: setattr(m.Turning, "factor", 4.0),
    "a method of a base class": lambda m: setattr(m.Base, "scaled", louder),
    "a subclass gets a method": lambda m: setattr(m.Turning, "scaled", still),
    "an imported function": lambda m: setattr(m, "dot", lambda a, b: a[0] * b[0]),
}


@pytest.mark.slow
def test_every_edit_counts_in_the_next_run_and_the_next_step() -> None:
    module = made()
    system = module.Turning(lm.SO3())
    start = system.state(np.eye(3))
    native, plain = (lm.Plan(system, lm.RKMK(order=1), 0.1, compiled=compiled) for compiled in (True, False))
    before = native.run(start, steps=2).g
    for name, edit in EDITS.items():
        edit(module)
        run = native.run(start, steps=2)
        assert np.array_equal(run.g, plain.run(start, steps=2).g), name
        assert np.array_equal(native.step(native.begin(start), 2).state.g, run.last.g), name
        assert not np.array_equal(run.g, before), name
        before = run.g
