"""Private functions and loops over large matrices: the bits of formulas that are written out,
whatever becomes a function.
"""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("llvmlite")
import worlds

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.changes import cache
from liemech.compiler.machine import llvm
from liemech.compiler.numbers import memory_loops
from liemech.compiler.translation import inlining, instructions, native_functions, state
from liemech.errors import NotCompilable
from liemech.simulation.compiled import execution

pytestmark = pytest.mark.compiled

TEXT = """
import liemech as lm
from liemech.formulas import sqrt, sin, where, vec, mat, Complex, identity_matrix

def norm2(v):
    return v[0] * v[0] + v[1] * v[1]

def itself(v):
    return v

def pair(v, w):
    return v, w, v is w

def root(x):
    if x < 0.0:
        raise ArithmeticError("negative")
    return sqrt(x)

def halved(x):
    turns = 0
    while abs(x) > 1.0 and turns < 200:
        x = 0.5 * x
        turns = turns + 1
    return x, turns

def longer(items, x):
    items = [*items, x]
    items[0] = items[0] + x
    return items

def cubed(v):
    return vec(v[0] * v[0] * v[0], v[1] * v[0])

def ways(x, y):
    a = 0.0
    for k in range(3):
        v = vec(x + k, y)
        u, w, same = pair(v, v)
        a = a + norm2(u) * norm2(itself(w)) + (1.0 if itself(v) is v and same else 0.0)
    return a

def raising(x, y):
    a = root(x) + root(y)
    b, n = halved(x * y)
    if b > 0.5:
        a = a + root(b - 0.75)
    c, m = halved(x - y)
    return a + b * n + c * m

def derived(x, y):
    d = lm.jacobian(cubed, vec(x, y))
    e = lm.jacobian(cubed, vec(y, d[0, 0]))
    f = lm.jacobian(lambda v: lm.derivative(cubed, v, vec(y, 1.0)), vec(x, 2.0))
    return d[0, 0] + e[1, 0] + f[0, 0] + f[1, 1]

def lists(x, y):
    a = [x, y]
    b = longer(a, x)
    c = longer(longer(a, y), b[2])
    return a[0] + 2.0 * b[0] + 4.0 * c[0] + 8.0 * c[3]

def imaginary(x, y):
    a = mat(vec(Complex(x, y), Complex(y, 1.0)), vec(Complex(0.0, x), Complex(y, y)))
    b = a @ a
    c = (b @ b) @ (a @ b)
    return c[0, 1].re - c[1, 0].im
"""


def no_kernels(patch: pytest.MonkeyPatch) -> None:
    """A process that has made nothing yet, with an empty disk."""
    patch.setattr(cache, "load", lambda key, fits: None)
    patch.setattr(cache, "store", lambda *_: None)
    patch.setattr(kernel, "KERNELS", type(kernel.KERNELS)())
    patch.setattr(execution, "_histories", {})
    patch.setattr(execution, "_shown", set())
    patch.setattr(importlib.import_module("liemech.simulation.integrate"), "_plans", {})


