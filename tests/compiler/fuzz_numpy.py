"""Formulas of a vector as users of NumPy write them: NumPy itself, plain Python with a `Vec` and
native code give the same numbers, or the formula is refused.

`python tests/compiler/fuzz_numpy.py [seed]` tries all of them on random rows and prints what
differs; the tests take a sample.  Bits are compared between plain Python and native code; with
NumPy, which adds arrays in an order of its own, numbers to rounding.
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
import types
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import worlds

from liemech.errors import LiemechError, NotCompilable

GIVEN = """
import math
import numpy as np

TAB = (0.5, -1.25, 3.0)
ROW = np.array([0.5, -1.25, 3.0])
WHOLE = np.array([1, -2, 3])
SIGNS = np.array([True, False, True])
TABLE = np.arange(9.0).reshape(3, 3) - 3.0
ACROSS = np.asfortranarray(TABLE)
VIEW = np.arange(12.0)[::-2][:3]


def helper(v, s=2.0, *rest, key=1.0):
    return v[0] * s + key + sum(rest)


def makes(k):
    def inner(x):
        return k * x + 1.0

    return inner


"""

OURS = """
from liemech.formulas import Mat, Record, Vec, record, vec


@record
class World(Record):
    A: Mat = Mat((1.0, 2.0, -0.5), (0.25, -1.5, 3.0), (0.0, 0.7, 1.25))
    J: Vec = Vec(1.0, 1.5, 2.0)
    k: float = 0.75
    m: int = 3

    def formula(self, a, b, c, d, n):
        return vec(energy(self, vec(a, b, c), d, n) + 0.0)


"""

SELF = types.SimpleNamespace(
    A=np.array([[1.0, 2.0, -0.5], [0.25, -1.5, 3.0], [0.0, 0.7, 1.25]]), J=np.array([1.0, 1.5, 2.0]), k=0.75, m=3
)
"""The fields of `World` as NumPy has them."""

LINES = """
mu @ self.A @ mu
(self.A @ mu)[1] + (mu @ self.A)[1]
np.dot(self.A, mu)[0] - np.dot(mu, self.A)[2]
0.5 * mu @ (mu / self.J)
np.sum(mu**2 / self.J) / 2
mu[-1] * mu[::-1][0] + mu[::2][1]
mu[1:][0] + mu[:-1][1] + len(mu[1:])
np.linalg.norm(mu[:2]) + np.linalg.norm(self.A) * mu[0]
np.cross(mu, self.J)[2] + np.cross(self.A[0], mu)[0]
(self.A * mu)[1, 2] + (mu * self.A)[2, 0] - (self.A / self.J)[0, 1]
self.A[0] @ mu + self.A[:, 0] @ mu + self.A[1:, :2][0, 1] + self.A.T[1, 2]
np.linalg.det(self.A + np.eye(3) * mu[0])
np.linalg.inv(self.A + np.eye(3) * 5.0)[1, 2] * mu[1]
np.linalg.solve(self.A + 5.0 * np.eye(3), mu)[1]
np.outer(mu, self.J)[1, 2] + np.trace(self.A @ self.A.T)
(2.0**mu)[1] + (mu % -0.75)[0]
abs(mu)[1] + np.fabs(mu)[2] + np.sign(mu).sum()
np.maximum(mu, 0)[0] + np.minimum(mu, 0.5)[1] + np.clip(mu, -1, 1).sum()
np.where(mu > 0, mu, 0.1 * mu).sum() + np.where(mu[0] > mu[1], mu[2], -mu[2])
max(mu) - min(mu) + sum(mu) + sorted(mu)[1]
np.prod(mu) + np.mean(mu) + mu.max() + mu.min()
(self.A * self.A)[0, 1] + (self.A**2)[0, 1] + np.dot(self.A, self.A)[1, 2]
np.einsum("i,i", mu, self.J) + np.einsum("ij,i,j->", self.A, mu, mu)
np.tensordot(mu, self.A, axes=1)[1] + np.kron(mu, self.J)[5]
np.diff(mu)[1] + np.roll(mu, 1)[0] + np.diag(self.A) @ mu
np.concatenate([mu, self.J])[4] + np.stack([mu, self.J])[1, 0] + np.vstack([mu, self.J])[0, 2]
np.hypot(mu[0], mu[1]) + np.arctan2(mu[1], mu[0])
np.mod(mu[0], 0.7) + np.remainder(mu[1], -0.7) + np.fmod(mu[2], 0.7)
round(mu[0]) + int(mu[0]) + math.floor(mu[1]) + math.trunc(mu[2])
np.interp(mu[0], [-1, 0, 2], [1, 3, -1]) + np.searchsorted([0.0, 1.0, 2.0], mu[1])
(mu > 0).sum() * 1.5 + np.any(mu > 1) + sum(x > 0 for x in mu)
(mu[0] > 0) * mu[1] + (mu[1] < 0) * mu[2]
mu[0] and mu[1] or mu[2]
mu[n] + mu[n - 3] + self.A[n, 0] + self.A[n - 1][n - 2]
TAB[int(abs(mu[0])) % 3] + ROW[int(abs(mu[1])) % 3] + TABLE[int(abs(mu[0])) % 3, 1]
WHOLE @ mu + WHOLE[0] / 2 + WHOLE[1] // 2 + SIGNS @ mu
TABLE[n] @ mu + ACROSS[1] @ mu + ACROSS[n, 1] + TABLE.T[1] @ mu
VIEW @ mu + VIEW[1] * mu[0] + VIEW[n]
helper(mu) + helper(mu, 3.0, mu[1], key=mu[2]) + makes(mu[0])(mu[1])
sum(mu[i] * self.A[i, j] * mu[j] for i in range(3) for j in range(3) if i != j)
max(mu, key=abs) + min(mu, key=lambda x: (x - 1.0) ** 2)
-7 // n + -7 % n + 7 % -n + divmod(-7, n)[1] + mu[0]
round(n / 4) + round(2.5) + round(mu[0] * 2) / 2
mu[0] ** 2 + mu[0] ** 3 + mu[0] ** n
[f(mu[0]) for f in [lambda x: x + i for i in range(3)]][0]
np.linalg.norm(mu - [1, 2, 3]) + np.dot([1, 2, 3], mu) + ([1, 2, 3] @ mu) + (mu - (1, 2, 3))[2]
"""

PARAGRAPHS = """
s = 0
for x in mu:
    if x > 0:
        s = s + 1
