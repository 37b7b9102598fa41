"""What native code cannot express is said in one sentence, with class, method, file, line and reason."""

from __future__ import annotations

import linecache
import os
import re
import subprocess
import sys
import textwrap
import warnings
from pathlib import Path

import numpy as np
import pytest
import worlds

import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.changes import cache
from liemech.errors import NotCompilable, NotCompiledWarning
from liemech.simulation.compiled import execution

pytestmark = pytest.mark.compiled

REFUSALS = {
    "a set made in a loop": ("x = a * len({k for k in (1, 2)})", "has no place in a formula"),
    "a dictionary with two names": ("d = {}\ne = d\nd['x'] = a", "has another name"),
    "a key that the run knows": ("d = {}\nd[n] = a\nx = d[2]", "a key of a dict must be known now"),
    "a key known at run time": ("x = {0: a, 1: b}[n]", "a key of a dict must be known now"),
    "try": ("try:\n    x = a\nexcept ValueError:\n    x = b", "`try:`: this statement has no place"),
    "with": ("with open('x') as f:\n    pass", "this statement has no place"),
    "a variable of the function around": (
        "def inner(y):\n    nonlocal x\n    x = y\ninner(a)",
        "this statement has no place",
    ),
    "an iterator advanced on one way": (
        "i = iter((a, b, c))\nif a > b:\n    x = next(i)\nx = next(i)",
        "on one way of a branch",
    ),
    "an iterator advanced in a long loop": (
        "i = iter((a, b))\nfor _ in range(n):\n    x = next(i)",
        "loop of unknown length",
    ),
    "an iterator in a loop that may end early": (
        "i = iter((a, b, c))\nfor _ in range(2):\n    x = next(i)\n    if x > a:\n        break\nx = next(i)",
        "that may end early",
    ),
    "an integer power known at run time": ("x = 2**n", "an integer to the power of one known only at run time"),
    "an integer beyond 2**63": ("x = n + 2**63", "beyond the integers of native code"),
    "NumPy's functions that have no formula": (
        "x = np.convolve(vec(a, b), vec(c, d))",
        "`convolve` of numbers known only at run time",
    ),
    "NumPy's linear algebra": (
        "x = np.linalg.solve(((a, b), (c, d)), (a, b))",
        "`solve` of numbers known only at run time",
    ),
    "an unknown function": ("x = time.perf_counter() * a", "`perf_counter` is not known to native code"),
    "printing": ("print(a)", "`print` is not known to native code"),
    "an undefined name": ("x = a + oops", "`oops` is not defined"),
    "an attribute of a number": ("x = a.real", "`real` of a number known only at run time"),
    "a text of numbers": ("x = len(f'{a}')", "text of numbers known only at run time"),
    "str of a number": ("x = len(str(a))", "`str` of numbers known only at run time"),
    "rounding to digits": ("x = round(a, 2)", "`round` to a number of digits"),
    "an attribute assigned": ("spring = SPRING\nspring.k = a", "formulas do not change objects in place"),
    "a list with two names": ("items = [a, b]\nother = items\nitems[0] = c\nx = other[0]", "has another name"),
    "the caller's list": ("items = [a, b]\nx = changes(items) + items[0]", "has another name"),
    "a list that `zip` goes through": (
        "items = [a, b]\nfor y, z in zip(items, items):\n    x = x + y\n    items[1] = c",
        "has another name",
    ),
    "a list with an iterator": (
        "items = [a, b]\nthem = iter(items)\nitems[1] = c\nx = next(them) + next(them)",
        "has another name",
    ),
    "a tuple changed": ("items = (a, b)\nitems[0] = c", "formulas do not change objects in place"),
    "insert": ("items = [a]\nitems.insert(0, b)", "`list.insert` is not known to native code"),
    "recursion without end": ("x = endless(a)", "formulas call each other without end"),
    "different things at one index": ("x = ((a, b), 'text')[n]", "it is one thing on one way and another on the other"),
    "an index that is no integer": ("x = (a, b)[c]", "is used as an index"),
    "a range to a float": ("for i in range(a):\n    x = i", "`range(a)`: `range` of a float"),
    "a length known at run time": (
        "x = len([v for v in (a, b) if v > 0.0])",
        "whose length depends on run-time numbers",
    ),
    "a growing list": (
        "items = []\nfor i in range(n):\n    items = [*items, a]",
        "`items` changes its structure in the loop",
    ),
    "a return in two long loops": (
        "for i in range(n):\n    for j in range(n):\n        if a > i * j:\n            return b",
        "inside two loops",
    ),
    "another structure": ("if a > b:\n    return a\n", "the returned value has no one form"),
    "a variable of no branch": ("if n > 2**70:\n    y = a\nx = y", "`y` may have no value here"),
    "a variable of a loop": ("for i in range(n):\n    y = a\nx = y", "`y` has no one value here"),
    "a vector or None": ("y = None\nif a > b:\n    y = vec(a, b)\nx = dot(y, y)", "`y` has no one value here"),
    "nothing but errors": ("x = always(a)", "every way through the formula raises"),
    "an endless loop": ("while True:\n    x = a", "the loop never ends"),
    "vectors of different lengths": (
        "x = dot(vec(a, b) + vec(a, b, c), vec(a, b))",
        "a Vec of 2 components cannot be combined",
    ),
    "too many arguments": ("x = sign(a, b)", "too many positional arguments"),
    "options": ("x = sign(**{'x': a})", "`**options`"),
    "deleting": ("del a", "this statement has no place"),
    "a module of its own": ("import math\nx = a", "this statement has no place"),
}

