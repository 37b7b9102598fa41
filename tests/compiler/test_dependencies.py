"""What a compiled formula read from outside is honoured when it changes: in this process, at any length of run."""

from __future__ import annotations

import enum
import types
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import worlds

import liemech as lm
from liemech.compiler import kept, kernel
from liemech.compiler.changes import content_hashes
from liemech.errors import NotCompilable
from liemech.groups.composed.product import ProductAlgebra
from liemech.groups.rigid.so3 import SO3Algebra
from liemech.simulation.compiled import execution

pytestmark = pytest.mark.compiled

OTHER = """
RATE = 0.5

class Settings:
    depth = 2.0

def helper(x, power=2.0, *, sign=1.0):
    return sign * power * x
"""

MODULE = """
import math
from functools import cached_property
import numpy as np
import other
from other import Settings, helper
from liemech.formulas import Record, Vec, record, vec

K = 1.5
ROW = [1.0, 2.0]
TABLE = {"a": 1.0, "b": 2.0}
NESTED = ([1.0], {"x": [2.0]})
ARRAY = np.array([1.0, 2.0, 3.0])
FUNCTIONS = [helper]


class Knob:
    turn = 1.0
    __slots__ = ("own",)

    def __init__(self, own):
        self.own = own

    def turned(self, x):
        return x * self.own + self.turn

    @property
    def half(self):
        return 0.5 * self.own


KNOB = Knob(1.5)


def make(factor):
    def inner(x):
        return factor * x
    def change(value):
        nonlocal factor
        factor = value
    return inner, change


inner, change = make(2.0)


@record
class Base(Record):
    k: float
    gain = 1.25

    @property
    def stiff(self):
        return 2.0 * self.k

    @cached_property
    def table(self):
        return tuple(np.array([K, 2.0 * K]).tolist())

    @staticmethod
    def fixed(x):
        return x + 1.0

    @classmethod
    def of_class(cls, x):
        return cls.gain * x

    def method(self, x):
        return self.k * x


@record
class Child(Base):
    extra: float = 3.0

    def more(self, x):
        return super().method(x)


CHILD = Child(2.0)


def use_global(a, b, c, d, n):
    return vec(K * a, b)
def use_module(a, b, c, d, n):
    return vec(other.RATE * a, b)
def use_list(a, b, c, d, n):
    return vec(ROW[1] * a, b)
def use_dict(a, b, c, d, n):
    return vec(TABLE["b"] * a, b)
def use_nested(a, b, c, d, n):
    return vec(NESTED[1]["x"][0] * a, NESTED[0][0] * b)
def use_array(a, b, c, d, n):
    return vec(float(ARRAY[1]) * a, b)
def use_class(a, b, c, d, n):
    return vec(Settings.depth * a, b)
def use_cell(a, b, c, d, n):
    return vec(inner(a), b)
def use_helper(a, b, c, d, n):
    return vec(helper(a), other.helper(b))
def use_in_list(a, b, c, d, n):
    return vec(FUNCTIONS[0](a), b)
def use_object(a, b, c, d, n):
    return vec(KNOB.turned(a) + KNOB.half, b)
def use_record(a, b, c, d, n):
    return vec(CHILD.stiff * a + CHILD.gain, CHILD.more(b) + CHILD.of_class(a) + CHILD.fixed(b))
def use_made(a, b, c, d, n):
    return vec(Child(a).stiff, Child(b).extra)
def use_builtin(a, b, c, d, n):
    return vec(abs(a), math.tau * b)
def use_hasattr(a, b, c, d, n):
    return vec(a if hasattr(CHILD, "late") else 2.0 * a, getattr(CHILD, "later", 3.0) * b)
def use_type(a, b, c, d, n):
    return vec(a * (2.0 if isinstance(CHILD, Base) else 3.0), b * type(CHILD).gain)
"""


@pytest.fixture
def world(tmp_path: Path) -> types.SimpleNamespace:
    other = worlds.module_from(OTHER, tmp_path, "other")
    module = worlds.module_from(MODULE, tmp_path, "reading")
    return types.SimpleNamespace(m=module, other=other)