@pytest.fixture(params=["known", "general"])
def everything(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Every formula becomes a function at its first call, of its constants or for any; every
    product of matrices a loop.
    """
    no_kernels(monkeypatch)
    for name in ("LONG", "WORTH", "LARGE"):
        monkeypatch.setattr(inlining, name, 0)
    monkeypatch.setattr(inlining.Outliner, "enter", _at_once)
    monkeypatch.setattr(memory_loops, "LARGE", 0)
    monkeypatch.setattr(memory_loops, "TERMS", 0)
    if request.param == "general":
        monkeypatch.setattr(native_functions, "RETURNED", 0)
        monkeypatch.setattr(inlining.Outliner, "_form_of_function", lambda self, call: (call.general, True))


def _at_once(self: Any, frame: Any) -> Any:
    self.costly.add(frame.source.function)
    return _enter(self, frame)


_enter = inlining.Outliner.enter

ROWS = [(0.3, 1.7), (2.0, 5.0), (1e-3, 40.0), (-1.0, 2.0), (3.0, -0.5), (7.0, 0.1), (1e3, 1e3), (0.0, 0.0), (1.0, 1.0)]


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", ["ways", "raising", "derived", "lists", "imaginary"])
def test_formulas(name: str, everything: None, tmp_path: Path) -> None:
    formula = getattr(worlds.module_from(TEXT, tmp_path, f"outlined_{name}"), name)
    calls = f"def turned(x, y, turns):\n    return {name}(x, y)"
    module = worlds.module_from(TEXT + calls, tmp_path, f"outlined_{name}_turned")
    assert formula is not None
    worlds.same_in_all_worlds(module.turned, ROWS, lanes=(1, 4, kernel.lanes()))


BODY = lm.RigidBody([1.0, 1.5, 2.0])
TOP = lm.models.HeavyTop([1.0, 1.5, 2.0], 1.0, [0.18, 0.0, 0.24])
MU = np.array([0.5, 0.1, 0.75**0.5])


def of(group: Any) -> Any:
    return lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, group.dim)))


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What is large is small; the builders of all kernels."""
    no_kernels(monkeypatch)
    for name, value in {"ALONE": 1, "WHOLE": 1, "WORTH": 10}.items():
        monkeypatch.setattr(inlining, name, value)
    monkeypatch.setattr(state, "HUGE", 40)
    monkeypatch.setattr(native_functions, "RETURNED", 0)
    builders: list[Any] = []
    made = instructions.Builder.__init__
    monkeypatch.setattr(
        instructions.Builder, "__init__", lambda self, *args: (builders.append(self), made(self, *args))[1]
    )
    return builders


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", ["ways", "raising", "derived", "lists", "imaginary"])
def test_what_grows_has_the_same_bits(name: str, small: list[Any], tmp_path: Path) -> None:
    text = TEXT + f"def turned(x, y, turns):\n    return {name}(x, y)"
    worlds.same_in_all_worlds(worlds.module_from(text, tmp_path, f"growing_{name}").turned, ROWS, lanes=[1, 4])


def test_what_grows_is_given_up_soon(small: list[Any], tmp_path: Path) -> None:
    """Not when all of it has been written out: nested formulas were translated twice for each that is around them."""
    text = """
def turn(x, y):
    return x * x - y * y, x * y + x

def long(x, y):
    for k in range(32):
        x, y = turn(x, y)
    return x, y

def formula(x, y, n):
    return long(*long(x, y))
"""
    worlds.same_in_all_worlds(
        worlds.module_from(text, tmp_path, "given_up").formula, [(0.3, 0.4), (0.1, -0.2)], lanes=[1]
    )
    assert small and all(b.made < 1.5 * (b.emitted + b.finished) for b in small)


def test_formulas_around_one_that_must_be_written_out_are_translated_once(small: list[Any], tmp_path: Path) -> None:
    """One that is given a formula made on the way is no function: it is large, and those around it are not for that."""
    text = """
def long(turn, x, y):
    for k in range(32):
        x, y = turn(x, y)
    return x, y

def within(turn, x, y):
    x, y = long(turn, x, y)
    return x + y, y

def deeper(turn, x, y):
    x, y = within(turn, x, y)
    return x, y - x

def formula(x, y, n):
    def turn(u, v):
        return u * u - v * v, u * v + x
    return deeper(turn, x, y)
"""
    worlds.same_in_all_worlds(
        worlds.module_from(text, tmp_path, "around").formula, [(0.3, 0.4), (0.1, -0.2)], lanes=[1]
    )
    assert small and all(b.made < 3.0 * (b.emitted + b.finished) for b in small)


def test_a_copy_with_a_formula_that_must_be_written_out(small: list[Any], tmp_path: Path) -> None:
    """LLVM's copy of it counts as written out; what is written out in it does not count for the formulas around: the
    limit of these moves, and had not (compositions on SO(4) were "not compilable").
    """
    text = """
def long(turn, x, y):
    for k in range(32):
        x, y = turn(x, y)
    return x, y

def copied(x, y):
    def turn(u, v):
        return u * u - v * v, u * v + x
    return long(turn, x, y)

def outer(x, y):
    x, y = copied(x, y)
    x, y = copied(x, y)
    x, y = copied(x, y)
    return x - y, y + x

def formula(x, y, n):
    return outer(*outer(x, y))
"""
    worlds.same_in_all_worlds(
        worlds.module_from(text, tmp_path, "copies").formula, [(0.3, 0.4), (0.1, -0.2)], lanes=[1]
    )


PAIRS = [
    (BODY, lm.RKMK(order=4)),
    (TOP, lm.RKMK(order=4)),
    (BODY, lm.Composition(lm.CovariantVariational(lm.Exponential()))),
    (BODY, lm.CovariantVariational(lm.Cayley())),
    (BODY, lm.LiePoissonHamiltonJacobi(order=4)),
    (TOP, lm.LieVerlet()),
    (TOP, lm.GalerkinVariational(order=4)),
    (BODY, lm.Taylor(6)),
    (of(lm.SU(3)), lm.RKMK(order=2)),
    (of(lm.SO(7)), lm.RKMK(order=2)),
]


QUICK = PAIRS[1], PAIRS[2]
"""A body in a field, a composition; the others are slow."""


@pytest.mark.parametrize("lanes", [1, 3])
@pytest.mark.parametrize(
    ("system", "method"),
    [pair if pair in QUICK else pytest.param(*pair, marks=pytest.mark.slow) for pair in PAIRS],
    ids=lambda x: getattr(x, "name", type(x).__name__),
)
def test_methods(system: Any, method: Any, lanes: int, everything: None) -> None:
    """Plain Python, a body alone and bodies in lanes."""
    group = system.group if isinstance(system, lm.LiePoissonSystem) else system.body.group
    mu = np.array([(1.0 + i) * np.resize(MU, group.dim) for i in range(lanes)])
    g = np.array([np.array(group.identity())] * lanes)
    starts = [system.state(mu=m, g=x) for m, x in zip(mu, g, strict=True)]
    start = starts[0] if lanes == 1 else system.state(mu=mu, g=g)
    run = lm.integrate(system, method, start, h=0.1, steps=3, compiled=True)
    assert run.compiled
    for i, one in enumerate(starts):
        plain = lm.integrate(system, method, one, h=0.1, steps=3, compiled=False)
        ours = (run.mu, run.g) if lanes == 1 else (run.mu[:, i], run.g[:, i])
        assert np.array_equal(ours[0], plain.mu) and np.array_equal(ours[1], plain.g)


@pytest.mark.parametrize("lanes", [1, 16])
def test_products(lanes: int, everything: None, tmp_path: Path) -> None:
    """Matrices and vectors of any shape, real and complex, against the operators of plain Python."""
    text = """
from liemech.formulas import Complex, mat, vec

def formula(a, b, c, turns):
    x = mat(*[vec(*[a * i - b * j + c for j in range(5)]) for i in range(3)])
    y = mat(*[vec(*[b * i + c * j * j - a for j in range(9)]) for i in range(5)])
    z = mat(*[vec(*[Complex(a * i, c - j) for j in range(4)]) for i in range(5)])
    w = mat(*[vec(*[Complex(b * j, a + i) for j in range(3)]) for i in range(4)])
    p, q = x @ y, z @ w
    u, v = y @ p[2], (x.T @ p) @ p[1]
    s = vec(1.0, 2.0, 3.0) @ p
    r = w @ q[1]
    return [*p[0], *p[2], *u, *v, *s, *[t.re - 2.0 * t.im for t in (*q[0], *q[4], *r)]]
"""
    formula = worlds.module_from(text, tmp_path, "products").formula
    rows = [(0.1, 0.7, -1.3), (1e200, 1.0, 3.0), (0.0, -0.0, 1e-310), (1.0 / 3.0, 0.1, 7.0)]
    worlds.same_in_all_worlds(formula, rows, lanes=(lanes,))


@pytest.mark.slow
def test_what_is_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the run goes on in plain Python."""
    no_kernels(monkeypatch)
    monkeypatch.setattr(execution, "WAIT", 0.0)
    monkeypatch.setattr(instructions, "LIMIT", 300)
    start = BODY.state(mu=MU)
    with pytest.raises(NotCompilable, match=r"more than 300 instructions.*fewer stages"):
        lm.integrate(BODY, lm.RKMK(order=4), start, h=0.1, steps=10, compiled=True)
    with pytest.warns(lm.errors.NotCompiledWarning, match="fewer stages"):
        assert not lm.integrate(BODY, lm.RKMK(order=4), start, h=0.1, steps=3000).compiled


def test_a_wide_state_is_refused_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything of the method is translated."""
    no_kernels(monkeypatch)
    monkeypatch.setattr(inlining, "WIDEST", 11)
    start = BODY.state(mu=MU, g=np.eye(3))
    with pytest.raises(NotCompilable, match="a state of 12 numbers, more than 11"):
        lm.integrate(BODY, lm.RKMK(order=4), start, h=0.1, steps=10, compiled=True)


def test_every_function_is_called(everything: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Functions whose calls were taken back are not compiled."""
    texts: list[str] = []
    code = llvm.object_code
    monkeypatch.setattr(llvm, "object_code", lambda text: texts.append(text) or code(text))
    lm.integrate(BODY, lm.CovariantVariational(lm.Exponential()), BODY.state(mu=MU), h=0.1, steps=1, compiled=True)
    names = re.findall(r"^define internal .*@\"?([^\"(]+)\"?\(", texts[-1], re.MULTILINE)
    assert names and all(
        re.search(rf'call (fastcc|preserve_mostcc) .*@"?{re.escape(name)}"?\(', texts[-1]) for name in names
    )


@pytest.mark.parametrize("lanes", [1, 16])
def test_tables(lanes: int, everything: None, tmp_path: Path) -> None:
    """Sums of terms in any number, with any coefficients, against plain Python."""
    text = """
from liemech.formulas import vec
from liemech.formulas.sums import antisymmetric_map, bilinear_map

TABLE = (
    ((1.0, 0, 1), (-1.0, 2, 1), (0.3, 1, 1)), (), ((0.1, 2, 2), (-1.0, 0, 0), (7.0, 1, 2)),
    ((1.0, 2, 0), (-3.0, 1, 0), (1e3, 0, 2)),
    ((-0.7, 1, 0),), ((2.0, 0, 0),), ((1.0, 2, 1),), ((-1.0, 0, 2),),
)

def formula(a, b, c, turns):
    x, y = vec(a, b, 0.3), vec(c, a * b, a - c)
    return [*bilinear_map(TABLE, x, y), *antisymmetric_map(TABLE, y, x), *bilinear_map(TABLE, y, y)]
"""
    formula = worlds.module_from(text, tmp_path, "tables").formula
    rows = [(0.1, 0.7, -1.3), (1e200, 1.0, 3.0), (0.0, -0.0, 1e-310), (1.0 / 3.0, 0.1, 7.0)]
    worlds.same_in_all_worlds(formula, rows, lanes=(lanes,))


@pytest.mark.slow
def test_a_long_kernel_is_short() -> None:
    """Seventeen substeps are not seventeen times the instructions of one."""

    def size(method: Any) -> int:
        found: list[int] = []

        def counted(*arguments: Any) -> Any:
            reads, text = translated(*arguments)
            found.append(text.count("\n"))
            return reads, text

        translated, kernel._translated = kernel._translated, counted
        try:
            lm.integrate(BODY, method, BODY.state(mu=MU), h=0.0625 * (1.0 + len(found)), steps=1, compiled=True)
        finally:
            kernel._translated = translated
        return found[-1]

    with pytest.MonkeyPatch.context() as patch:
        no_kernels(patch)
        base = lm.CovariantVariational(lm.Exponential())
        assert size(lm.Composition(base, order=8)) < 8 * size(base)
