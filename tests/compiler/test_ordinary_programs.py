"""Ordinary programs that native code once read otherwise than Python, or kept after a change.

Each gives what CPython gives, before and after every change, or is refused with these words.
"""

from __future__ import annotations

import functools
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import worlds

import liemech as lm
from liemech.compiler.changes import cache
from liemech.errors import NotCompilable

pytestmark = pytest.mark.compiled

HEADER = """
import abc
import collections
import decimal
import enum
import functools
import math
import types
import typing
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import numpy as np
from liemech.formulas import *
"""

ROWS = [[0.5, -1.5, 2.0, 0.25], [-0.7, 1.2, 0.5, 3.0], [0.0, -0.0, 1.0, -1.0], [2.77, 0.44, -8.99, -0.26]]

PROGRAMS = r"""
### is True of numpy bool | `is` of a truth value, in a formula with NumPy's numbers
def formula(a, b, c, d, n):
    return 1.0 if (np.sin(a) > 0.0) is True else 2.0

### pos of bool | `is` between numbers
def formula(a, b, c, d, n):
    return 1.0 if (+(a > 0.0)) is True else 2.0

### isinstance pos bool | may be int or bool
def formula(a, b, c, d, n):
    return 1.0 if isinstance(+(a > 0.0), bool) else 2.0

### n ** np.int64(-1) | negative powers of integers
P = np.int64(-1)
def formula(a, b, c, d, n):
    return float(n ** P)

### isinstance mixed | may be float or int
def formula(a, b, c, d, n):
    x = 1 if a > 0.0 else 2.5
    return 1.0 if isinstance(x, int) else 2.0

### isinstance bool-int mix | may be int or bool
def formula(a, b, c, d, n):
    x = (b > 0.0) if a > 0.0 else n
    return 1.0 if isinstance(x, bool) else 2.0

### type bool-int mix | may be int or bool
def formula(a, b, c, d, n):
    x = True if a > 0.0 else 0
    return 1.0 if type(x) is bool else 2.0

### big int mixed with float
def formula(a, b, c, d, n):
    x = n * 2**60 + 1 if a > 0.0 else 0.5
    return float(x - n * 2**60)

### minus abs of mixed | the negative of a number that is an integer on one way
def formula(a, b, c, d, n):
    x = 0 if a > 0.0 else 1.5
    return -abs(x)

### percent s | a text of numbers known only at run time
def formula(a, b, c, d, n):
    return a * len("%s" % n)

### percent s tuple | a text of numbers known only at run time
def formula(a, b, c, d, n):
    return a * len("%s-%s" % (n, n))

### private global | private names with two underscores
__K = 2.0
class World:
    def f(self, x):
        return __K * x
W = World()
def formula(a, b, c, d, n):
    return W.f(a)

### private global both | private names with two underscores
__K = 2.0
_World__K = 3.0
class World:
    def f(self, x):
        return __K * x
W = World()
def formula(a, b, c, d, n):
    return W.f(a)

### private parameter | `__x` may have no value here
__x = 2.0
class World:
    def f(self, __x):
        return __x * 2.0
W = World()
def formula(a, b, c, d, n):
    return W.f(a)

### dead yield | `\(yield\)`: this expression has no place
def helper(x):
    return x
    yield
def formula(a, b, c, d, n):
    return helper(a)

### dead yield sum | return a list
def helper(x):
    if False:
        yield x
    return (x, x)
def formula(a, b, c, d, n):
    return float(sum(helper(a)))

### dead del in inner | `k` may have no value here
def formula(a, b, c, d, n):
    k = 2.0
    def inner(x):
        if False:
            del k
        return k * x
    return inner(a)

### dead global in inner | `global K`: this statement has no place
K = 5.0
def formula(a, b, c, d, n):
    K = 2.0
    def inner(x):
        if False:
            global K
        return K * x
    return inner(a)

### dead import in inner | `k` may have no value here
def formula(a, b, c, d, n):
    k = 2.0
    def inner(x):
        if False:
            import math as k
        return k * x
    return inner(a)

### dead except name in inner | `k` may have no value here
def formula(a, b, c, d, n):
    k = 2.0
    def inner(x):
        if False:
            try:
                pass
            except ValueError as k:
                pass
        return k * x
    return inner(a)

### super in lambda | `super\(\)` in an inner function
@record
class B(Record):
    k: float = 2.0
    def f(self, x): return self.k * x
@record
class C(B):
    def f(self, x):
        g = lambda y: super().f(y)
        return g(x)
W = C()
def formula(a, b, c, d, n):
    return W.f(a)

### tuple in set
BONDS = {(0, 1), (1, 2), (2, 3)}
def formula(a, b, c, d, n):
    return 1.0 if (n - 1, n) in BONDS else a

### tuple in dict
BONDS = {(0, 1): 2.0, (1, 2): 3.0, (2, 3): 1.0}
def formula(a, b, c, d, n):
    return 1.0 if (n - 1, n) in BONDS else a

### tuple not in frozenset
BONDS = frozenset({(0, 1), (1, 2), (2, 3)})
def formula(a, b, c, d, n):
    return 1.0 if (n - 1, n) not in BONDS else a

### tuple in loop
BONDS = frozenset({(0, 1), (1, 2), (2, 3)})
def formula(a, b, c, d, n):
    s = 0.0
    for i in range(40):
        if (i, i + 1) in BONDS:
            s = s + a
    return s

### hasattr len
def formula(a, b, c, d, n):
    return a if hasattr(a, "__len__") else 2.0 * a

### hasattr iter
def formula(a, b, c, d, n):
    return a if hasattr(a, "__iter__") else 2.0 * a

### hasattr real
def formula(a, b, c, d, n):
    return a if hasattr(a, "real") else 2.0 * a

### hasattr kind values
def formula(a, b, c, d, n):
    return a if hasattr(a, "kind") else 2.0 * a

### callable lambda
def formula(a, b, c, d, n):
    f = lambda x: x * b
    return f(a) if callable(f) else 1.0

### callable def
def formula(a, b, c, d, n):
    def f(x): return x * b
    return f(a) if callable(f) else 1.0

### callable passed
def apply(f, x):
    return f(x) if callable(f) else f
def formula(a, b, c, d, n):
    return apply(lambda x: x * b, a)

### callable number
def apply(f, x):
    return f(x) if callable(f) else f
def formula(a, b, c, d, n):
    return apply(c, a)

### isinstance closure FunctionType
def formula(a, b, c, d, n):
    f = lambda x: x * b
    return f(a) if isinstance(f, types.FunctionType) else 1.0

### isinstance closure Callable
def formula(a, b, c, d, n):
    f = lambda x: x * b
    return f(a) if isinstance(f, collections.abc.Callable) else 1.0

### closure name | of an inner function
def formula(a, b, c, d, n):
    f = lambda x: x * b
    return f(a) if f.__name__ == "<lambda>" else 1.0

### closure hasattr node
def formula(a, b, c, d, n):
    f = lambda x: x * b
    return f(a) if hasattr(f, "node") else 1.0

### closure attr frame
def formula(a, b, c, d, n):
    f = lambda x: x * b
    return f(a) if getattr(f, "name", "no") == "no" else 1.0

### isinstance iterator | `isinstance` of an iterator
def formula(a, b, c, d, n):
    it = iter([a, b])
    return a if isinstance(it, collections.abc.Iterator) else 1.0

### iter taken attr | `hasattr` of an iterator
def formula(a, b, c, d, n):
    it = iter([a, b])
    return a if hasattr(it, "taken") else 1.0

### and next | an iterator that is advanced on one way
def formula(a, b, c, d, n):
    it = iter([1.0, 2.0, 3.0])
    x = a > 0.0 and next(it)
    return next(it)

### or next | an iterator that is advanced on one way
def formula(a, b, c, d, n):
    it = iter([1.0, 2.0, 3.0])
    x = a > 0.0 or next(it) > 0.0
    return next(it)

### chained next | an iterator that is advanced on one way
def formula(a, b, c, d, n):
    it = iter([1.0, 2.0, 3.0])
    x = 0.0 < a < next(it)
    return (next(it) + x)

### all generator next | an iterator that is advanced on one way
def formula(a, b, c, d, n):
    it = iter([1.0, 2.0, 3.0])
    x = all(next(it) > v for v in (a, b))
    return (next(it) + x)

### augassign double evaluation
def formula(a, b, c, d, n):
    it = iter([0, 1, 2])
    x = [a, b, c]
    x[next(it)] += 10.0
    return tuple(x)

### augassign walrus index
def formula(a, b, c, d, n):
    i = 0
    x = [a, b, c]
    x[(i := i + 1)] += 10.0
    return tuple(x)

### augassign ndarray global | changes an object of ndarray in place
ROW = np.array([0.5, -1.25, 3.0])
def formula(a, b, c, d, n):
    x = ROW
    x *= 1.5
    return a * ROW[0]

### augassign dict local | changes an object of dict in place
def formula(a, b, c, d, n):
    x = {"a": 1.0}
    y = x
    x |= {"a": 2.0}
    return a * y["a"]

### range func twice
def formula(a, b, c, d, n):
    fs = iter([lambda: (1.0, 2.0), lambda: (10.0, 20.0)])
    s = 0.0
    for x in next(fs)():
        s = s + x
    return s + a

### np random rand | `RandomState.rand` is not known
def formula(a, b, c, d, n):
    return a + np.random.rand()

### rng normal | `Generator.normal` is not known
RNG = np.random.default_rng(3)
def formula(a, b, c, d, n):
    return a + RNG.normal()

### np fromfile | `fromfile` is not known
np.array([2.0]).tofile("numbers.bin")
def formula(a, b, c, d, n):
    return a * np.fromfile("numbers.bin")[0]
#> file changed: np.array([4.0]).tofile("numbers.bin")

### decimal context
D1, D2 = decimal.Decimal(1), decimal.Decimal(3)
def formula(a, b, c, d, n):
    return a * float(D1 / D2)
#> precision: decimal.getcontext().prec = 4
#> back: decimal.getcontext().prec = 28

### isinstance after redefinition
class Body:
    mass = 2.0
SUN = Body()
def formula(a, b, c, d, n):
    return a * (2.0 if isinstance(SUN, Body) else 3.0)
#> class defined again: Body = type("Body", (), {"mass": 2.0, "__module__": Body.__module__})
#> made again: SUN = Body()

### type is after redefinition
class Body:
    mass = 2.0
SUN = Body()
def formula(a, b, c, d, n):
    return a * (2.0 if type(SUN) is Body else 3.0)
#> class defined again: Body = type("Body", (), {"mass": 2.0, "__module__": Body.__module__})

### enum after redefinition
class Colour(enum.Enum):
    RED = 1
    BLUE = 2
NOW = Colour.RED
def formula(a, b, c, d, n):
    return a * (2.0 if NOW is Colour.RED else 3.0)
#> class defined again: old = Colour; Colour = enum.Enum("Colour", {"RED": 1, "BLUE": 2}, module=old.__module__)

### enum == after redefinition
class Colour(enum.Enum):
    RED = 1
    BLUE = 2
NOW = Colour.RED
def formula(a, b, c, d, n):
    return a * (2.0 if NOW == Colour.RED else 3.0)
#> class defined again: old = Colour; Colour = enum.Enum("Colour", {"RED": 1, "BLUE": 2}, module=old.__module__)

### enum in dict after redefinition
class Colour(enum.Enum):
    RED = 1
    BLUE = 2
NOW = Colour.RED
TABLE = {Colour.RED: 2.0}
def formula(a, b, c, d, n):
    return a * (2.0 if NOW in TABLE else 3.0)
#> class defined again: old = Colour; Colour = enum.Enum("Colour", {"RED": 1, "BLUE": 2}, module=old.__module__)
TABLE = {Colour.RED: 2.0}

### object is object
class Body:
    pass
SUN, EARTH = Body(), Body()
CENTRE = SUN
def formula(a, b, c, d, n):
    return a * (2.0 if CENTRE is SUN else 3.0)
#> other centre: CENTRE = EARTH

### function is function
def make(k):
    def law(x): return k * x
    return law
A, B = make(2.0), make(2.0)
NOW = A
def formula(a, b, c, d, n):
    return a * (2.0 if NOW is A else 3.0)
#> other: NOW = B

### record is record | `is` between two of P
@record
class P(Record):
    m: float = 1.0
X, Y = P(1.0), P(1.0)
NOW = X
def formula(a, b, c, d, n):
    return a * (2.0 if NOW is X else 3.0)
#> other: NOW = Y

### list is list | `is` between two of list
X, Y = [1.0], [1.0]
NOW = X
def formula(a, b, c, d, n):
    return a * (2.0 if NOW is X else 3.0)
#> other: NOW = Y

### float subclass chosen
class Kelvin(float): pass
K = Kelvin(3.0)
def formula(a, b, c, d, n):
    x = K if a > 0.0 else 1.0
    return x * 2.0
#> other: K = Kelvin(4.0)

### float subclass where
class Kelvin(float): pass
K = Kelvin(3.0)
def formula(a, b, c, d, n):
    return where(a > 0.0, K, 0.0)
#> other: K = Kelvin(4.0)

### float subclass returned
class Kelvin(float): pass
K = Kelvin(3.0)
def formula(a, b, c, d, n):
    return K
#> other: K = Kelvin(4.0)

### int subclass index
class Level(int): pass
K = Level(1)
def formula(a, b, c, d, n):
    return (a, b, c)[K]
#> other: K = Level(2)

### str subclass key
class Name(str): pass
K = Name("x")
T = {"x": 1.0, "y": 2.0}
def formula(a, b, c, d, n):
    return a * T[K]
#> other: K = Name("y")

### dict missing | which would make an entry
class T(dict):
    def __missing__(self, k): return SCALE * k
SCALE = 2.0
TABLE = T()
def formula(a, b, c, d, n):
    return a * TABLE[3]
#> other: SCALE = 5.0

### fstring of record
@record
class P(Record):
    m: float = 1.0
    def f(self, x):
        return x * len(f"{self}")
W = P()
def formula(a, b, c, d, n):
    return W.f(a)
#> other: W = P(1.125)

### str of object with __str__ | compute with an object of P
WORD = "abc"
class P:
    def __str__(self): return WORD
W = P()
def formula(a, b, c, d, n):
    return a * len(f"{W}")
#> other: WORD = "abcdef"

### of numpy sqrt | a sum of truth values
def formula(a, b, c, d, n):
    return float((np.sqrt(a) > 1.0) + (np.sqrt(b) > 1.0))

### of numpy loop | a sum of truth values
def formula(a, b, c, d, n):
    x = a
    s = 0
    for i in range(n):
        s = s + ((x > 0.0) + (b > 0.0))
        x = np.sin(x)
    return float(s)

### numpy of bool | `np.cos` of integers or truth values
def formula(a, b, c, d, n):
    return float(np.cos(a > 0.0))

### numpy of bool times | `np.sqrt` of integers or truth values
def formula(a, b, c, d, n):
    return float(np.sqrt(a > 0.0) * b)

### np maximum int | of integers or truth values
def formula(a, b, c, d, n):
    return -np.maximum(n - 3, 0)

### np reciprocal int | of integers or truth values
def formula(a, b, c, d, n):
    return float(np.reciprocal(n))

### np square int big | of integers or truth values
def formula(a, b, c, d, n):
    return float(np.square(n * 2**31) + 1 - np.square(n * 2**31))

### np power int | of integers or truth values
def formula(a, b, c, d, n):
    return float(np.power(2, 62 + n))

### np sign int | of integers or truth values
def formula(a, b, c, d, n):
    return -np.sign(n - 2)

### np floor int | of integers or truth values
def formula(a, b, c, d, n):
    return -np.floor(n - 2)

### np mod int | of integers or truth values
def formula(a, b, c, d, n):
    return -np.mod(n, 2)

### np abs bool | of integers or truth values
def formula(a, b, c, d, n):
    return float(np.abs(a > 0.0) + np.abs(b > 0.0))

### np.bool neg | the negative of a truth value
def formula(a, b, c, d, n):
    return float(-(np.sin(a) > 0.0))

### np.float64 compare big int | an integer that is no float
def formula(a, b, c, d, n):
    return 1.0 if np.sin(a) * 0.0 + 2.0**53 == 2**53 + 1 else 2.0

### np bool index | a truth value as an index
def formula(a, b, c, d, n):
    return [b, c][np.sin(a) > 0.0]

### bool index of array | a mask
ROW = np.array([0.5, -1.25])
def formula(a, b, c, d, n):
    return float(np.sum(ROW[a > 0.0]))

### isinstance array entry | `isinstance` of a number
INTS = np.array([1, 2, 3, 4, 5])
def formula(a, b, c, d, n):
    return 1.0 if isinstance(INTS[n], int) else 2.0

### type array entry | `type` of a number
ROW = np.array([1., 2, 3, 4, 5])
def formula(a, b, c, d, n):
    return 1.0 if type(ROW[n]) is float else 2.0

### monkeypatched wraps
@record
class B(Record):
    k: float = 2.0
    def pull(self, x: float) -> float: return self.k * x
def twice(f):
    @functools.wraps(f)
    def w(self, x): return 2.0 * f(self, x)
    return w
W = B()
def formula(a, b, c, d, n):
    return W.pull(a)
#> patched: B.pull = twice(B.pull)

### wraps of wrapped
@record
class B(Record):
    k: float = 2.0
    def pull(self, x: float) -> float: return self.k * x
def twice(f):
    @functools.wraps(f)
    def w(self, x): return 2.0 * f(self, x)
    return w
@record
class C(B):
    pull = twice(B.pull)
W = C()
def formula(a, b, c, d, n):
    return W.pull(a)

### slice from generator
def formula(a, b, c, d, n):
    x = [a, b, c, d]
    x[1:3] = (v * 2.0 for v in (a, b))
    return tuple(x)

### np.out | changes an array in place
X = np.array([1.0, 2.0])
def formula(a, b, c, d, n):
    np.add(X, 1.0, out=X)
    return a * X[0]

### np.vectorize | is not known
K = 2.0
F = np.vectorize(lambda x: K * x)
def formula(a, b, c, d, n):
    return a * float(F(2.0))
#> other: K = 5.0

### np.poly1d | is not known
P = np.poly1d([1.0, 2.0])
def formula(a, b, c, d, n):
    return a * P(2.0)
#> other: P = np.poly1d([1.0, 5.0])

### np.frompyfunc | is not known
K = 2.0
F = np.frompyfunc(lambda x: K * x, 1, 1)
def formula(a, b, c, d, n):
    return a * F(2.0)
#> other: K = 5.0

### instancecheck
class M(type):
    def __instancecheck__(cls, x): return FLAG
FLAG = True
class P(metaclass=M): pass
W = object.__new__(P)
class Q: pass
q = Q()
def formula(a, b, c, d, n):
    return a if isinstance(q, P) else b
#> flag: FLAG = False

### abc register
class P(abc.ABC): pass
class Q: pass
q = Q()
def formula(a, b, c, d, n):
    return a if isinstance(q, P) else b
#> registered: P.register(Q)

### protocol
@typing.runtime_checkable
class P(typing.Protocol):
    def f(self): ...
class Q: pass
q = Q()
def formula(a, b, c, d, n):
    return a if isinstance(q, P) else b
#> method added: Q.f = lambda self: 1.0

### mixins and super
class Scale:
    def f(self, x): return 2.0 * super().f(x)
class Shift:
    def f(self, x): return 1.0 + super().f(x)
class Root:
    def f(self, x): return x
class C(Scale, Shift, Root): pass
W = C()
def formula(a, b, c, d, n):
    return W.f(a)
#> other base order: C = type("C", (Shift, Scale, Root), {"__module__": C.__module__}); W = C()
#> bases changed: C.__bases__ = (Scale, Root)

### bases changed in place
class A1:
    def f(self, x): return x
class A2:
    def f(self, x): return 2*x
class C(A1): pass
W = C()
def formula(a, b, c, d, n):
    return W.f(a)
#> bases: C.__bases__ = (A2,)

### cached property reads global
K = 2.0
class P:
    @functools.cached_property
    def gain(self): return K * 2
W = P()
def formula(a, b, c, d, n):
    return W.gain * a
#> global, same object: K = 5.0
#> new object: W = P()

### methods in dict
class W:
    k = 2.0
    def f(self, x): return self.k * x
    LAWS = {"f": f}
w = W()
OPS = {"m": w.f, "u": W.f, "l": lambda x: x + 1.0, "s": math.sin}
def formula(a, b, c, d, n):
    return OPS["m"](a) + OPS["u"](w, b) + OPS["l"](c) + W.LAWS["f"](w, a)
#> class attr: W.k = 5.0
#> instance attr: w.k = 6.0
#> entry: OPS["l"] = abs

### callable fields
@record
class P(Record):
    law: Callable[[float], float] = math.sin
    def f(self, x): return self.law(x)
W = P()
def formula(a, b, c, d, n):
    return W.f(a if abs(a) < 10 else 1.0)
#> other: W = P(math.cos)

### __getattr__
class P:
    def __init__(self): self.d = {"k": 2.0}
    def __getattr__(self, name):
        if name == "d": raise AttributeError
        return self.d[name]
W = P()
def formula(a, b, c, d, n):
    return W.k * a
#> dict: W.d["k"] = 5.0
#> own: W.k = 7.0

### __getattr__ record
@record
class P(Record):
    k: float = 2.0
    def __getattr__(self, name):
        if name.startswith("_"): raise AttributeError(name)
        return self.k * 3.0
    def f(self, x): return self.twice * x
W = P()
def formula(a, b, c, d, n):
    return W.f(a)
#> other: W = P(5.0)

### metaclass property
class M(type):
    @property
    def k(cls): return K * 2
K = 1.0
class P(metaclass=M): pass
def formula(a, b, c, d, n):
    return P.k * a
#> global: K = 5.0

### namedtuple
class P(NamedTuple):
    x: float
    y: float = 2.0
p = P(1.0)
def formula(a, b, c, d, n):
    u, v = p
    return p.x * a + p[1] * b + u + v + len(p)
#> other: p = P(3.0, 4.0)

### descriptors
class D:
    def __get__(self, o, t=None): return 2.0 * K
K = 1.0
class P:
    k = D()
W = P()
def formula(a, b, c, d, n):
    return W.k * a
#> global: K = 5.0

### dict iteration
M = {"x": 1.0, "y": 2.0}
def formula(a, b, c, d, n):
    return sum(v * a for k, v in M.items() if k != "x") + len(M)
#> order: M = {"y": 2.0, "x": 1.0, "q": 3.0}

### record in a set | a key of a set or a dict
@record
class P(Record):
    x: float = 1.0
S = {P(0.5), P(1.0)}
def formula(a, b, c, d, n):
    return 1.0 if P(a) in S else 2.0

### record among the keys of a dict | a key of a set or a dict
@record
class P(Record):
    x: float = 1.0
S = {P(0.5): 2.0}
def formula(a, b, c, d, n):
    return 1.0 if P(a) in S else 2.0

### whole number beside a large float
def formula(a, b, c, d, n):
    k = n * 2**52 + 1
    truths = (k > 2.0**53, k >= 2.0**53, k == 2.0**53, k != 2.0**53, 2.0**53 < k, -k == -2.0**53,
              k < 1e300, k < math.inf, k != math.nan, k > 2.0**64, k > 0.5)
    return [1.0 if x else 0.0 for x in truths]

### loop up to a large float
def formula(a, b, c, d, n):
    k, turns = n * 2**52 + 1, 0.0
    while k <= 2.0**53 and turns < 40.0:
        k, turns = k - 1, turns + 1.0
    return turns

### complex on one way | Complex\(x, 0.0\) on every way
def formula(a, b, c, d, n):
    z = Complex(a, b) if a > 0.0 else 0.1
    v = Complex(d, 0.7) / z
    return v.re, v.im

### class of complex on one way | Complex\(x, 0.0\) on every way
def formula(a, b, c, d, n):
    z = Complex(a, b) if a > 0.0 else c
    return 1.0 if isinstance(z, Complex) else 2.0

### complex on both ways
def formula(a, b, c, d, n):
    z = Complex(a, b) if a > 0.0 else Complex(0.1, 0.0)
    v = Complex(d, 0.7) / z
    return v.re, v.im

### derivative in a set | of what is no key
S = {(0.5, 2), (1.0, 3)}
def formula(a, b, c, d, n):
    return derivative(lambda x: x * 2.0 if (x, n) in S else x, a, 1.0)

"""