def replaced(x, power=3.0, *, sign=1.0):
    return sign * power * x + 1.0


def assign(holder: str, name: str, value: Any) -> Callable[[Any], None]:
    def change(w: Any) -> None:
        target = w
        for part in holder.split("."):
            target = getattr(target, part)
        setattr(target, name, value)

    return change


def other_defaults(w: Any) -> None:
    w.m.helper.__defaults__ = (5.0,)


def other_keyword(w: Any) -> None:
    w.m.helper.__kwdefaults__["sign"] = -1.0


def other_code(w: Any) -> None:
    w.m.helper.__code__ = replaced.__code__


CHANGES: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "a global": ("use_global", assign("m", "K", 2.5)),
    "a global by one bit": ("use_global", assign("m", "K", 1.5000000000000002)),
    "an int for a float": ("use_global", assign("m", "K", 7)),
    "a global of another module": ("use_module", assign("other", "RATE", 0.25)),
    "another module": ("use_module", assign("m", "other", types.SimpleNamespace(RATE=9.0))),
    "an element of a list": ("use_list", lambda w: w.m.ROW.__setitem__(1, 7.0)),
    "a list": ("use_list", assign("m", "ROW", (3.0, 4.0))),
    "a value of a dict": ("use_dict", lambda w: w.m.TABLE.update(b=5.0)),
    "a list in a dict in a tuple": ("use_nested", lambda w: w.m.NESTED[1]["x"].__setitem__(0, 5.0)),
    "an array in place": ("use_array", lambda w: w.m.ARRAY.__setitem__(1, 9.0)),
    "another array": ("use_array", assign("m", "ARRAY", np.array([4.0, 5.0, 6.0]))),
    "a class attribute": ("use_class", assign("m.Settings", "depth", 3.0)),
    "another class": ("use_class", assign("m", "Settings", type("Settings", (), {"depth": 4.0}))),
    "a closure cell": ("use_cell", lambda w: w.m.change(5.0)),
    "a helper": ("use_helper", assign("m", "helper", replaced)),
    "a helper in its module": ("use_helper", assign("other", "helper", replaced)),
    "the code of a helper": ("use_helper", other_code),
    "a default": ("use_helper", other_defaults),
    "a default of a keyword": ("use_helper", other_keyword),
    "a function in a list": ("use_in_list", lambda w: w.m.FUNCTIONS.__setitem__(0, replaced)),
    "a function in a list, of the same code": ("use_in_list", lambda w: w.m.FUNCTIONS.__setitem__(0, w.m.make(7.0)[0])),
    "a slot of an object": ("use_object", assign("m.KNOB", "own", 2.5)),
    "another object of the class": ("use_object", lambda w: setattr(w.m, "KNOB", w.m.Knob(4.0))),
    "a class attribute of an object": ("use_object", assign("m.Knob", "turn", 4.0)),
    "a method of an object's class": ("use_object", assign("m.Knob", "turned", lambda self, x: x - self.own)),
    "a property of an object's class": ("use_object", assign("m.Knob", "half", property(lambda self: 0.25 * self.own))),
    "a method of a base class": ("use_record", assign("m.Base", "method", lambda self, x: x - self.k)),
    "an override in a subclass": ("use_record", assign("m.Child", "gain", 9.0)),
    "a property overridden": ("use_record", assign("m.Child", "stiff", property(lambda self: 3.0 * self.k))),
    "a class method": ("use_record", assign("m.Base", "of_class", classmethod(lambda cls, x: x - cls.gain))),
    "a static method": ("use_record", assign("m.Base", "fixed", staticmethod(lambda x: x - 1.0))),
    "another record": ("use_record", lambda w: setattr(w.m, "CHILD", w.m.Child(5.0))),
    "a field of a record, by force": ("use_record", lambda w: object.__setattr__(w.m.CHILD, "k", 7.0)),
    "the class of a record that is made": (
        "use_made",
        lambda w: setattr(w.m.Child, "stiff", property(lambda self: 5.0 * self.k)),
    ),
    "a builtin hidden by a global": ("use_builtin", assign("m", "abs", lambda x: -x)),
    "a constant of math": ("use_builtin", assign("m", "math", types.SimpleNamespace(tau=7.0))),
    "an attribute that was not there": ("use_hasattr", assign("m.Child", "late", 1.0)),
    "a default of getattr": ("use_hasattr", assign("m.Base", "later", 1.0)),
    "a base class": ("use_type", assign("m", "Base", int)),
}


