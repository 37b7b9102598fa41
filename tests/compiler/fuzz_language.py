"""Random programs over the whole of Python that formulas may use, for the comparison of CPython with native code.

Each feature is a few lines that read some of the variables a, b, c, d (floats) and n (an int known at run time), and
assign one.  They are put into the branches and loops of `fuzz.Writer`.  The formula is a method of a record with a
static field of each kind.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable
from typing import Any

import fuzz

HEADER = '''from __future__ import annotations

import enum
import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from liemech.formulas import *


class Stop(ArithmeticError):
    pass


class Colour(enum.Enum):
    RED = 1
    BLUE = 2


K = 0.75
TABLE = (0.5, -1.25, 3.0)
BIG = 2**70
STEPS = [0.25, 0.5]
ROW = np.array([0.5, -1.25, 3.0])
BONDS = {(0, 1), (1, 2), (2, 1), (2, 3)}


class Temperature(float):
    """A number with a name."""


DEGREE = Temperature(0.25)


def shifted(x):
    return x + K


def folded(x, depth):
    return x if depth == 0 else folded(0.5 * x + 1.0, depth - 1)


@record
class Base(Record):
    rate: ClassVar[float] = 1.5

    def pulled(self, x):
        return x * self.rate

    @property
    def double(self):
        return 2.0 * self.rate


@record
class Child(Base):
    stiffness: float = 2.0

    def pulled(self, x):
        return super().pulled(x) + self.stiffness


@record
class World(Record):
    gain: float = 1.25
    count: int = 3
    large: int = 2**70
    word: str = "mild"
    pair: tuple[float, ...] = (0.5, 2.0)
    nested: tuple[Any, ...] = ((1, 2.0), (True, "x"))
    nothing: Any = None
    flag: bool = True
    colour: Colour = Colour.RED
    function: Callable[[float], float] = shifted
    child: Child = Child()
    scalar: Any = np.float64(0.3)
    place: Vec = Vec(1.0, -2.0)

    @staticmethod
    def mixed(x, y):
        return x - 0.5 * y

    @classmethod
    def named(cls, x):
        return x * len(cls.__name__)

    @property
    def weight(self):
        return self.gain * self.count

'''

STATIC_CHANGES = {
    "count": "4",
    "large": "2**70 + 1",
    "word": "'wild'",
    "pair": "(0.5, 2.0 + 2**-51)",
    "nested": "((1, 2), (1, 'x'))",
    "nothing": "0.0",
    "flag": "1",
    "colour": "Colour.BLUE",
    "function": "abs",
    "child": "Child(2.5)",
    "scalar": "np.float64(0.1) + np.float64(0.2)",
    "gain": "-0.0",
}
"""Other values of the static fields of the world, most of them close to the first."""

GLOBAL_CHANGES = {
    "K": "0.7500000001",
    "TABLE": "(0.5, -1.25, 4.0)",
    "BIG": "2**70 + 2**20",
    "STEPS": "[0.25, 0.75]",
    "Base.rate": "1.75",
    "DEGREE": "Temperature(0.75)",
    "BONDS": "{(2, 1), (0, 2)}",
}
"""What somebody may write to the module while the process runs."""


class Language(fuzz.Writer):
    """Writes a module with the record `World`, whose method `formula(self, a, b, c, d, n)` is the program."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.used: list[str] = []
        self.chosen = self.random.sample(FEATURES, 3)

    def module(self) -> str:
        return HEADER + textwrap.indent(self.formula("formula", "self, a, b, c, d, n", 2), "    ")

    def statement(self, indent: int, depth: int, loops: tuple[str, ...]) -> bool:
        r = self.random
        if r.random() < 0.4:
            feature = r.choice(self.chosen)
            self.used.append(feature.__name__)
            for line in feature(self).split("\n"):
                self.put(indent, line)
            return False
        return super().statement(indent, depth, loops)

    def fill(self, text: str) -> str:
        """The text with `E` replaced by expressions, `C` by conditions, `X` and `Y` by variables,
        `V1`, `V2` ... by fresh names.
        """
        r = self.random
        out: list[str] = []
        names: dict[str, str] = {}
        x, y = r.sample(fuzz.NAMES, 2)
        for word in re.findall(r"\w+|\W", text):
            if word == "E":
                out.append(self.expression(int(r.random() < 0.4)))
            elif word == "C":
                out.append(self.condition(0))
            elif word in ("X", "Y"):
                out.append({"X": x, "Y": y}[word])
            elif word[:1] == "V" and word[1:].isdigit():
                if word not in names:
                    self.fresh += 1
                    names[word] = f"v{self.fresh}"
                out.append(names[word])
            else:
                out.append(word)
        return "".join(out)


def one_of(name: str, lines: str, paragraphs: str = "") -> Callable[[Language], str]:
    """A feature with these forms: each line is one, and each paragraph."""

    def feature(writer: Language) -> str:
        return writer.fill(writer.random.choice(forms))

    forms = [form for form in (*lines.strip().split("\n"), *paragraphs.strip().split("\n\n")) if form]
    feature.__name__ = name
    feature.forms = forms  # type: ignore[attr-defined]
    return feature