def cases() -> list[Any]:
    found = []
    for block in PROGRAMS.split("### ")[1:]:
        head, _, body = block.partition("\n")
        name, _, told = head.partition(" | ")
        found.append(pytest.param(body, told, id=name.strip().replace(" ", "_")))
    return found


@pytest.mark.sample(30)
@pytest.mark.parametrize(("program", "told"), cases())
def test_as_in_python_or_refused(program: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "store", lambda *_: None)
    monkeypatch.chdir(tmp_path)
    text, *changes = program.split("#> ")
    module = worlds.module_from(HEADER + text, tmp_path, f"ordinary_{abs(hash(program))}")
    refused = [said(module)]
    for change in changes:
        exec(change.partition(": ")[2], vars(module))
        refused.append(said(module))
    assert re.search(told, refused[0]) if told else not any(refused), refused


def test_a_function_of_math_that_the_user_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    def size(x: float) -> float:
        return 3.0

    assert said(SimpleNamespace(formula=absolute)) == ""
    monkeypatch.setattr(math, "fabs", size)
    assert said(SimpleNamespace(formula=absolute)) == ""


def absolute(a: Any, b: Any, c: Any, d: Any, n: Any) -> Any:
    return math.fabs(a)


def said(module: Any) -> str:
    """What the compiler says against the formula; '' if it gives CPython's bits."""
    expected = [truth(module.formula, row) for row in ROWS]
    width = max([len(values) for values in expected if isinstance(values, list)], default=1)
    try:
        found = worlds.outcomes(module.formula, ROWS, width, 2, 1)
    except NotCompilable as error:
        return str(error)
    for row, right, (values, fine) in zip(ROWS, expected, found, strict=True):
        what = f"{row}: {worlds._shown(values)} instead of {right}"
        assert not fine or values == right, what
    return ""