@pytest.mark.sample(10)
@pytest.mark.parametrize("what", CHANGES)
def test_a_change_is_seen_and_a_change_back_needs_no_compiler(what: str, world: Any) -> None:
    name, change = CHANGES[what]
    formula, rows = getattr(world.m, name), [[1.25, 2.5, 3.0, 4.0]] * 4
    if what == "a function in a list, of the same code":
        world.m.FUNCTIONS[0] = world.m.make(3.0)[0]
    before, lanes = worlds.plain(formula, rows[0], 3), 4 if what.startswith("another") else 1
    for _ in range(2):
        assert worlds.native(formula, rows, 2, 3, lanes) == [before] * 4
    made = len(kernel.alive())
    change(world)
    after = worlds.plain(formula, rows[0], 3)
    assert after != before, "the change should make a difference"
    assert worlds.native(formula, rows, 2, 3, lanes) == [after] * 4
    assert len(kernel.alive()) >= min(made + 1, kept.ALIVE)


def test_constants_that_come_and_go_are_compiled_once_each(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    # not what an earlier run of the tests has left
    monkeypatch.setattr("liemech.compiler.changes.cache.load", lambda *_: None)
    compiled: list[Any] = []
    translated = kernel._translated
    monkeypatch.setattr(kernel, "_translated", lambda *a: compiled.append(a) or translated(*a))
    for _ in range(3):
        for k in (11.5, 12.5, 13.5):
            world.m.K = float(k)
            found = worlds.native(world.m.use_global, [[2.0, 1.0, 0.0, 0.0]], 2, 3, 1)
            assert found == [[worlds.bits(k * 2.0), worlds.bits(1.0)]]
    assert len(compiled) == 3


def test_what_is_equal_is_not_compiled_again(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same functions and constants, made anew, as by a notebook's cell or importlib.reload."""
    row = [[2.0, 1.0, 0.0, 0.0]]
    for name in ("use_global", "use_helper", "use_list", "use_object", "use_array"):
        worlds.native(getattr(world.m, name), row, 2, 3, 1)
    monkeypatch.setattr(kernel, "_translated", lambda *_: pytest.fail("translated again"))
    world.m.K = float("1.5")
    exec(compile(OTHER, world.other.__file__, "exec"), vars(world.other))
    world.m.helper = world.other.helper
    world.m.ROW = [1.0, 2.0]
    world.m.ARRAY = np.array([1.0, 2.0, 3.0])
    world.m.KNOB = world.m.Knob(1.5)
    for name in ("use_global", "use_helper", "use_list", "use_object", "use_array"):
        worlds.native(getattr(world.m, name), row, 2, 3, 1)


# --- whole runs
# ------------------------------------------------------------------------------------------------------

STRENGTH = 1.0
SCALE = 1.0


@lm.record
class Twisted(lm.Hamiltonian):
    inertia: lm.Vec

    def energy(self, mu):
        return 0.5 * STRENGTH * lm.dot(mu, mu / self.inertia)


@lm.record
class Scaled(lm.Hamiltonian):
    inertia: lm.Vec

    @property
    def weight(self):
        return SCALE

    def energy(self, mu):
        return 0.5 * self.weight * lm.dot(mu, mu / self.inertia)


def final(hamiltonian: Any, many: bool, compiled: bool | None, **how: Any) -> bytes:
    system = lm.LiePoissonSystem(lm.SO3(), hamiltonian([1.0, 2.0, 3.0]))
    mu = [[0.5, 0.25, 0.75], [0.1, 0.2, 0.3]] if many else [0.5, 0.25, 0.75]
    run = lm.integrate(system, how.pop("method", lm.RKMK(order=4)), system.state(mu=mu), compiled=compiled, **how)
    return np.asarray(run.mu)[-1].tobytes()


RUNS = {"short": {"h": 0.1, "steps": 20}, "long": {"h": 0.1, "steps": 400, "every": 400}}


@pytest.mark.slow
@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("what", ["short", "long"])
def test_runs_in_a_loop_over_a_global(what: str, many: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    # also where nothing is said, native code is made in the middle of a long run
    monkeypatch.setattr(execution, "WAIT", 0.05)
    for value in (1.0, 2.0, 1.0):
        monkeypatch.setitem(globals(), "STRENGTH", value)
        monkeypatch.setitem(globals(), "SCALE", value)
        for hamiltonian in (Twisted, Scaled):
            plain = final(hamiltonian, many, False, **RUNS[what])
            assert plain == final(hamiltonian, many, True, **RUNS[what]) == final(hamiltonian, many, None, **RUNS[what])


def test_public_functions_of_many_rows_see_a_global(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.random.default_rng(1).normal(size=(600, 3))
    body = Twisted([1.0, 2.0, 3.0])
    for value in (1.0, 5.0, 1.0):
        monkeypatch.setitem(globals(), "STRENGTH", value)
        assert np.array_equal(body.energy(rows), [body.energy(row) for row in rows])


def test_constants_that_numpy_computes_are_those_of_the_instance(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A cached property keeps what it has in plain Python, and a new instance computes anew; so does native code."""
    text = """
import functools
import numpy as np
import liemech as lm
FACTOR = 1.0
@lm.record
class Tabulated(lm.Hamiltonian):
    inertia: lm.Vec
    order: int = 2
    @functools.cached_property
    def weights(self):
        return tuple((FACTOR * np.arange(1.0, 1.0 + self.order)).tolist())
    @functools.cached_property
    def trace(self):
        return 2.0 * (self.inertia[0] + self.inertia[1] + self.inertia[2])
    def energy(self, mu):
        return 0.5 * self.weights[1] * lm.dot(mu, mu / self.inertia) + mu[0] * self.trace
"""
    module = worlds.module_from(text, tmp_path, "tabulated")

    def both(body: Any) -> bytes:
        system = lm.LiePoissonSystem(lm.SO3(), body)
        start = system.state(mu=[0.5, 0.25, 0.75])
        ends = [
            lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=5, compiled=c).mu.tobytes()
            for c in (False, True)
        ]
        assert ends[0] == ends[1]
        return ends[1]

    first = module.Tabulated([1.0, 2.0, 3.0])
    old = both(first)
    module.FACTOR = 2.0
    second = module.Tabulated([1.0, 2.0, 3.0])
    new = both(second)
    assert old != new
    assert both(first) == old and both(second) == new
    assert both(module.Tabulated([1.0, 2.0, 3.5])) not in (old, new)


# --- what cannot be read is refused
# ----------------------------------------------------------------------------------

OPAQUE = """
from liemech.formulas import Record, record, vec
import collections, datetime

class Strange:
    hidden = 3.0
    def __float__(self): return self.hidden
    def __add__(self, x): return self.hidden + x
    def __len__(self): return 2
    def __getitem__(self, i): return self.hidden
    def __eq__(self, other): return True
    def __bool__(self): return True

@record
class Money(Record):
    x: float
    def __mul__(self, y): return self.x * y

S, M, D = Strange(), Money(2.0), collections.deque([1.0])

def helper(x): return x

def use_float(a, b, c, d, n): return vec(float(S) * a, b)
def use_add(a, b, c, d, n): return vec((S + 1.0) * a, b)
def use_len(a, b, c, d, n): return vec(len(S) * a, b)
def use_item(a, b, c, d, n): return vec(S[0] * a, b)
def use_equal(a, b, c, d, n): return vec(a if S == 1 else b, b)
def use_loop(a, b, c, d, n):
    for x in S:
        a = a * x
    return vec(a, b)
def use_truth(a, b, c, d, n): return vec(a if S else b, b)
def use_record(a, b, c, d, n): return vec(M * a, b)
def use_deque(a, b, c, d, n): return vec(D[0] * a, b)
def use_sum(a, b, c, d, n): return vec(sum(D) * a, b)
def use_vars(a, b, c, d, n): return vec(vars(S).get("hidden", 1.0) * a, b)
def use_id(a, b, c, d, n): return vec(a * (id(S) % 7), b)
def use_hash(a, b, c, d, n): return vec(a * (hash("a") % 7), b)
"""


@pytest.mark.parametrize("name", [n.split("(")[0] for n in OPAQUE.split("def ") if n.startswith("use_")])
def test_objects_on_which_python_would_compute_unseen_are_refused(name: str, tmp_path: Path) -> None:
    formula = getattr(worlds.module_from(OPAQUE, tmp_path, "opaque"), name)
    with pytest.raises(NotCompilable):
        worlds.native(formula, [[1.0, 2.0, 3.0, 4.0]], 2, 1, 1)


# --- tokens
# ----------------------------------------------------------------------------------------------------------


class Mode(enum.Enum):
    FAST = 1
    SLOW = 2


def test_tokens_tell_apart_what_looks_alike() -> None:
    row, other = (1.0, 2.0), (3.0, 4.0)
    things = [
        0, False, 0.0, -0.0, None, "0", b"0", 0j, -0j, (), [], {}, set(), frozenset(), range(0), range(1), slice(0), slice(1),
        (1, 23), (12, 3), ((1,), 23), ("1", "23"), ("12", "3"), (row, other, row), (row, other, other), (row, (other, row)),
        [1, 23], float("nan"), -float("nan"), 1e400, 1.5, 1.5000000000000002, 2**70, 2.0**70, Fraction(1, 3), Fraction(1, 2),
        Decimal("1.0"), Decimal("1.00"), Mode.FAST, Mode.SLOW, np.float64(1.5), np.int64(1), np.int32(1), True, 1,
        np.zeros(3), np.zeros((3, 1)), np.zeros(3, int), np.array([0.0, 0.0, -0.0]), np.array(["a"]),
        {"a": 1}, {"a": 1.0}, {"b": 1}, {"a": 1, "b": 2}, lm.vec(1.0, 2.0), lm.mat((1.0, 2.0)), abs, len, np.sin, np.cos,
        int, float, Mode, worlds, lambda x: x + 1, lambda x: x + 1.0, lambda x: (lambda y: y + 1), lambda x: (lambda y: y + 2),
    ]  # fmt: skip
    found = [content_hashes.digest(x) for x in things]
    assert len(set(found)) == len(things)
    assert found == [content_hashes.digest(x) for x in things]


class Slower(SO3Algebra):
    """Rotations of which every velocity turns half as far."""

    def exp_Ad_star(self, xi: lm.Vec, mu: lm.Vec) -> lm.Vec:
        return super().exp_Ad_star(0.5 * xi, mu)


@lm.record
class Pairs(lm.ProductGroup):
    """Pairs of rotations whose algebra a property makes anew at each use."""

    @property
    def algebra(self) -> ProductAlgebra:  # type: ignore[override]
        return ProductAlgebra((SO3Algebra(), SO3Algebra()))


def test_what_a_property_makes_anew_is_the_same_until_the_property_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    group = Pairs((lm.SO3(), lm.SO3()))
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, 6)))
    start = system.state([0.3, 0.8, -0.5, 0.1, 0.2, 0.9])
    plain, native = (lm.Plan(system, lm.RKMK(order=1), 0.1, compiled=c) for c in (False, True))
    before = native.run(start, steps=3).mu
    assert np.array_equal(before, plain.run(start, steps=3).mu)
    made = len(kernel.alive())
    assert np.array_equal(native.run(start, steps=3).mu, before) and len(kernel.alive()) == made
    other = property(lambda self: ProductAlgebra((Slower(), SO3Algebra())))
    monkeypatch.setattr(Pairs, "algebra", other)
    after = native.run(start, steps=3).mu
    assert np.array_equal(after, plain.run(start, steps=3).mu)
    assert not np.array_equal(after, before)