FEATURES = [
    one_of(
        "arrays of the run",
        """
X = np.array([E, E, 1.0])[1]
X = (ROW * E)[2]
X = (E - ROW)[0] + (ROW / (abs(E) + 0.5))[1]
X = dot(np.array([E, E, E]), vec(E, 1.0, E))
X = norm(ROW * E)
X = max(np.array([E, E]) * 2.0)
X = (np.array([[E, 1.0], [E, E]]) * E).T[0, 1]
X = (mat((E, 1.0), (E, 2.0)) @ np.array([E, E]))[0]
X = (np.array([E, E]) - [E, 1.0])[1]
X = (np.array([E, E])**2)[0] + (np.array([E, 2.0])**2.0)[1]
X = (np.array([E, E]) @ np.array([E, E]))
X = float((ROW * E).sum())
X = np.cross(np.array([E, E, 1.0]), ROW)[1]
X = np.array([E, E, E])[n % 3] * E
X = np.sqrt(np.array([abs(E), 2.0]))[0]
X = derivative(lambda s: (np.array([s * E, s]) * s)[0], E)
X = derivative(lambda s: dot(ROW * s, vec(s, E, s * s)), E)
X = (np.array([E, E]) + np.array([E, 2.0]) if C else np.array([E, 1.0]))[1]
X = len(np.array([E, E])) * E
X = (np.eye(3) * E + np.ones((3, 3)))[1, 1]
""",
        """
V1 = np.array([E, E])
V1[0] = E
X = V1[0]

V1 = np.array([E, E])
V1 += 1.0
X = V1[1]

V1 = np.array([E, E])
if V1[0] > E:
    V1 = V1 * 2.0
X = V1[0]

V1 = np.array([E, E])
for V2 in range(n):
    V1 = 0.5 * V1 + np.array([E, 1.0])
X, Y = V1

for V1 in np.array([[E, 1.0], [E, E]]):
    X = X + V1[0] * V1[1]
""",
    ),
    one_of(
        "vectors as arrays",
        """
X = (vec(E, E) + 1.0)[0] - (E - vec(E, 1.0))[1]
X = (vec(E, E) % 0.75)[0]
X = vec(E, E, E).max() - vec(E, E).min()
X = vec(E, E, 1.0).mean() * vec(E, E).prod() + vec(E, E).sum()
X = mat((E, 1.0), (E, E)).trace() + mat((E, E), (1.0, E)).max()
X = (mat((E, 1.0), (E, E))**2 + 1.0)[0, 1]
X = (1.0 / mat((E, 1.0), (2.0, E)))[1, 1]
X = mat((E, E), (1.0, E)).sum(axis=0)[1] + np.sum(mat((E, E), (1.0, E)), axis=1)[0]
X = np.sum(mat((E, E), (1.0, E))) + np.mean(vec(E, E))
X = np.max(vec(E, E)) - np.min(mat((E, 1.0), (E, E)))
X = np.linalg.norm(mat((E, 1.0), (E, E)))
X = np.roll(vec(E, E, E), n)[1]
X = np.roll(vec(E, E, E), 1)[2] + np.diff(vec(E, E, E))[1]
X = np.concatenate([vec(E, E), vec(1.0, E)])[3]
X = np.stack([vec(E, E), vec(1.0, E)], axis=1)[0, 1]
X = np.vstack([vec(E, E), vec(1.0, E)])[1, 0] + np.hstack([vec(E, E), vec(1.0, E)])[2]
X = np.einsum("ij,j->i", mat((E, 1.0), (E, E)), vec(E, E))[1]
X = np.einsum("ij,ij", mat((E, 1.0), (E, E)), mat((E, 2.0), (1.0, E)))
X = np.tensordot(mat((E, 1.0), (E, E)), mat((E, 2.0), (1.0, E)))
X = np.kron(vec(E, E), vec(1.0, E))[2]
X = np.trace(mat((E, 1.0), (E, E))) + np.diag(mat((E, 1.0), (E, E)))[1]
X = np.clip(vec(E, E), -0.5, E)[0]
X = np.fmod(vec(E, E), 0.75)[1]
X = derivative(lambda s: (vec(s, E) ** 2 + 1.0).prod() + mat((s, 1.0), (E, s)).trace(), E)
X = derivative(lambda s: np.max(vec(s, E)) * np.linalg.norm(vec(s, E)), E)
""",
    ),
    one_of(
        "NumPy's functions of numbers",
        """
X = np.where(a > b, E, E)
X = np.where(C, 1.0, E) * E
X = np.where(a > b, 1, 2) * E
X = np.clip(E, -0.5, 0.5)
X = np.clip(E, E, None)
X = np.clip(E, 0, 1)
X = np.interp(E, [-1.0, 0.0, 0.5, 2.0], [1.0, E, 3.0, -1.0])
X = np.interp(E, ROW + [0.0, 2.0, 0.0], ROW)
X = np.searchsorted(STEPS, E) * E
X = TABLE[np.searchsorted(STEPS, E, side="right")]
X = np.fmod(E, 0.75)
X = derivative(lambda s: np.where(s > b, s * s, E), E)
X = derivative(lambda s: np.clip(s, -0.5, E) * s, E)
X = derivative(lambda s: np.interp(s, [-1.0, 0.0, 0.5, 2.0], [1.0, E, 3.0, -1.0]), E)
X = derivative(lambda s: np.fmod(s, 0.75) * s, E)
""",
    ),
    one_of(
        "functions of math under derivatives",
        """
X = derivative(lambda s: math.sin(s) * math.exp(-s * s), E)
X = derivative(lambda s: math.sqrt(s) + E, E)
X = derivative(lambda s: math.log(s, 2) * math.atan2(s, E), abs(E) + 0.5)
X = derivative(lambda s: math.hypot(s, E) + math.pow(abs(s), 1.5), E)
X = derivative(lambda s: math.fabs(s) * math.floor(s) + math.copysign(s, E), E)
X = derivative(lambda s: derivative(lambda t: math.tanh(s * t), s), E)
X = derivative(lambda s: math.asin(s), E)
""",
    ),
    one_of(
        "returns inside loops",
        """
""",
        """
def V1(x):
    y, k = 1.0, 0
    while True:
        z, k = 0.5 * (y + x / y), k + 1
        if abs(z - y) <= 1e-12 * abs(z):
            return z
        if k > 60:
            return -1.0
        y = z
X = V1(1.0 + abs(X))

def V1(x):
    for k in range(n * 20):
        x = 0.75 * x + E
        if x > E:
            return x, k
    return E, -1
X, V2 = V1(E)

def V1(x):
    k = 0
    while k < 50 + n:
        k = k + 1
        x = 0.5 * x
        if C:
            continue
        if abs(x) < 0.01:
            return vec(x, k)
        if k > 40:
            break
    else:
        return vec(E, 0.0)
    return vec(1.0, x)
X, Y = V1(E)

def V1(x):
    for k in range(60):
        for j in range(n):
            x = 0.5 * x + E
        if x > E:
            return x
    return 2.0
X = V1(E)

def V1(x):
    for k in range(40 + n):
        if x * k > E:
            if C:
                return 1.0
            return k
        x = x + 0.01
    return x
X = V1(E)
""",
    ),
    one_of(
        "dicts built step by step",
        """
X = {k: v * E for k, v in zip(("u", "v"), (E, 1.0))}["v"]
""",
        """
V1 = {}
for V2 in ("u", "v", "w"):
    V1[V2] = E * len(V1)
V1["u"] += E
X = sum(V1.values()) + V1.get("z", E)

V1 = {"u": E}
V2 = V1
V1["u"] = E
X = V2["u"]

V1 = {"u": E}
if C:
    V1["u"] = E
X = V1["u"]

V1 = {1: E, 2: 1.0}
V1[2] = V1[1] * 0.5
for V2, V3 in V1.items():
    X = X + V2 * V3
""",
    ),
    one_of(
        "closures over variables that change",
        """
""",
        """
V1 = E
V2 = lambda x: V1 * x
V1 = E
X = V2(E)

V1 = E
V2 = lambda x, k=V1: k * x
V1 = E
X = V2(E)

V1 = E
V2 = lambda x: V1 * x
if C:
    V1 = E
X = V2(E)

V2 = lambda x: X * x
X = E
X = V2(E)

V1 = [E, E]
V2 = lambda: V1[0] - V1[1]
V1[0] = E
X = V2()

V1 = [E]
V2 = lambda: V1[0]
V1.append(E)
V1[0] = E
X = V2()

V1, V2 = (lambda x: x + E), (lambda x: x * E)
X = V1(V2(E))
""",
    ),
    one_of(
        "lists with two names",
        """
""",
        """
V1 = [E, E]
V2 = V1 if C else [E, E]
V2[0] = E
X = V1[0] + V2[1]

V1, V2 = [E, E], [E]
if C:
    V2 = V1
V1[0] = E
X = V2[0]

V1 = [E]
V2 = {"a": V1}
V1[0] = E
X = V2["a"][0]

V1 = [E]
V2 = lambda x, k=V1: k[0] * x
V1[0] = E
X = V2(E)

V1 = [E, E]
V2 = [*V1]
if C:
    V2[0] = E
X = V1[0] + V2[0]

V1, V2 = [E], [E]
for V3 in range(n):
    V2[0] = E
    V2 = V1
X = V1[0]

V1, V2 = [E], [E]
for V3 in range(n):
    V2[0] = E
    V1 = [*V2]
X = V1[0] + V2[0]
""",
    ),
    one_of(
        "choices by a key, and ranges by steps",
        """
X = max((E, E, E), key=abs)
X = min(E, E, key=lambda x: (x - E) ** 2)
X = sorted((E, E, E), key=lambda x: -x)[1]
X = sorted((E, E, E), reverse=True)[0]
X = 1.0 if E in (E, 0.5, X) else 2.0
X = 1.0 if n in (1, 2, 5) else 2.0
X = ROW[n % 3] * E
""",
        """
for V1 in range(n, -3, -1):
    X = 0.5 * X + V1

for V1 in range(0, 90, 4):
    X = 0.5 * X + V1 * E
""",
    ),
    one_of(
        "lambdas made in loops",
        """
""",
        """
V1 = [lambda x: x * V2 for V2 in (1.0, 2.0, E)]
X = V1[0](E)

V1 = [lambda x, V2=V2: x * V2 for V2 in (1.0, 2.0, E)]
X = V1[0](E) + V1[1](1.0)

V1 = []
for V2 in (0.5, E):
    V1.append(lambda x: x + V2)
X = V1[0](E)

V1 = []
for V2 in (0.5, E):
    V1.append(lambda x, y=V2: x + y)
X = V1[0](E)
""",
    ),
    one_of(
        "inner functions",
        """
""",
        """
def V1(x):
    return x * X
X = E
X = V1(E)

def V1(s):
    def V2(x):
        return s * x + E
    return V2
X = V1(E)(E)

def V1(x, y=E):
    if x < y:
        return y
    return x - y
X = V1(E)

def V1(k):
    return 1.0 if k == 0 else E + V1(k - 1)
X = V1(3)

V1 = E
def V2():
    nonlocal V1
    V1 = V1 + 1.0
X = V1

def V1(*args, k=2.0):
    return sum(args) * k
X = V1(E, 1.0, k=E)
""",
    ),
    one_of(
        "iterators",
        """
""",
        """
V1 = iter((E, E, E))
X = next(V1)
Y = next(V1)

V1 = iter([E, E, E])
if C:
    X = next(V1)
Y = next(V1)

V1 = iter((E, E, E))
next(V1)
for V2 in V1:
    X = X + V2

V1 = zip((E, E), (1.0, E))
V2, V3 = next(V1)
X = V2 * V3
for V2, V3 in V1:
    X = X - V2 * V3

V1 = map(lambda x: x * X, (E, 2.0))
X = 3.0
Y = sum(V1)

V1 = enumerate((E, E, E))
for V2, V3 in V1:
    X = V3 * V2
    if C:
        break
for V2, V3 in V1:
    Y = V3 + V2

V1 = reversed([E, E, E])
X = next(V1)
X = X - next(V1, 0.5)

V1 = filter(lambda x: x > 0.0, (E, E, 1.0))
X = next(V1)

V1 = iter((0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5))
V3 = 0
while V3 < n and C:
    V3 += 1
    X = X + next(V1)
Y = next(V1)

V1 = iter((E, E, E, E))
for V2 in range(2):
    if C:
        X = next(V1)
Y = next(V1)
""",
    ),
    one_of(
        "generator expressions and sums",
        """
X = sum(x * E for x in (E, E, 0.5))
X = sum([E, E, 1e16, E, -1e16])
X = sum((E, E), E)
X = max(x - E for x in (E, E, 0.5))
X = min((E, E, E), key=lambda x: x * x)
X = 1.0 if any(x > E for x in (E, E)) else E
X = 1.0 if all([E, E < E]) else 2.0
X = math.fsum([E, E, 1e16, -1e16])
X = sum(range(n)) * E
X = float(len([x for x in (E, E, E) if x > 0.0]))
""",
        """
V1 = (x * X for x in (E, 2.0))
X = 3.0
Y = sum(V1)

V1 = sorted([E, E, E])
X, Y = V1[0], V1[2]

V1 = sorted((E, E, E), key=abs, reverse=True)
X = V1[1]
""",
    ),
    one_of(
        "assertions",
        """
assert C, f'{X} is wrong'
""",
        """
assert E < 1e6
X = E
""",
    ),
    one_of(
        "remainders",
        """
X = E % 1.5
X = E // 0.7
X, Y = divmod(E, 1.25)
X = n % 3 + n // 2
X = E % (abs(E) + 0.5)
X = -E // 2
X = (n - 5) % 3 * E
X = (n - 7) // 2 + 0.5
X = round(E, 2)
X = 1.0 * round(E)
X = E % -2.0
X, Y = divmod(n - 4, 3)
X = math.fmod(E, 0.3)
""",
    ),
    one_of(
        "integers",
        """
X = 2**70 * E
X = BIG * E
X = self.large * E
X = E / 2**65
X = (n * 2**62) * E
X = (n + 2**63 - 2) * 1.0
X = 3**(n + 45) * E
X = 1.0 if 2.0**53 == 2**53 + 1 else 2.0
X = 1.0 if E < 2**63 + n else 0.0
X = 1.0 if E * 2.0**53 == 2**53 + n else 3.0
X = n / 3 + n // 3
X = (n - 2)**3 * E
X = (7 * n + 1) / (n + 2)
X = -n * 0.0
X = 0 * -E
X = n * (2**31) * (2**31) * 0.5
X = (n << 3) + (n ^ 5) + (n & 6)
X = abs(n - 5) * E
X = int(E) + 0.5
X = (1 << 62) * n * 2 - (1 << 63)
X = float(2**63 + n) - 2.0**63
X = min(n, 2) * E + max(n, E)
X = 10**n * E
X = n == 2.0
""",
        """
V1 = 1
for V2 in range(1, n + 25):
    V1 *= V2
X = V1 * 1e-20

V1 = 1
for V2 in range(1, 23):
    V1 *= V2
X = E / V1

V1 = 2**53 + n
X = 1.0 if V1 > 2.0**53 else 0.5
""",
    ),
    one_of(
        "powers",
        """
X = E**2
X = E**-1
X = E**0.5
X = E**-1.0
X = E**n
X = 2**E
X = 2.0**E
X = abs(E)**E
X = 0**n + E
X = E**0
X = E**3.0
X = E**-2
X = n**2 * E
X = n**-1
X = n**0.5
X = (-2)**n
X = abs(E)**1.5
X = pow(E, 2)
X = E**(n - 2)
X = E**True
X = E**17
X = math.pow(abs(E), E)
X = (-8.0)**3 * E
X = E**64
X = E**65
""",
        """
V1 = -1.0
X = E**V1
""",
    ),
    one_of(
        "assignment expressions and unpacking",
        """
X = (V1 := E) + V1 * 2.0
X = Y = E
X, Y = Y, X
X = [V1 := E, V1 * 2.0][1]
""",
        """
if (V1 := E) > 0.0:
    X = V1
else:
    X = -V1

V1, *V2 = E, E, E
X = V1 + V2[0] - V2[-1]

*V1, V2 = (E, E, E)
X, Y = V1
X = X - V2

(V1, V2), V3 = (E, E), E
X = V1 * V2 - V3

V1 = [E, E, E]
X = vec(*V1)[1]

V1 = [0.0] * 3
V1[n % 3] = E
X = V1[0] - V1[1]
""",
    ),
    one_of(
        "else of loops",
        """
""",
        """
for V1 in (E, E, E):
    if V1 > 1.0:
        X = V1
        break
else:
    X = E

for V1 in range(n):
    if V1 * X > E:
        break
else:
    X = E

V1 = 0.0
while V1 < 3.0:
    V1 = V1 + 1.0
    if C:
        break
else:
    X = E

V1 = 1.0
while abs(V1) > 0.1:
    V1 = V1 * (0.25 + 0.1 * math.sin(X))
X = V1
""",
    ),
    one_of(
        "comparisons",
        """
X = 1.0 if a < b < c else 2.0
X = (a < b) + (b < c) * 2
X = (a < b) * E
X = 1.0 if a == b != c else E
X = float(a > b)
X = E if a < (V1 := E) <= c else d
X = 1.0 if not a else 0.5
X = 1.0 if (a < b) == (c < d) else 0.5
X = 2.0 if (a < b) is True else 1.0
X = 1.0 if X in (0.5, E, Y) else 0.0
X = 1.0 if n in (1, 2) else E
X = a or E
X = a and E
X = (a < b) and E
X = -(a < b) + 0.5
X = 1.0 if vec(a, b) == vec(E, E) else 0.5
X = 1.0 if (a, b) < (c, d) else 2.0
X = bool(E) + 0.5
X = 1.0 if (a < b) & (c < d) else 2.0
""",
    ),
    one_of(
        "containers",
        """
X = len((a, b, E)) * 0.5
""",
        """
V1 = [(a, b), (E, d)]
for V2, V3 in V1:
    X = X + V2 * V3

V1 = [(a, b), (c, E)]
V1[1] = (E, 1.0)
X = V1[1][0]

V1 = [a, E, c, d]
X = V1[1:][0] + V1[-1] + V1[::-1][0]

V1 = [a, E, c, d]
V1[1:3] = [E, E]
X = V1[2]

V1 = {'u': E, 'v': b}
X = V1['u'] - V1['v']

V1 = {'u': E}
V1['w'] = E
for V2 in V1:
    X = X + V1[V2]

V1 = {k: k * X for k in (1, 2)}
X = V1[2]

V1 = f'{1 + 1}'
X = 1.0 if V1 == '2' else 2.0

V1 = [E, E]
V2 = V1
V2[0] = E
X = V1[0]

V1 = (E, E) + (c,)
X = V1[n % 3]

V1 = [E, E]
V1 += [E]
X = V1[2] + V1.pop()

V1 = [E, E]
V1.insert(0, E)
X = V1[0]

V1 = [[E, E], [E, E]]
V1[0][1] = E
X = V1[0][1]

V1 = [[0.0] * 2] * 2
V1[0][0] = E
X = V1[1][0]

V1 = [E, E, E]
V1.sort()
X = V1[0]

V1 = (a, b, E)
X = V1.index(b) + 0.5

V1 = {1.0, 2.0}
X = 1.0 if E in V1 else 0.5

V1 = [x + y for x in (a, E) for y in (1.0, E) if x < y or True]
X = V1[3]

V1 = vec(E, E, E)
X = V1[0] + V1[-1] * V1[n % 3]
Y = dot(V1, V1[:2] and V1)

V1, V2 = [], ()
X = 1.0 if V1 or V2 else E
""",
    ),
    one_of(
        "the record",
        """
X = self.gain * E
X = self.count * E
X = E if self.word == 'mild' else -E
X = self.pair[n % 2]
X = self.nested[0][1] * E + self.nested[1][0]
X = E if self.nothing is None else self.nothing
X = E if self.flag else -E
X = E if self.colour is Colour.RED else -E
X = E if self.colour == Colour.BLUE else 0.5
X = self.function(E)
X = self.child.pulled(E)
X = self.child.double * E
X = self.mixed(E, E)
X = World.mixed(E, 1.0)
X = self.named(E)
X = self.weight
X = self.scalar * E
X = self.place[0] - self.place[1] * E
X = Child(E).pulled(E)
X = Child(stiffness=E).stiffness
X = Base().rate + self.child.rate * E
X = self.flag + 0.5
X = self.flag * E
X = self.colour.value * E
X = getattr(self, 'gain') + E
X = Base.rate * E
X = 1.0 if isinstance(self.child, Base) else 0.0
X = 1.0 if type(self.child) is Child else E
X = self.pair[0] / self.count
X = sum(self.pair) * E
X = self.gain / E
X = self.nested[0][0] / 2 + self.nested[1][0]
X = math.copysign(E, self.gain)
""",
        """
for V1 in self.pair:
    X = X + V1 * E
""",
    ),
    one_of(
        "globals",
        """
X = K * E
X = shifted(E)
X = TABLE[2] + E
X = STEPS[1] * E
X = folded(E, 3)
X = sum(STEPS) + E
X = BIG / 2**60 + E
X = len(TABLE) + E
X = TABLE[n % 3]
""",
        """
for V1 in TABLE:
    X = X + V1
""",
    ),
    one_of(
        "functions of Python and NumPy",
        """
X = math.hypot(E, E)
X = math.copysign(E, E)
X = math.pow(abs(E), 1.5)
X = math.log10(abs(E) + 1.0)
X = math.radians(E)
X = math.degrees(E)
X = math.sin(E) + math.pi
X = np.sin(E)
X = np.sqrt(abs(E))
X = np.pi * E
X = np.float64(2.0) * E
X = math.floor(E) + 0.5
X = math.ceil(E)
X = math.fabs(E)
X = math.exp(-abs(E))
X = math.sqrt(abs(E))
X = math.atan2(E, E)
X = math.e + math.tau
X = 1.0 if math.isfinite(E) else 0.5
X = 1.0 if math.isnan(E) else 0.5
X = np.maximum(E, E)
X = np.abs(E)
X = float(np.exp(-abs(E)))
X = np.int64(3) * E
X = math.trunc(E) * 1.0
X = math.log2(abs(E) + 1.0)
X = math.cbrt(E)
X = math.expm1(E / (1.0 + abs(E)))
X = math.log1p(abs(E))
X = np.hypot(E, E)
X = np.where(a < b, E, E)
X = np.array([1.0, 2.0])[0] * E
X = math.prod((E, E))
X = math.dist((a, b), (E, d))
X = math.gcd(12, n) * E
X = math.factorial(n) * E
X = math.log(abs(E) + 1.0, 2.0)
X = math.inf if False else E
X = float('0.5') * E
X = where(a > 0.0, 1.0, E)
X = where(a < b and c < d, E, E)
X = norm(vec(E, E))
X = isinstance(X, float) * E
X = float(n)
X = int(n) * E
X = complex(E, 1.0).real
X = abs(-E)
X = max(E, E, n)
X = min(a, b, E)
X = max(0, E)
X = min(E, 1)
X = (E).is_integer() + 0.5
""",
    ),
    one_of(
        "statements",
        """
X: float = E
pass
'a comment'
if C: X = E
X = (lambda: E)()
X = (lambda *x: x[0])(E)
""",
        """
V1 = E
del V1

V1 = E
V1 += 1
V1 -= E
V1 *= 2
X = V1

V1 = E
V1 /= 3
X = V1

V1 = 7
V1 //= 2
X = V1 * E

V1 = E
V1 **= 2
X = V1

try:
    X = E
except ZeroDivisionError:
    X = 0.0

with np.errstate(all='ignore'):
    X = E

match n:
    case 2:
        X = E
    case _:
        X = 0.5

import math as V1
X = V1.pi

V1 = None
if C:
    V1 = E
X = E if V1 is None else V1
""",
    ),
    one_of(
        "what things are",
        """
X = E if hasattr(X, "__len__") else E
X = E if hasattr(X, "real") and not hasattr(n, "shape") else E
X = (lambda f: f(E) if callable(f) else f)(lambda x: x + E)
X = (lambda f: f(E) if callable(f) else E)(self.function)
X = 1.0 if isinstance(n, int) else E
X = 1.0 if isinstance(C, bool) else E
X = 1.0 if isinstance(n if C else E, int) else E
X = 1.0 if type(X) is float else E
X = 1.0 if (C) is True else E
X = 1.0 if self.child is self.child else E
X = 1.0 if self.colour is Colour.RED else E
X = 1.0 if self.function is shifted else E
X = 1.0 * len(f"{self.word} {self.count}")
X = E * len("%s" % self.word)
X = E * len("%d" % n)
X = 1.0 * Temperature(0.5) + E
X = DEGREE if C else E
X = where(C, DEGREE, E)
""",
    ),
    one_of(
        "truth values beside NumPy's numbers",
        """
X = float((C) + (C))
X = float(-(C))
X = float(+(C))
X = float((np.sqrt(abs(E)) > E) + (C))
X = float((np.sin(E) > E) - (C))
X = 1.0 if (np.cos(E) > 0.0) is True else E
X = [E, E][C]
X = [E, E][np.sin(E) > 0.0]
X = float(np.maximum(n, 2)) + E
X = float(-np.sign(n - 2))
X = float(np.cos(C))
X = abs(C) * E
""",
        """
V1 = 0
for V2 in range(n):
    V1 = V1 + ((X > 0.0) + (C))
    X = np.sin(X)
Y = float(V1)

V1 = lambda x, y: float((x > 0.0) + (y > 0.0))
X = V1(E, E)
Y = V1(np.sin(E), E)
""",
    ),
    one_of(
        "pairs among known ones",
        """
X = E if (n, 1) in BONDS else E
X = E if (n - 1, n) not in BONDS else E
X = E if (1, n) in {(1, 2): 0, (2, 3): 1} else E
X = E if ((n, 1), "x") in (((2, 1), "x"), 3) else E
X = E if (E, n) in [(0.5, 2), (1.0, 3)] else E
X = E if (1, 2) in BONDS else E
""",
        """
for V1 in range(3):
    if (V1, n) in BONDS:
        X = X + E
""",
    ),
    one_of(
        "what acts where it is computed",
        """
""",
        """
V1 = iter([E, E, E])
V2 = E > 0.0 and next(V1) > E
X = next(V1)

V1 = iter([E, E, E])
V2 = C or next(V1) > E
X = next(V1)

V1 = iter([E, E, E])
V2 = E < E < next(V1)
X = next(V1) + V2

V1 = iter([E, E, E, E])
V2 = any(next(V1) > V3 for V3 in (E, E))
X = next(V1) + V2

V1, V2 = iter([0, 2, 1]), [E, E, E]
V2[next(V1)] += E
X = V2[next(V1)] - V2[0]

V1, V2 = 0, [E, E, E]
V2[(V1 := V1 + 1)] *= E
X = V2[1] + V1

V1 = [E, E, E, E]
V1[1:3] = (V2 * E for V2 in (E, E))
X = V1[1] - V1[2]

V1 = iter([lambda: (E, E), lambda: (E,)])
for V2 in next(V1)():
    X = X + V2
""",
    ),
    one_of(
        "whole numbers that become floats",
        """
""",
        """
V1 = n * 2**52 + 1 if C else 0.5
X = float(V1 - n * 2**52)

V1 = 0 if C else E
X = -abs(V1)

V1 = n if C else 0.5
V1 = V1 + V1 + 1
X = V1 / 3

V1 = 3 if C else E
for V2 in range(n):
    V1 = V1 + V1
X = V1 - 1
""",
    ),
    one_of(
        "derivatives",
        """
X = derivative(lambda x: x * x * E, E, 1.0)
X = derivative(lambda x: x * derivative(lambda y: x * y * y, E, 1.0), E, 1.0)
X = gradient(lambda v: v[0] * v[0] * v[1], vec(E, E))[0]
X = jacobian(lambda v: gradient(lambda w: dot(w, w) * w[0], v), vec(E, E))[0, 1]
X = derivative(lambda x: sin(x) * X, E, 1.0)
X = derivative(lambda x: x**3, E, 1.0)
X = derivative(lambda x: derivative(lambda y: x + y, X, 1.0), E, 1.0)
X = derivative(lambda x: derivative(lambda y: derivative(lambda z: x * y * z * z, y, 1.0), x, 1.0), E, 1.0)
X = derivative(lambda x: 2**x, E, 1.0)
X = derivative(lambda x: x if x > 0.0 else -x * x, E, 1.0)
""",
        """
V1 = E
V2 = lambda x: V1 * x * x
V1 = E
X = derivative(V2, E, 1.0)
""",
    ),
]


