"""Butcher tableaus: the coefficients of Runge-Kutta methods, with their claims, which they check."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from ..errors import InvalidInput, InvalidType, LawViolation
from ..formulas import record
from .coefficients import Coefficients, head_and_rows, numbers
from .trees import (
    MOST,
    ElementaryWeights,
    Row,
    density,
    nodes,
    order_by_trees,
    order_of,
    simplifying_assumptions,
    text,
    trees,
)

_CLOSE = 32.0 * sys.float_info.epsilon


@record
class ButcherTableau(Coefficients):
    """The coefficients of a Runge-Kutta method, explicit or implicit:

        c | A         k_i = f(t + c_i h, y + h sum_j a_ij k_j),
        --+--
          | b         y_new = y + h sum_j b_j k_j.

    A : s rows; of an explicit method only the entries left of the diagonal are kept.  b, c : (s,).
    b_hat : (s,), weights of a method of `embedded_order` with the same slopes; h sum_j
    (b_j - b_hat_j) k_j estimates the error.
    b_low : (s,), weights of a third method, of `low_order`, with which DOP853 stretches its
    estimate.
    interpolant : a row for every slope, the coefficients of theta, theta^2, ... in b_j(theta); the
    solution within the step is y(t + theta h) = y + h sum_j b_j(theta) k_j, accurate of
    `interpolant_order`.  It may need more slopes than the step does: A_extra, c_extra are their
    rows and nodes, each after the s stages and the extra ones before it.

    Building one checks it: the shapes, c_i = sum_j a_ij, and for b, b_hat, b_low and the
    interpolant the order conditions of all rooted trees up to the order claimed.  All compare to
    rounding.  Entries may be numbers or fractions.  Raises InvalidInput, InvalidType, or
    LawViolation with the condition that fails and the order that the coefficients have.

    Source: Butcher, J. Austral. Math. Soc. 3 (1963); Hairer, Lubich, Wanner, Geometric Numerical
    Integration, 2nd ed., II.1, III.1.
    """

    name: str
    order: int
    A: tuple[Row, ...]
    b: Row
    c: Row
    source: str = ""
    b_hat: Row = ()
    embedded_order: int = 0
    b_low: Row = ()
    low_order: int = 0
    interpolant: tuple[Row, ...] = ()
    interpolant_order: int = 0
    A_extra: tuple[Row, ...] = ()
    c_extra: Row = ()

    @classmethod
    def of(cls, A: Any, b: Any, order: int | None = None, name: str = "own tableau", **more: Any) -> ButcherTableau:
        """The tableau with the row sums of A as nodes, of the order that the trees find unless one is claimed."""
        rows = _rows(A, name, "A")
        weights = _row(b, f"{name}: b")
        if order is None:
            order = order_of(rows, weights)
        return cls(name, order, rows, weights, tuple(map(math.fsum, rows)), **more)

    # ---------------------------------------------------------------- what it is

    @functools.cached_property
    def stages(self) -> int:
        """The number of slopes of a step."""
        return len(self.b)

    @functools.cached_property
    def explicit(self) -> bool:
        """Whether every stage needs earlier ones only."""
        return not any(any(row[i:]) for i, row in enumerate(self.A))

    @functools.cached_property
    def diagonally_implicit(self) -> bool:
        """Whether the stages can be solved one after the other, though some need themselves."""
        return not self.explicit and not any(any(row[i + 1 :]) for i, row in enumerate(self.A))

    @functools.cached_property
    def fsal(self) -> bool:
        """Whether the last slope of a step is the first one of the next."""
        return self.stages > 1 and not any(self.A[0]) and self._full[-1] == self.b

    @functools.cached_property
    def stiffly_accurate(self) -> bool:
        """Whether the last stage of an implicit method is the new state."""
        return not self.explicit and self._full[-1] == self.b

    @functools.cached_property
    def embedded(self) -> bool:
        """Whether a step estimates its own error."""
        return bool(self.b_hat)

    @functools.cached_property
    def symplectic(self) -> bool:
        """Whether a step keeps quadratic invariants, b_i a_ij + b_j a_ji = b_i b_j.

        Source: Hairer, Lubich, Wanner, IV.2, theorem 2.2, and VI.4, theorem 4.3.
        """
        A, b, s = self._full, self.b, range(self.stages)
        size = max(map(abs, b)) * self._size
        return all(abs(b[i] * A[i][j] + b[j] * A[j][i] - b[i] * b[j]) <= _CLOSE * size for i in s for j in s)

    @functools.cached_property
    def symmetric(self) -> bool:
        """Whether a step back from the new state leads to the old one: the adjoint b_j - a_ij differs from A by
        the numbering of stages only.

        Source: Hairer, Lubich, Wanner, V.2, theorem 2.3.
        """
        A, b, close = self._full, self.b, _CLOSE * self._size

        def extended(partner: list[int]) -> bool:
            i = len(partner)
            for j in reversed(range(self.stages)):
                if j not in partner and abs(b[j] - b[i]) <= close:
                    tried = [*partner, j]
                    pairs = [(i, k) for k in range(i + 1)] + [(k, i) for k in range(i)]
                    if all(abs(A[tried[k]][tried[m]] + A[k][m] - b[m]) <= close for k, m in pairs):
                        return True if len(tried) == self.stages else extended(tried)
            return False

        return extended([])

    @functools.cached_property
    def stage_order(self) -> int:
        """The order to which every stage, and the step, solves a pure quadrature: the largest q with B(q) and C(q)."""
        p, eta, _ = simplifying_assumptions(self.A, self.b, self.c)
        return min(p, eta)

    @functools.cached_property
    def error_order(self) -> int:
        """The power of h with which the error estimate goes to zero; 0 without one.

        With b_low the estimate is err^2 / sqrt(err^2 + 0.01 err_low^2).
        """
        if not self.b_hat:
            return 0
        first = min(self.order, self.embedded_order) + 1
        return 2 * first - (self.low_order + 1) if self.b_low else first

    @functools.cached_property
    def bare(self) -> ButcherTableau:
        """This tableau without the stages that only its error estimate or interpolant uses."""
        used_stages: set[int] = set()
        ahead = {i for i, w in enumerate(self.b) if w}
        while ahead:
            used_stages |= ahead
            ahead = {j for i in ahead for j, a in enumerate(self.A[i]) if a} - used_stages
        keep = sorted(used_stages)
        if len(keep) == self.stages and not self.b_hat and not self.interpolant:
            return self
        A = tuple(tuple(self.A[i][j] for j in keep if j < len(self.A[i])) for i in keep)
        b, c = tuple(self.b[i] for i in keep), tuple(self.c[i] for i in keep)
        return self.shipped(self.name.partition("(")[0].rstrip(), self.order, A, b, c, self.source)

    def measured_order(self) -> int:
        """The order that the coefficients have, whatever `order` says; from trees up to 10, from
        simplifying assumptions above.
        """
        return order_of(self.A, self.b, self.c)

    def stability(self, z: complex) -> complex:
        """R(z) = 1 + z b (1 - z A)^-1 1: what a step makes of y' = lambda y, z = h lambda.

        Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., IV.3,
        proposition 3.1.
        """
        import numpy as np

        A, ones = np.array(self._full), np.ones(self.stages)
        return complex(1.0 + z * (np.array(self.b) @ np.linalg.solve(np.eye(self.stages) - z * A, ones)))

    # ---------------------------------------------------------------- the checks

    def check(self) -> None:
        """Check the laws: rows sum to nodes, and every order claimed is reached.  Raises LawViolation."""
        rows = list(zip([f"row {i + 1} of A" for i in range(self.stages)], self.A, self.c))
        rows += [(f"row {i + 1} of A_extra", row, x) for i, (row, x) in enumerate(zip(self.A_extra, self.c_extra))]
        for what, row, x in rows:
            total = math.fsum(row)
            if not abs(total - x) <= _CLOSE * (abs(x) + math.fsum(map(abs, row))):
                which = "c_extra" if what.endswith("extra") else "c"
                raise LawViolation(
                    f"{self.name}: {what} sums to {total:.15g}, but {which}_{what.split()[1]} is {x:.15g}"
                )
        phi = ElementaryWeights(self.A)
        hat, low = (self.b_hat, self.embedded_order), (self.b_low, self.low_order)
        claims = [("", self.b, self.order), (" with b_hat", *hat), (" with b_low", *low)]
        for which, weights, order in claims:
            failing = phi.failing(weights, min(order, MOST)) if weights else None
            if failing:
                tree, total = failing
                raise LawViolation(
                    f"{self.name} is not of order {order}{which}: the order condition of the tree "
                    f"{text(tree)} fails, {total:.15g} instead of 1/{density(tree)}; the order is "
                    f"{order_by_trees(self.A, weights)}"
                )
            if weights and order > MOST and (proved := order_of(self.A, weights, self.c)) < order:
                raise LawViolation(
                    f"{self.name} is not of order {order}{which} as far as is known: the trees say "
                    f"order {MOST} at least, the simplifying "
                    f"assumptions B, C, D prove order {proved}"
                )
        if self.interpolant:
            self._check_interpolant()

    def _check_interpolant(self) -> None:
        """sum_i b_i(theta) phi_i(tree) = theta^nodes / gamma(tree), power by power, and b_i(1) = b_i."""
        phi = ElementaryWeights(self.A + self.A_extra)
        for n in range(1, self.interpolant_order + 1):
            for tree in trees(n):
                for power, weights in enumerate(zip(*self.interpolant), start=1):
                    weight, bound = phi.sum(weights, tree)
                    exact = 1.0 / density(tree) if power == nodes(tree) else 0.0
                    if not abs(weight - exact) <= bound + _CLOSE * exact:
                        right = f"1/{density(tree)}" if exact else "0"
                        raise LawViolation(
                            f"{self.name}: the interpolant is not of order "
                            f"{self.interpolant_order}: in the condition of the tree {text(tree)} "
                            f"theta^{power} has the factor {weight:.15g} instead of {right}"
                        )
        for i, row in enumerate(self.interpolant):
            at_end, exact = math.fsum(row), self.b[i] if i < self.stages else 0.0
            if not abs(at_end - exact) <= _CLOSE * math.fsum(map(abs, row)):
                raise LawViolation(
                    f"{self.name}: the interpolant misses the end of the step: b_{i + 1}(1) is "
                    f"{at_end:.15g}, not {exact:.15g}"
                )

    def _tidy(self) -> None:
        """Every entry a float, every row a tuple, every shape right."""
        name = self.name
        if not isinstance(name, str):
            raise InvalidType(f"ButcherTableau: name is a string; got {name!r}")
        b, c = _row(self.b, f"{name}: b"), _row(self.c, f"{name}: c")
        A, extra = _rows(self.A, name, "A"), _rows(self.A_extra, name, "A_extra")
        c_extra = _row(self.c_extra, f"{name}: c_extra")
        interpolant = _rows(self.interpolant, name, "interpolant", "the interpolant")
        s = len(b)
        shaped: dict[str, Any] = {"A": A, "b": b, "c": c, "A_extra": extra, "c_extra": c_extra}
        shaped |= {"interpolant": interpolant}
        if not s or len(A) != s or len(c) != s:
            raise InvalidInput(
                f"{name}: A has {len(A)} rows, b {s} weights and c {len(c)} nodes; a stage has one of each"
            )
        if not _triangular(A, 0) and not all(len(row) == s for row in A):
            raise InvalidInput(
                f"{name}: the rows of A have {_lengths(A)} entries; they need {s} each, or 0, ..., {s - 1} if explicit"
            )
        if not any(any(row[i:]) for i, row in enumerate(A)):
            shaped["A"] = tuple(row[:i] for i, row in enumerate(A))
        if not _triangular(extra, s):
            raise InvalidInput(
                f"{name}: the rows of A_extra need {s}, {s + 1}, ... entries; they have {_lengths(extra)}"
            )
        if len(c_extra) != len(extra):
            raise InvalidInput(f"{name}: A_extra has {len(extra)} rows and c_extra {len(c_extra)} nodes")
        for letter in "b_hat", "b_low":
            shaped[letter] = _row(getattr(self, letter), f"{name}: {letter}")
            if shaped[letter] and len(shaped[letter]) != s:
                raise InvalidInput(f"{name}: {letter} has {len(shaped[letter])} weights, A {s} stages")
        long = _lengths(interpolant)
        if interpolant and (len(interpolant) != s + len(extra) or len(set(long)) != 1 or not long[0]):
            raise InvalidInput(
                f"{name}: the interpolant needs {s + len(extra)} rows of one length; they have {long} entries"
            )
        for letter, field, present in (
            ("b", "order", True),
            ("b_hat", "embedded_order", shaped["b_hat"]),
            ("b_low", "low_order", shaped["b_low"]),
            ("the interpolant", "interpolant_order", interpolant),
        ):
            value = getattr(self, field)
            if present and (type(value) is not int or value < 1):
                raise InvalidInput(f"{name}: {field} is the order of {letter}, a whole number from 1 on; got {value!r}")
            if not present and value:
                raise InvalidInput(f"{name}: {field} is {value!r}, but {letter} is missing")
        for field, value in shaped.items():
            object.__setattr__(self, field, value)

    @functools.cached_property
    def _full(self) -> tuple[Row, ...]:
        """The matrix A with the zeros of explicit methods."""
        return tuple(row + (0.0,) * (self.stages - len(row)) for row in self.A)

    @functools.cached_property
    def _size(self) -> float:
        """The largest of all coefficients, by its absolute value."""
        return max(map(abs, sum(self.A, self.b)))

    # ---------------------------------------------------------------- how it looks

    def __repr__(self) -> str:
        orders = f"{self.order}({self.embedded_order})" if self.b_hat else f"{self.order}"
        return f"ButcherTableau({self.name}: order {orders}, {self.stages} {'stage' if self.stages == 1 else 'stages'})"

    def __str__(self) -> str:
        """The tableau as it is printed in books; coefficients that are fractions of small numbers are shown as such."""
        lines = [(_entry(x), [_entry(a) for a in row]) for x, row in zip(self.c, self.A)]
        lines += [
            (label, [_entry(w) for w in row])
            for label, row in (("", self.b), ("", self.b_hat), ("", self.b_low))
            if row
        ]
        widths = [max((len(row[j]) for _, row in lines if j < len(row)), default=0) for j in range(self.stages)]
        left = max(len(label) for label, _ in lines)
        shown = [
            f"{label:>{left}} | {'  '.join(f'{e:>{w}}' for e, w in zip(row, widths))}".rstrip() for label, row in lines
        ]
        rule = "-" * (left + 1) + "+" + "-" * (sum(widths) + 2 * self.stages - 1)
        return "\n".join([f"{self!r}", *shown[: self.stages], rule, *shown[self.stages :]])


def printed(text: str) -> ButcherTableau:
    """A tableau of this library as books print it: its head, rows `c | a_1 a_2 ...`, then those of b, b_hat and
    b_low, then those of further slopes; behind them, after a line that says its order, the rows of the interpolant.
    """
    table, _, inner = text.partition("interpolant of order")
    order, *slopes = inner.strip().splitlines() or ["0"]
    name, orders, source, rows = head_and_rows(table)
    last = max(i for i, (label, _) in enumerate(rows) if label.startswith("b"))
    weights = {label: row for label, row in rows if label.startswith("b")}
    parts = rows[: last + 1 - len(weights)], rows[last + 1 :]
    (A, c), (A_extra, c_extra) = (
        ([row for _, row in part], numbers(" ".join(label for label, _ in part))) for part in parts
    )
    return ButcherTableau.shipped(
        name, orders[0], A, weights.pop("b"), c, source, **weights,
        **dict(zip(("embedded_order", "low_order"), orders[1:])), A_extra=A_extra, c_extra=c_extra,
        interpolant=[numbers(row) for row in slopes], interpolant_order=int(order),
    )  # fmt: skip


def _listed(value: Any, what: str) -> list[Any]:
    """The rows or entries of something iterable that is no string."""
    if isinstance(value, (str, bytes, dict)) or not isinstance(value, Iterable):
        raise InvalidType(f"{what} is a sequence; got {value!r}")
    return list(value)


def _row(value: Any, what: str) -> Row:
    """A tuple of finite floats."""
    row: list[float] = []
    for i, entry in enumerate(_listed(value, what)):
        if type(entry) is not float:
            if isinstance(entry, (str, bytes, bool, complex)) or not hasattr(entry, "__float__"):
                raise InvalidType(f"{what} has numbers as entries; entry {i + 1} is {entry!r}")
            try:
                entry = float(entry)
            except (TypeError, ValueError):
                raise InvalidType(f"{what} has numbers as entries; entry {i + 1} is {entry!r}") from None
        if not math.isfinite(entry):
            raise InvalidInput(f"{what} has finite entries; entry {i + 1} is {entry}")
        row.append(entry)
    return tuple(row)


def _rows(value: Any, name: str, field: str, shown: str = "") -> tuple[Row, ...]:
    """Rows of a field of a tableau, all of finite floats."""
    return tuple(
        _row(row, f"{name}: row {i + 1} of {shown or field}")
        for i, row in enumerate(_listed(value, f"{name}: {field}"))
    )


def _lengths(rows: Sequence[Row]) -> list[int]:
    return [len(row) for row in rows]


def _triangular(rows: Sequence[Row], first: int) -> bool:
    """Whether the rows have first, first + 1, ... entries."""
    return all(len(row) == first + i for i, row in enumerate(rows))


def _entry(x: float) -> str:
    """A coefficient in few characters."""
    from fractions import Fraction  # when needed, for an import does not wait for it

    fraction = Fraction(x).limit_denominator(1_000_000)
    return str(fraction) if float(fraction) == x else f"{x:.6g}"