MODULE = """
import time

import numpy as np

from liemech.formulas import Record, dot, record, vec


@record
class Spring(Record):
    k: float

    def force(self, a, b, c, d, n):
        x = 0.0
{body}
        return vec(x, b)


SPRING = Spring(2.0)


def formula(a, b, c, d, n):
    return SPRING.force(a, b, c, d, n)


def sign(x):
    return 1.0 if x > 0.0 else -1.0


def changes(items):
    items[0] = 1.0
    return items[0]


def endless(x):
    return endless(x + 1.0)


class Stop(ArithmeticError):
    pass


def always(x):
    raise Stop("always")
"""


def refusal(formula) -> str:
    with pytest.raises(NotCompilable) as raised:
        worlds.native(formula, [[1.0, 2.0, 3.0, 4.0]], 2, 1, 1)
    return str(raised.value)


@pytest.mark.parametrize("what", REFUSALS)
def test_refused_with_one_sentence_that_says_where_and_why(what: str, tmp_path: Path) -> None:
    body, reason = REFUSALS[what]
    text = MODULE.format(body=textwrap.indent(body, " " * 8))
    message = refusal(worlds.module_from(text, tmp_path, "refused").formula)
    assert reason in message and "\n" not in message and len(message) < 400, message
    where = re.match(r"(\S+) \(refused\.py, line (\d+)\) cannot be compiled: ", message)
    assert where, message
    line = text.splitlines()[int(where[2]) - 1].strip()
    expected = {"the caller's list": "changes", "recursion without end": "endless", "nothing but errors": "always"}
    assert where[1] == expected.get(what, "Spring.force")
    if where[1] == "Spring.force" and what != "another structure":
        assert line in body, f"line {where[2]} is {line!r}"


def test_a_formula_without_a_file() -> None:
    names: dict = {}
    text = "from liemech.formulas import vec\ndef formula(a, b, c, d, n):\n    return vec(a, b)"
    exec(compile(text, "<nowhere>", "exec"), names)  # what "<string>" was, Python 3.13 may remember
    assert "the source of formula cannot be read: define it in a file or a notebook" in refusal(names["formula"])


def test_a_formula_whose_file_has_changed_since_its_import(tmp_path: Path) -> None:
    text = "from liemech.formulas import vec\n\n\ndef formula(a, b, c, d, n):\n    return vec(a, {})\n"
    module = worlds.module_from(text.format("b"), tmp_path, "altered")
    (tmp_path / "altered.py").write_text(text.format("b + c"))
    assert "altered.py has changed since it was imported" in refusal(module.formula)
    # imported again, it is in order
    again = worlds.module_from(text.format("b + d"), tmp_path, "altered")
    worlds.same_in_all_worlds(again.formula, [[1.0, 2.0, 3.0, 4.0]])


def test_a_formula_from_a_notebook_cell_compiles() -> None:
    text = "from liemech.formulas import vec\ndef formula(a, b, c, d, n):\n    return vec(a * b, n)\n"
    name = "<ipython-input-1-0123>"
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    names: dict = {}
    exec(compile(text, name, "exec"), names)
    worlds.same_in_all_worlds(names["formula"], [[1.0, 2.0, 3.0, 4.0]])