class Derivatives(fuzz.Writer):
    """Writes expressions of derivatives within derivatives, which `math` and `mpmath` have an opinion on too."""

    def smooth(self, names: tuple[str, ...], depth: int, level: int) -> str:
        """An expression of these variables, with derivatives up to this level inside."""
        r = self.random
        if depth == 0:
            return r.choice([*names, *names, "0.5", "1.25"])
        one = lambda: self.smooth(names, depth - 1, level)  # noqa: E731
        kinds = [
            lambda: f"({one()} + {one()})",
            lambda: f"({one()} * {one()})",
            lambda: f"({one()} * {one()})",
            lambda: f"({one()} - {one()} * {r.choice(names)})",
            lambda: f"{r.choice(['sin', 'cos', 'tanh', 'atan'])}({one()})",
            lambda: f"exp(-0.5 * ({one()}) ** 2)",
            lambda: f"{one()} / (1.5 + ({one()}) ** 2)",
            lambda: f"({one()}) ** {r.choice(['2', '3'])}",
            lambda: f"2.0 ** sin({one()})",
            lambda: f"sqrt(1.0 + ({one()}) ** 2)",
            lambda: f"(1.0 + ({one()}) ** 2) ** cos({one()})",
        ]
        if level:
            kinds += [lambda: self.derived(names, depth, level)] * 6
        return r.choice(kinds)()

    def derived(self, names: tuple[str, ...], depth: int, level: int) -> str:
        self.fresh += 1
        inner, at = f"x{self.fresh}", self.smooth(names, depth - 1, 0)
        body = self.smooth((*names, inner, inner), max(depth - 1, 1), level - 1)
        return f"derivative(lambda {inner}: {body}, {at}, 1.0)"

    def module(self) -> str:
        lines = "".join(f"    {x} = {self.derived(('a', 'b', 'c'), 3, 3)}\n" for x in "pq")
        return (
            f"from liemech.formulas import *\n\n\ndef formula(a, b, c, d, n):\n{lines}    return vec(p, q, p * q, d)\n"
        )


