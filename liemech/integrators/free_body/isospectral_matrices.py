"""Isospectral steps of momenta as matrices, W' = [W, X]: the stages of `Isospectral` on groups of
matrices.

W = M^H belongs to the momentum mu, <mu, xi> = Re tr(M^H hat(xi)), and X = hat(dH/dmu).  What is
found of a stage is what it adds to W, so that a step rounds by that alone.

Of a group over the dual numbers W and X are pairs, a matrix and what eps multiplies, eps^2 = 0; their products are three.

Source: Modin and Viviani, Lie-Poisson methods for isospectral flows, Found. Comput. Math. 20 (2020).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...formulas import Complex, Mat, atan2, cos, exp, log, plain, sin, sqrt
from ...formulas.elimination import determinant, solve_matrix
from ...formulas.large import Large, distance2
from ...formulas.numbers.sizes import magnitudes
from ...groups.matrices.matrix_algebra import adjoint
from ...groups.matrices.matrix_functions import frobenius2, plus
from ...solvers import fixed_point
from ...tableaus.trees import Row
from ..rkmk import combination


def matrix_of(system: Any, mu: Any) -> Mat:
    """W of a momentum; of antihermitian matrices M itself, which moves like -M = M^H."""
    m = system.group.algebra.covector(mu)
    if system.group.over_duals:
        return system.group.pair_of_momentum(m)
    return m if system.group.keeps_lengths else adjoint(m)


def momentum_of(system: Any, w: Mat) -> Any:
    """The momentum of W: of a matrix outside of the algebra that of its orthogonal projection."""
    if system.group.over_duals:
        w = system.group.of_momentum(w)
        return system.group.algebra.pairing(w)
    return system.group.algebra.pairing(w if system.group.keeps_lengths else adjoint(w))


def velocity_of(system: Any, w: Mat) -> Mat:
    """The velocity X = hat(dH/dmu) as a matrix."""
    group = system.group
    if group.over_duals:
        if system.hamiltonian.by_pairs:
            return system.hamiltonian.velocity_pair(group.algebra, w)
        return group.pair_of_velocity(system.velocity_matrix(group.of_momentum(w)))
    return system.velocity_matrix(w if group.keeps_lengths else adjoint(w))


def midpoint(system: Any, w0: Mat, guess: Mat, method: Any, h: float) -> tuple[Mat, Mat]:
    """The matrix W in the middle of a step from W_0, and what is subtracted twice over the step:

        W_0 = (1 + P) W (1 - P),   W_1 = (1 - P) W (1 + P),   P = h X(W)/2

    that is, W = W_0 - [P, W] + P W P and W_1 = W_0 - 2 [P, W].  Raises NoConvergence.
    """
    sweep = lambda both: midpoint_sweep(system, w0, both[0], h)  # noqa: E731
    return fixed_point(sweep, (guess, plain(guess)), method, h)


def midpoint_sweep(system: Any, w0: Mat, w: Mat, h: float) -> tuple[tuple[Mat, Mat], float, float]:
    """W anew, and [P, W]; its change and its size.  Where all matrices are antihermitian W P is the
    adjoint of P W, and the new W is antihermitian to the bit.
    """
    p = each(lambda x: (0.5 * h) * x, velocity_of(system, w))
    pw = product(p, w)
    pwp = product(pw, p)
    if by_antihermitian(system):
        turned = each(antihermitian, pw)
        new = each(lambda a, b, c: (a - b) + 0.5 * antihermitian(c), w0, turned, pwp)
    else:
        turned = pw - w @ p
        new = (w0 - turned) + pwp
    return (new, turned), sqrt(apart2(new, w)), sqrt(size2(new))


def midpoint_turn(system: Any, w: Mat, h: float) -> Mat:
    """(1 + P)(1 - P)^-1 - 1: how an element turns in the step whose middle is W."""
    p = in_group(system, each(lambda x: (0.5 * h) * x, velocity_of(system, w)))
    return on_group(system.group, solve_matrix(plus(-p, 1.0), 2.0 * p))


def on_group(group: Any, turn: Mat) -> Mat:
    """The turn t of elements of a group without Cayley map, SU(n) or SL(n), whose momenta move like
    those of U(n) and GL(n): (1 + t) det(1 + t)^(-1/n) - 1.

    Multiples of the unit matrix move no momentum.
    """
    if group.why_no_cayley() is None:
        return turn
    full = plus(turn, 1.0)
    n, d = len(full), determinant(full)
    if not group.generated.complex:
        return plus(exp(log(d) * (-1.0 / n)) * full, -1.0)
    angle = atan2(d.im, d.re) * (-1.0 / n)
    if isinstance(full, Large):
        full = cos(angle) * full + sin(angle) * (full @ group.times_i)
    else:
        full = Complex(cos(angle), sin(angle)) * full
    return plus(full, -1.0)


def stages(
    system: Any, rows: tuple[Row, ...], w0: Mat, guess: tuple[Any, ...], method: Any, h: float
) -> tuple[Any, ...]:
    """Z_j = h B_j Q_j and Y_j = -h R_j B_j of all stages, B = -X:

        Q_i = 1 + sum_j a_ij Z_j,   R_i = 1 + sum_j a_ij Y_j,   W_i = Q_i W_0 R_i

    Where all matrices are antihermitian R_i is the adjoint of Q_i.  Raises NoConvergence.
    """
    sweep = lambda found: stages_sweep(system, rows, w0, found, h)  # noqa: E731
    return fixed_point(sweep, guess, method, h)


def stages_sweep(
    system: Any, rows: tuple[Row, ...], w0: Mat, found: tuple[Any, ...], h: float
) -> tuple[tuple[Any, ...], float, float]:
    """Every stage anew, each from the new ones before it; their change and their size."""
    change, size = 0.0, 0.0
    for i, row in enumerate(rows):
        q, r = increments(system, row, found)
        w = each(lambda a, b: a + b, w0, conjugated(system, w0, q, r))
        b = each(lambda x: (-h) * x, velocity_of(system, w))
        new: tuple[Mat, ...] = (each(lambda x, y: x + y, b, product(b, q)),)
        if not by_antihermitian(system):
            new = (*new, -(b + r @ b))
        for a, c in zip(new, found[i]):
            change, size = change + apart2(a, c), size + size2(a)
        found = (*found[:i], new, *found[i + 1 :])
    return found, sqrt(change), sqrt(size)


def increments(system: Any, row: Row, found: tuple[Any, ...]) -> tuple[Mat, Mat]:
    """Q - 1 and R - 1 for the weights of a row."""
    if system.group.over_duals:
        q = tuple([combination(row, [of_stage[0][k] for of_stage in found]) for k in (0, 1)])
        return q, each(adjoint, q)
    q = combination(row, [of_stage[0] for of_stage in found])
    if system.group.keeps_lengths:
        return q, adjoint(q)
    return q, combination(row, [of_stage[1] for of_stage in found])


def conjugated(system: Any, w: Mat, q: Mat, r: Mat) -> Mat:
    """(1 + q) W (1 + r) - W."""
    left = product(q, w)
    both = product(left, r)
    if by_antihermitian(system):
        return each(lambda a, b: antihermitian(a) + 0.5 * antihermitian(b), left, both)
    return (left + w @ r) + both


def by_antihermitian(system: Any) -> bool:
    """Whether velocities are antihermitian, as matrices or as both matrices of a pair: then R is the adjoint of Q."""
    return system.group.over_duals or system.group.keeps_lengths


def in_group(system: Any, x: Any) -> Mat:
    """The matrix of the algebra of the group that a velocity, or a turn, is."""
    return system.group.of_velocity(x) if system.group.over_duals else x


def product(a: Any, b: Any) -> Any:
    """A B, of pairs over the dual numbers."""
    if isinstance(a, tuple):
        return a[0] @ b[0], a[0] @ b[1] + a[1] @ b[0]
    return a @ b


def each(function: Callable[..., Any], *x: Any) -> Any:
    """A real linear function of matrices, of pairs part by part."""
    if isinstance(x[0], tuple):
        return tuple([function(*parts) for parts in zip(*x)])
    return function(*x)


def antihermitian(m: Mat) -> Mat:
    """The antihermitian difference m - m^H, twice the part of m."""
    return m.without_adjoint() if isinstance(m, Large) else m - adjoint(m)


def apart2(a: Mat, b: Mat) -> Any:
    """The squared distance |a - b|^2 of two matrices, or pairs of them, derivatives included."""
    if isinstance(a, tuple):
        return apart2(a[0], b[0]) + apart2(a[1], b[1])
    return distance2(a, b) if isinstance(a, Large) else frobenius2(magnitudes(a - b))


def size2(a: Any) -> Any:
    """The sum of the squares of the entries of a matrix, or of a pair, derivatives included."""
    return size2(a[0]) + size2(a[1]) if isinstance(a, tuple) else frobenius2(magnitudes(a))