def truth(formula: Any, row: list[float]) -> Any:
    try:
        return [worlds.bits(x) for x in worlds.flat(formula(*row, 2))]
    except Exception as error:
        return error


def doubled(method: Any) -> Any:
    @functools.wraps(method)
    def twice(self: Any, mu: Any) -> Any:
        return 2.0 * method(self, mu)

    return twice


@lm.record
class Round(lm.Hamiltonian):
    stiffness: float

    def energy(self, mu):
        return self.stiffness * lm.dot(mu, mu)


@lm.record
class Doubled(Round):
    energy = doubled(Round.energy)


def test_a_decorator_around_an_inherited_method_counts() -> None:
    assert Doubled(1.0).energy([1.0, 1.0, 1.0]) == 6.0
    assert np.array_equal(Doubled(1.0).gradient([1.0, 1.0, 1.0]), [4.0, 4.0, 4.0])


def test_large_floats_among_integers_are_no_failures() -> None:
    """A number beyond 2^53 that is an integer on one way and a float on another is a float."""

    def formula(a: float, b: float, n: int) -> Any:
        x = 1
        if a > 0.0:
            x = a
        return (1 / max(a, 1), max(a, 1) + max(b, 2), sum([max(b, 0), max(a, 1)]), 1 / x, max(a, 1) - b)

    worlds.same_in_all_worlds(formula, [(1e17, 3.0), (0.5, -2e300), (3e20, 4e20), (2.0, 5.0)])