class Memories(fuzz.Writer):
    """Writes a method whose steps depend on all that it remembers: numbers, whole numbers, truth
    values, vectors, tuples and records of these, within each other, all of which change.
    """

    METHODS = ("lm.RKMK(order=4)", "lm.RKMK(order=2)", "lm.CovariantVariational()", "lm.RKMK(order=3)")
    FLOATS = "0.5", "-1.25", "0.0", "-0.0", "1e-3", "3.0"
    WHOLE = "0", "1", "-3", "2**60 + 1", "-(2**61)", "17"

    def leaf(self, path: str) -> tuple[str, str]:
        """What a field is in the beginning, and after a step."""
        r = self.random
        kind = r.choice(["float", "int", "int", "bool", "vec", "mat"])
        if kind == "float":
            self.floats.append(path)
            return r.choice(self.FLOATS), "F"
        if kind == "int":
            self.whole.append(path)
            return r.choice(self.WHOLE), "I"
        if kind == "bool":
            self.truths.append(path)
            return r.choice(["True", "False"]), "B"
        if kind == "vec":
            n = r.randint(1, 4)
            self.floats += [f"{path}[{i}]" for i in range(n)]
            values = ", ".join(r.choice(self.FLOATS) for _ in range(n))
            return f"lm.vec({values})", r.choice(["lm.vec(" + ", ".join("F" * n) + ")", f"0.5 * {path}"])
        self.floats += [f"{path}[0, 1]", f"{path}[1, 0]"]
        return "lm.mat([0.5, 1.0], [-0.25, 0.0])", r.choice(["lm.mat([F, F], [F, F])", f"{path}.T"])

    def part(self, path: str, depth: int) -> tuple[str, str]:
        """A leaf, or a tuple, or a record of some parts; letters stand for what is chosen when all names are known."""
        r, choice = self.random, self.random.random()
        if depth == 0 or choice < 0.5:
            return self.leaf(path)
        n = r.randint(1, 3)
        if choice < 0.75:
            parts = [self.part(f"{path}[{i}]", depth - 1) for i in range(n)]
            return tuple("(" + "".join(f"{p[k]}, " for p in parts) + ")" for k in (0, 1))  # type: ignore[return-value]
        self.fresh += 1
        name = f"Part{self.fresh}"
        parts = [self.part(f"{path}.f{i}", depth - 1) for i in range(n)]
        self.records.append((name, n))
        return tuple(f"{name}(" + ", ".join(p[k] for p in parts) + ")" for k in (0, 1))  # type: ignore[return-value]

    def chosen(self, template: str) -> str:
        """The template with an expression in place of each letter that stands alone."""
        made: dict[str, Any] = {"F": self.bounded, "I": self.integer, "B": self.truth}
        return re.sub(r"\b[FIB]\b", lambda found: made[found[0]](), template)

    def bounded(self) -> str:
        """A number that does not grow."""
        r = self.random
        one = lambda: r.choice(self.names)  # noqa: E731
        return r.choice(
            [
                lambda: f"sin({one()} + {r.choice(self.FLOATS)})",
                lambda: f"0.5 * {one()} - 0.25 * {one()}",
                lambda: f"({one()} if {self.truth()} else -0.5 * {one()})",
                lambda: one(),
                lambda: f"cos({one()} * {one()}) / 1.5",
                lambda: f"float(({self.integer()}) % 16) / 16.0",
                lambda: f"max({one()}, min(0.5 * {one()}, {r.choice(self.FLOATS)}))",
                lambda: f"sqrt(1.0 + abs({one()})) - 1.0",
                lambda: f"[{one()}, {one()}, 0.25][n - 1]",
            ]
        )()

    def integer(self) -> str:
        """A whole number of no more than 62 bits."""
        r = self.random
        one = lambda: r.choice(self.whole)  # noqa: E731
        return r.choice(
            [
                lambda: f"({one()} + 1) % 5",
                lambda: f"({one()} % 1000 * 3 + {one()} % 17) % 19 - 4",
                lambda: f"({one()} % 2**58 * 3 + 2**59 + 7) % (2**60 - 93)",
                one,
                lambda: f"-({one()} // 3)",
                lambda: f"1 - {one()} % 2",
                lambda: f"({one()} if {self.truth()} else {r.choice(self.WHOLE)})",
                lambda: f"min({one()}, {one()})",
            ]
        )()

    def truth(self) -> str:
        r = self.random
        return r.choice(
            [
                lambda: f"(not {r.choice(self.truths)})",
                lambda: r.choice(self.truths),
                lambda: f"({r.choice(self.whole)} % 3 == {r.randint(0, 2)})",
                lambda: f"({r.choice(self.names)} > {r.choice(self.FLOATS)})",
                lambda: f"({r.choice(self.truths)} != {r.choice(self.truths)})",
            ]
        )()

    def module(self) -> str:
        """The text; its `Random()` is the method."""
        r = self.random
        self.records: list[tuple[str, int]] = []
        self.floats, self.whole, self.truths = ["mu[0]", "mu[1]"], ["m.turn"], ["m.first"]
        parts = [self.part(f"m.f{i}", 2) for i in range(r.randint(1, 4))]
        self.names = tuple(self.floats)
        fields = "".join(f"    f{i}: Any\n" for i in range(len(parts)))
        text = "from typing import Any\n\nimport liemech as lm\nfrom liemech.formulas import *\n\n\n"
        for name, n in self.records:
            text += f"@lm.record\nclass {name}(lm.Record):\n" + "".join(f"    f{i}: Any\n" for i in range(n)) + "\n\n"
        begun = ", ".join(first for first, _ in parts)
        after = ", ".join(self.chosen(then) for _, then in parts)
        self.past = r.random() < 0.5
        text += textwrap.dedent(
            f"""\
            @lm.record
            class Mem(lm.Record):
                state: Any
                turn: int
                first: bool
            {{fields}}

            @lm.record
            class Random(lm.Method):
                inner: Any = {r.choice(self.METHODS)}
                order = {2 if self.past else 1}
                symmetric = {self.past}

                def start(self, system, state, h):
                    return Mem(self.inner.start(system, state, h), 0, True, {begun})

                def observe(self, m):
                    return self.inner.observe(m.state)

                def step(self, system, t, m, h):
                    mu, n = self.inner.observe(m.state).mu, 1 + m.turn % 3
                    part = 1.0 + 0.25 * ({self.bounded()}) if {self.truth()} else 0.75 - 0.125 * sin({self.bounded()})
                    new = self.inner.step(system, t, m.state, part * h)
                    return Mem(new, {r.choice(["m.turn + 1", "(m.turn + 1) % 4", "5 - 2 * (m.turn % 3)"])}, {self.truth()}, {after})
            """
        ).replace("{fields}", fields.rstrip("\n"))
        if self.past:
            names = "".join(f", m.f{i}" for i in range(len(parts)))
            text += textwrap.indent(
                textwrap.dedent(
                    f"""
                    def past(self, m):
                        return self.inner.past(m.state), m.turn, m.first{names}

                    def resume(self, system, state, past, h):
                        return Mem(self.inner.resume(system, state, past[0], h), *past[1:])
                    """
                ),
                " " * 4,
            )
        return text


