"""Rooted trees: the order conditions of Runge-Kutta methods, and the order that coefficients have.

A tree is the tuple of its branches: `()` is a single node, `((),)` a node with one branch.  A
method is of order p if

    sum_i b_i phi_i(tree) = 1 / gamma(tree)     for all trees with at most p nodes,
    phi_i(tree) = prod over the branches of sum_j a_ij phi_j(branch),     gamma(tree) = nodes times prod gamma(branch).

Source: Butcher, J. Austral. Math. Soc. 3 (1963); Hairer, Lubich, Wanner, Geometric Numerical
Integration, 2nd ed., III.1.
"""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Sequence

Row = tuple[float, ...]
Tree = tuple["Tree", ...]

MOST = 10
"""Orders up to this one are checked tree by tree, 1842 trees; higher ones by Butcher's simplifying assumptions."""

# what a product of two rounded numbers, given to sixteen digits, may be wrong by
_EPS = 4.0 * sys.float_info.epsilon


@functools.cache
def trees(nodes: int) -> tuple[Tree, ...]:
    """All rooted trees with this many nodes: 1, 1, 2, 4, 9, 20, 48, 115, 286, 719 of them."""
    if nodes == 1:
        return ((),)
    grafted: set[Tree] = set()
    for n in range(1, nodes):  # graft a tree of n nodes on a smaller one
        for smaller in trees(nodes - n):
            grafted |= {tuple(sorted((*smaller, branch))) for branch in trees(n)}
    return tuple(sorted(grafted))


def nodes(tree: Tree) -> int:
    """The number of nodes of a tree."""
    return 1 + sum(map(nodes, tree))


def density(tree: Tree) -> int:
    """The density gamma(tree), a product over all nodes."""
    return nodes(tree) * math.prod(map(density, tree))


def text(tree: Tree) -> str:
    """The tree in brackets: `.` is a node, `[.,[.]]` a node whose branches are a node and a node with one branch."""
    return f"[{','.join(map(text, reversed(tree)))}]" if tree else "."


class ElementaryWeights:
    """The phi_i of trees for one matrix A, each with a bound of what the rounding of A changes in it."""

    def __init__(self, A: Sequence[Row]) -> None:
        self.A = A
        self.known: dict[Tree, tuple[list[float], list[float]]] = {}
        self.grafted: dict[Tree, tuple[list[float], list[float]]] = {}

    def weights_of(self, tree: Tree) -> tuple[list[float], list[float]]:
        """The weights phi_i(tree) of all stages and their bounds."""
        if tree not in self.known:
            phi, bound = [1.0] * len(self.A), [0.0] * len(self.A)
            for branch in tree:
                for i, (f, e) in enumerate(zip(*self.graft(branch))):
                    bound[i] = bound[i] * (abs(f) + e) + abs(phi[i]) * (e + _EPS * abs(f))
                    phi[i] *= f
            self.known[tree] = phi, bound
        return self.known[tree]

    def graft(self, branch: Tree) -> tuple[list[float], list[float]]:
        """sum_j a_ij phi_j(branch) and their bounds."""
        if branch not in self.grafted:
            both = [_sum(row, *self.weights_of(branch)) for row in self.A]
            self.grafted[branch] = [s for s, _ in both], [e for _, e in both]
        return self.grafted[branch]

    def sum(self, weights: Row, tree: Tree) -> tuple[float, float]:
        """sum_i weights_i phi_i(tree) and its bound."""
        return _sum(weights, *self.weights_of(tree))

    def failing(self, weights: Row, order: int, start: int = 1) -> tuple[Tree, float] | None:
        """The first tree from `start` to `order` nodes whose condition does not hold, and what its
        sum is; None if all hold.
        """
        for n in range(start, order + 1):
            for tree in trees(n):
                weight, bound = self.sum(weights, tree)
                exact = 1.0 / density(tree)
                if not abs(weight - exact) <= bound + _EPS * exact:
                    return tree, weight
        return None


def _sum(weights: Row, phi: list[float], bound: list[float]) -> tuple[float, float]:
    terms = [w * f for w, f in zip(weights, phi)]
    return math.fsum(terms), math.fsum(abs(w) * (e + _EPS * abs(f)) for w, f, e in zip(weights, phi, bound))


def order_by_trees(A: Sequence[Row], b: Row) -> int:
    """The order of a method, at most MOST."""
    phi = ElementaryWeights(A)
    for order in range(MOST):
        if phi.failing(b, order + 1, order + 1):
            return order
    return MOST


def simplifying_assumptions(A: Sequence[Row], b: Row, c: Row) -> tuple[int, int, int]:
    """The largest p, eta, zeta for which B(p), C(eta) and D(zeta) hold.

    B(p): sum_i b_i c_i^(k-1) = 1/k,   C(eta): sum_j a_ij c_j^(k-1) = c_i^k / k,
    D(zeta): sum_i b_i c_i^(k-1) a_ij = b_j (1 - c_j^k) / k,   each for all k up to the number in brackets.
    """
    columns = [tuple(w * row[j] if j < len(row) else 0.0 for w, row in zip(b, A)) for j in range(len(b))]

    def agree(weights: Row, values: list[float], wanted: float, scale: float = 0.0) -> bool:
        total, bound = _sum(weights, values, [0.0] * len(values))
        return abs(total - wanted) <= 4.0 * (bound + _EPS * max(scale, abs(wanted)))

    def largest(holds: list[bool]) -> int:
        return holds.index(False) if False in holds else len(holds)

    ks = range(1, 2 * len(b) + 2)
    powers = {k: [x ** (k - 1) for x in c] for k in ks}
    p = largest([agree(b, powers[k], 1.0 / k) for k in ks])
    eta = largest([all(agree(row, powers[k], x**k / k) for row, x in zip(A, c)) for k in ks])
    zeta = largest(
        [all(agree(d, powers[k], w * (1.0 - x**k) / k, abs(w)) for d, w, x in zip(columns, b, c)) for k in ks]
    )
    return p, eta, zeta


def order_of(A: Sequence[Sequence[float]], b: Sequence[float], c: Sequence[float] | None = None) -> int:
    """The order of the Runge-Kutta method with these coefficients.

    A : s rows, of s entries or only those left of the diagonal; b : (s,); c : (s,), by default the
    row sums of A, as it has to be for the trees.  Up to order 10 all trees decide; a higher order
    is what the simplifying assumptions prove: B(p), C(eta), D(zeta) with p <= eta + zeta + 1 and
    p <= 2 eta + 2.  (Above 24 rounding may hide the condition that fails.)

    Source: Hairer, Lubich, Wanner, III.1, theorem 1.5; Butcher, Math. Comp. 18 (1964), theorem 7.
    """
    rows, weights = [tuple(map(float, row)) for row in A], tuple(map(float, b))
    order = order_by_trees(rows, weights)
    if order < MOST:
        return order
    nodes = tuple(map(float, c)) if c is not None else tuple(map(math.fsum, rows))
    p, eta, zeta = simplifying_assumptions(rows, weights, nodes)
    return max(MOST, min(p, eta + zeta + 1, 2 * eta + 2))