return s / 2 + s // 2

k, x = 0, abs(mu[0]) + 1.0
while x > 0.1:
    x /= 2
    k += 1
return k / 2 + k // 2 + k % 3 + (-k) // 3

a = [0.0] * 3
for i in range(3):
    a[i] = mu[2 - i]
return a[0] + 2 * a[1]

v = mu
v += 1.0
return v[0]

a = np.array([1, 2, 3])
return (a // 2) @ mu + (a**2)[1]

total = sum(mu)
def scaled(w):
    return w * total
total = 3.0
return scaled(mu[0])

u = mu / np.linalg.norm(mu)
v = np.cross(u, [0.0, 0.0, 1.0])
return np.dot(np.cross(u, v), u) + v[0]

best, place = -math.inf, -1
for i in range(3):
    if mu[i] > best:
        best, place = mu[i], i
return best + 100 * place

e = 0.0
for row in self.A:
    e += row @ mu
for i in range(-1, 2):
    e += mu[i] * mu[i - 1]
return e
"""

FORMULAS = [*(f"return {line}" for line in LINES.strip().split("\n")), *PARAGRAPHS.strip().split("\n\n")]

SPECIAL = 0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 3.0, -2.5, 1e-310, 1e300


def rows(seed: int, count: int = 12) -> list[list[float]]:
    """Three components and a number: of all signs, some special, some equal."""
    r = random.Random(seed)
    found = []
    for _ in range(count):
        row = [r.choice(SPECIAL) if r.random() < 0.2 else r.uniform(-3.0, 3.0) for _ in range(4)]
        row[1] = row[0] if r.random() < 0.2 else row[1]
        found.append(row)
    return found


def numpy_gives(formula: Any, row: list[float]) -> float | None:
    """The number that NumPy gives; None if it raises, or gives none."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = float(formula(SELF, np.array(row[:3]), row[3], 2))
        except (ArithmeticError, ValueError):
            return None
    return found if math.isfinite(found) else None


def differences(i: int, folder: Path, seed: int, lanes: tuple[int, ...]) -> Iterator[str]:
    """What differs for a formula; raises NotCompilable."""
    lines = "".join(f"    {line}\n" for line in FORMULAS[i].split("\n"))
    text = GIVEN + f"def energy(self, mu, d, n):\n{lines}\n\n" + OURS
    module = worlds.module_from(text, folder, f"formula_of_numpy_{i}_{seed}")
    world, given = module.World(), rows(seed + i)
    plain: list[Any] = []
    for row in given:
        expected = numpy_gives(module.energy, row)
        try:
            (found,) = world.formula(*row, 2)
        except (ArithmeticError, ValueError) as error:
            if isinstance(error, LiemechError):
                raise
            plain.append(None)
            continue
        plain.append(float(found))
        if expected is not None and not math.isclose(plain[-1], expected, rel_tol=1e-11, abs_tol=1e-11):
            yield f"{FORMULAS[i]} at {row}: {plain[-1]} instead of NumPy's {expected}"
    for count in lanes:
        found = worlds.outcomes(module.World.formula, given, 1, 2, count, (world,))
        for row, one, (values, fine) in zip(given, plain, found, strict=True):
            if fine and (one is None or worlds.bits(one) != values[0]):
                yield f"{FORMULAS[i]} at {row}, {count} lanes: {values} instead of {one}"


def main(seed: int) -> None:
    """All formulas."""
    tally: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for i, formula in enumerate(FORMULAS):
            try:
                found = list(differences(i, Path(folder), seed, (1, 4)))
            except NotCompilable as error:
                found = [f"{formula} is refused: {error}"]
            tally["good" if not found else "differ"] += 1
            print(*found, sep="\n", end="\n" if found else "")
    print(dict(tally))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