class SpecialPoints(Derivatives):
    """Writes smooth formulas of three variables with cases of their own where these are zero, equal,
    or at the end of a branch: whole expressions on both sides of it that meet with all their
    derivatives, and removable singularities as pages say.
    """

    ZERO = "sinc", "sinh_over", "expm1_over", "log1p_over", "atan_over"
    """Functions of one number whose quotients are 0/0 at zero."""

    def smooth(self, names: tuple[str, ...], depth: int, level: int) -> str:
        r = self.random
        if depth == 0 or r.random() < 0.35:
            return super().smooth(names, depth, level)
        one = lambda: self.smooth(names, depth - 1, level)  # noqa: E731
        x, y = r.choice(names), r.choice(names)
        return r.choice(
            [
                lambda: f"{r.choice(self.ZERO)}({self.special(names)})",
                lambda: f"stumpff({r.randint(1, 3)}, {x} * {x} + {y} * {y})",
                lambda: f"stumpff({r.randint(1, 3)}, {self.special(names)})",
                lambda: f"cos({x} - {y}) * {one()}",
                lambda: f"(({x}) ** {r.choice(['2', '3', '1', '4'])} + {one()})",
                lambda: f"({x} - {y}) ** {r.choice(['2', '3'])} * {one()}",
                lambda: f"{self.met(names, one())}",
                lambda: f"where({x} {r.choice(['<', '<=', '>', '>='])} {y}, {self.twice(one())})",
                lambda: f"dot(vec({x}, {one()}), vec({y}, {x}))",
                lambda: f"sqrt({x} * {x} + {y} * {y} + {r.choice(['0.5', '1.0', '2.0'])})",
                lambda: f"hypot({x}, {y}, 1.0)",
                lambda: f"atan2({x} - {y}, 1.5)",
                lambda: f"log1p({x} ** 2) + expm1({y} * {one()})",
                lambda: f"tan(0.25 * ({self.special(names)}))",
                lambda: f"sinh({self.special(names)}) * tanh({one()})",
            ]
        )()

    def special(self, names: tuple[str, ...]) -> str:
        """What is zero, or small, at special points."""
        r = self.random
        x, y = r.choice(names), r.choice(names)
        return r.choice([x, f"0.5 * ({x} - {y})", f"{x} * {y}", f"sin({x})", f"0.25 * ({x} + {y})"])

    def met(self, names: tuple[str, ...], inner: str) -> str:
        """Two ways of writing one function, on two sides of a border on which the point may lie."""
        r = self.random
        x, y = r.choice(names), r.choice(names)
        border = r.choice(
            [f"{x} {r.choice('<>')} 0.0", f"{x} {r.choice(['<=', '>='])} {y}", f"{x} > 0.0 and {y} > 0.0"]
        )
        one, other = r.choice(
            [
                (f"cos(2.0 * {x})", f"1.0 - 2.0 * sin({x}) ** 2"),
                (f"({x} + {y}) ** 2", f"{x} * {x} + 2.0 * {x} * {y} + {y} * {y}"),
                (f"exp({x} + {y})", f"exp({x}) * exp({y})"),
                (f"sinh({x})", f"0.5 * (exp({x}) - exp(-{x}))"),
                (f"({inner})", f"({inner}) + 0.0 * {y}"),
            ]
        )
        if r.random() < 0.1:  # to be refused, where the number moves
            return f"(expm1({x}) / {x} if {x} != 0.0 else 1.0)"
        return f"({one} if {border} else {other})"

    def twice(self, inner: str) -> str:
        return f"{inner}, {inner}"


SPECIAL_ROWS = (
    (0.0, 0.0, 0.0), (-0.0, 0.0, -0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 0.5), (0.5, 0.5, 0.5),
    (0.5, 0.5, -0.5), (0.5, 0.0, 0.5), (0.75, 0.75, 0.0), (1e-9, 0.0, 1e-9), (1e-160, 0.0, -1e-160), (0.5, 0.5 + 2.0**-53, 1.0),
)  # fmt: skip
"""At zero, on axes, on diagonals, and within rounding of them."""