LAMBDAS = """
from liemech.formulas import vec
pair = (lambda x: x + 1.0), (lambda x: x + 2.0)
same = [lambda x: 2.0 * x, lambda x: 2.0 * x]
ints = (lambda x: 1 * x, lambda x: 1.0 * x, lambda x: True * x)
inner = lambda x: (lambda y: x - y), lambda y: (lambda x: x - y)
chosen = (lambda x: 1.0 if x > 0.0 else 2.0), (lambda x: x > 0.0 and 3.0 or 4.0), (lambda: 5.0), (lambda x, k=6.0: k)
é, long = (lambda x: x + 8.0), (lambda x: x
    + 7.0)
def formula(a, b, c, d, n):
    tail = chosen[0](a), chosen[1](a), chosen[2](), chosen[3](a), é(a), long(a)
    return vec(pair[0](a), pair[1](a), same[0](a), same[1](b), *[f(a) for f in ints], *tail)
def nested(a, b, c, d, n):
    return vec(inner[0](a)(b), inner[1](a)(b))
"""


def test_lambdas_on_one_line_are_told_apart_by_their_columns(tmp_path: Path) -> None:
    module = worlds.module_from(LAMBDAS, tmp_path, "lambdas")
    rows = [[1.5, 2.0, 3.0, 4.0], [-1.5, 2.0, 3.0, 4.0]]
    worlds.same_in_all_worlds(module.formula, rows)
    worlds.same_in_all_worlds(module.nested, rows)


def test_a_decorated_formula_keeps_its_decoration(tmp_path: Path) -> None:
    """functools.wraps must not make the compiler look through a wrapper that does something."""
    text = """
import functools
from liemech.formulas import vec
def doubled(f):
    @functools.wraps(f)
    def wrapper(*args):
        return 2.0 * f(*args)
    return wrapper
@doubled
def product(x, y):
    return x * y
def formula(a, b, c, d, n):
    return vec(product(a, b), n)
"""
    worlds.same_in_all_worlds(worlds.module_from(text, tmp_path, "decorated").formula, [[1.0, 2.0, 3.0, 4.0]])


# --- what a user sees
# ------------------------------------------------------------------------------------------------

GYROSTAT = """
import numpy as np
import liemech as lm


@lm.record
class Gyrostat(lm.Hamiltonian):
    inertia: lm.Vec

    def energy(self, mu):
        return 0.5 * lm.dot(mu, self.gradient(mu))

    def gradient(self, mu):
        table = dict.fromkeys("a", mu)
        return table["a"] / self.inertia


system = lm.LiePoissonSystem(lm.SO3(), Gyrostat([1.0, 2.0, 3.0]))
start = system.state(mu=[0.1, 0.2, 0.3])
"""


@pytest.fixture
def gyrostat(tmp_path: Path):
    return worlds.module_from(GYROSTAT, tmp_path, "gyrostat")


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Native code is made before the first step, as by a run that has taken long enough."""
    monkeypatch.setattr(execution, "WAIT", 0.0)
    monkeypatch.setattr(execution, "_shown", set())


@pytest.mark.usefixtures("at_once")
def test_a_run_goes_on_in_plain_python_with_one_warning(gyrostat) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = lm.integrate(gyrostat.system, lm.RKMK(order=4), gyrostat.start, h=0.1, steps=80, every=80)
    assert [w.category for w in caught] == [NotCompiledWarning]
    assert "Gyrostat.gradient (gyrostat.py, line 14) cannot be compiled" in str(caught[0].message)
    assert caught[0].filename == __file__  # where the user called integrate
    plain = lm.integrate(gyrostat.system, lm.RKMK(order=4), gyrostat.start, h=0.1, steps=80, every=80, compiled=False)
    assert np.array_equal(run.mu, plain.mu) and not run.compiled


def test_a_demanded_compilation_raises(gyrostat) -> None:
    with pytest.raises(NotCompilable, match=r"Gyrostat.gradient \(gyrostat.py, line 14\)"):
        lm.integrate(gyrostat.system, lm.RKMK(order=4), gyrostat.start, h=0.1, steps=10, compiled=True)


@lm.record
class Dreamer(lm.RKMK):
    """A method whose step compiles and whose start does not."""

    def start(self, system, state, h):
        return dict.fromkeys(("state",), state)["state"]


@pytest.mark.slow
@pytest.mark.usefixtures("at_once")
def test_a_method_whose_start_does_not_compile() -> None:
    """One body is started in plain Python anyway; the bodies of an ensemble are not."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    one, many = body.state(mu=[0.5, 0.0, 0.5]), body.state(mu=np.full((4, 3), 0.5))
    alone = lm.integrate(body, Dreamer(), one, h=0.1, steps=800, every=800)
    assert alone.compiled
    assert np.array_equal(alone.mu, lm.integrate(body, lm.RKMK(), one, h=0.1, steps=800, every=800).mu)
    with pytest.warns(NotCompiledWarning, match="Dreamer.start"):
        run = lm.integrate(body, Dreamer(), many, h=0.1, steps=400, every=400)
    assert np.array_equal(run.mu, lm.integrate(body, lm.RKMK(), many, h=0.1, steps=400, every=400).mu)


def test_the_terminal_shows_one_short_traceback(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(GYROSTAT + "lm.integrate(system, lm.RKMK(order=4), start, h=0.1, steps=10, compiled=True)\n")
    run = subprocess.run([sys.executable, str(program)], capture_output=True, text=True, timeout=120)
    assert run.returncode == 1
    assert run.stderr.count("Traceback") == 1 and len(run.stderr.splitlines()) < 30, run.stderr
    assert run.stderr.splitlines()[-1].startswith(
        "liemech.errors.NotCompilable: Gyrostat.gradient (program.py, line 14)"
    )


# --- where there is no compiler
# --------------------------------------------------------------------------------------

RUN = """
import sys, warnings
if "nothing" in sys.argv:
    class Blocked:
        def find_spec(self, name, path=None, target=None):
            if name.partition(".")[0] == "llvmlite":
                raise ImportError(name)
    sys.meta_path.insert(0, Blocked())
warnings.simplefilter("error")
import numpy as np, liemech as lm, liemech.errors
body = lm.RigidBody([1.0, 1.5, 2.0])
starts = body.state(mu=[[0.5, 0.0, 0.8], [0.1, 0.9, -0.3]], g=np.eye(3))
run = lm.integrate(body, lm.RKMK(order=4), starts, h=0.1, steps=60, every=30, compiled="native" in sys.argv or None)
print(run.mu.tobytes().hex(), run.g.tobytes().hex())
try:
    lm.integrate(body, lm.RKMK(order=4), starts, h=0.1, steps=10, compiled=True)
    print("compiled")
except lm.errors.NotCompilable as error:
    print(error)
print("llvmlite" in sys.modules)
"""


@pytest.mark.slow
def test_the_same_bits_without_a_compiler() -> None:
    def run(*arguments: str, **environment: str) -> list[str]:
        program = [sys.executable, "-c", RUN, *arguments]
        done = subprocess.run(program, env=os.environ | environment, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    bits, compiled, loaded = run("native")
    assert (compiled, loaded) == ("compiled", "True")
    missing, off, also_off = run("nothing"), run(LIEMECH_COMPILE="0"), run(NUMBA_DISABLE_JIT="1")
    for answer in (missing, off, also_off):
        assert answer[0] == bits and answer[2] == "False"
        assert "compiled=True, but" in answer[1]
    assert "llvmlite is not installed" in missing[1] and "LIEMECH_COMPILE=0" in off[1]


@pytest.mark.slow
@pytest.mark.usefixtures("at_once")
def test_a_compiler_that_fails_is_no_reason_to_stop(gyrostat, monkeypatch: pytest.MonkeyPatch) -> None:
    """LLVM itself may refuse (an unknown processor, a broken installation): the run goes on, with a warning."""

    def broken(*_):
        raise RuntimeError("LLVM does not know this processor")

    from liemech.compiler.machine import llvm

    monkeypatch.setattr(llvm, "object_code", broken)
    monkeypatch.setattr(cache, "load", lambda key, fits: None)
    kernel.forget()
    monkeypatch.setattr(execution, "_histories", {})

    @lm.record
    class Unseen(lm.Hamiltonian):
        """Its native code cannot be there already, whatever ran before."""

        def energy(self, mu: lm.Vec) -> float:
            return 0.5 * (mu[0] ** 2 + mu[1] ** 2 / 1.5 + mu[2] ** 2 / 2.0)

    body = lm.LiePoissonSystem(lm.SO3(), Unseen())
    with pytest.warns(NotCompiledWarning, match="LLVM does not know this processor"):
        run = lm.integrate(body, lm.RKMK(order=4), body.state(mu=[0.5, 0.0, 0.5]), h=0.1, steps=800, every=800)
    assert not run.compiled and np.isfinite(run.mu).all()
    with pytest.raises(NotCompilable, match="LLVM does not know this processor"):
        lm.integrate(body, lm.RKMK(order=4), body.state(mu=[0.5, 0.0, 0.5]), h=0.1, steps=10, compiled=True)
