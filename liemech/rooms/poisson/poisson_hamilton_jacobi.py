"""Hamilton-Jacobi methods on every Poisson structure: each step is the motion of a linear energy."""

from __future__ import annotations

import itertools
import math
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem
from ...formulas import (
    Mat,
    Vec,
    constant,
    derivative,
    dot,
    exp,
    expm1,
    identity_matrix,
    log,
    mat,
    plain,
    record,
    vec,
    where,
)
from ...formulas.classes.remembered import Remembered
from ...formulas.derivatives import axes, gradient_to_add, tangent
from ...formulas.numbers.dual import Dual, is_series
from ...formulas.numbers.series import Series
from ...formulas.numbers.sizes import one_norms
from ...groups.linear_motion import motion_terms
from ...groups.matrices.skew_matrices import like_sizes
from ...groups.poisson_structure import LogCanonical, PoissonStructure, jacobi_sums, slopes_of
from ...integrators.implicit import Implicit
from ...integrators.memory import Memory, extrapolated
from ...integrators.motion_series import begun, series, settle, values
from ...integrators.taylor import total
from ...solvers import correction, fixed_point
from .poisson import POISSON_SYSTEMS, PoissonState

ROUNDING = 2.0**-30
"""A sum below this, relative to its terms, is zero up to the rounding of a formula."""

_obeying = Remembered()
"""The structures that were seen to obey Jacobi's identity."""


@record
class PoissonHamiltonJacobi(Implicit):
    """Steps whose generating function S solves the Hamilton-Jacobi equation of a Poisson structure to an order in h.

        y_n+1 = phi^p_1(y_n),   p = dS(x),   x = int_0^1 phi^p_s(y_n) ds,   phi^p the motion y' = B(y) p
        S = h H + (h^3/6) S_3 + (h^5/120) S_5 + ...,   S_3 = D^2H[w, w]/4,   w = B dH

    A step is the motion, for a unit of time, of a linear energy p . y, where p belongs to the mean x of that motion.
    Whatever S is, this is a Poisson map that keeps every Casimir, known or not, and the symplectic leaf.

    order : 2, 4, 6 or 8.  For every PoissonSystem and DrivenPoissonSystem, with a structure of one's own too.
    Symmetric; the energy oscillates without drift.  On a constant structure, order 2 is the implicit midpoint rule; on
    the dual of a Lie algebra this is LiePoissonHamiltonJacobi with the exponential.  Of a LogCanonical structure it is
    the method in the logarithms of the coordinates, in which the structure is constant: they keep their signs,
    whatever the step.
    Raises NoConvergence if the step is too large for the equation to be solved.

    Source: Karasev, Math. USSR Izvestiya 28 (1987), 497 (x and p as coordinates of the symplectic groupoid); Cosserat,
    arXiv:2303.15883; Ge and Marsden, Phys. Lett. A 133 (1988), 134; docs/poisson_systems.md (S_3, and the terms beyond).
    """

    title: ClassVar[str] = "Poisson Hamilton-Jacobi {0.order}"
    timed: ClassVar[bool] = True
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    analytic: ClassVar[bool] = True

    orders: ClassVar[tuple[int, ...]] = 2, 4, 6, 8  # with one, two, three or four terms of the generating function
    order: int = 4

    def require(self, system: Any) -> None:
        """A Poisson system whose structure obeys Jacobi's identity, with formulas that can be differentiated."""
        super().require(system)
        if not isinstance(system, POISSON_SYSTEMS):
            raise IncompatibleSystem(f"{self!r} needs a PoissonSystem; got {system!r}. {system.alternatives}")
        structure, dH = system.structure, gradient_of(system)
        require_jacobi(self, structure)
        y = vec(*[0.5 + 0.125 * math.cos(k) for k in range(system.dim)])
        try:
            two_terms(structure, dH, 0.5, y, 0.125)
            if self.order > 4:
                series(structure.sharp(begun(y), dH(Series(0.5, 0.125), begun(y))))[0].term(2)
        except (TypeError, AttributeError) as error:
            raise IncompatibleSystem(
                f"{self!r} differentiates the energy and the structure, and the formulas of {system!r} do not allow "
                f"it: {error}. Write them with + - * / ** and the functions of liemech.formulas (sin, exp, sqrt, ...), "
                "or use RKMK with a gradient of yours"
            ) from error
        except (ArithmeticError, ValueError):  # not in their domain
            pass

    # ---------------------------------------------------------------- one step

    def first(self, system: Any, state: PoissonState, h: float) -> Vec:  # type: ignore[override]
        """The covector p of no motion, zero."""
        return 0.0 * plain(state.y)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for the covector and follow its motion to the end."""
        structure, dH, middle = system.structure, gradient_of(system), t + 0.5 * h
        y, p = plain(memory.state.y), extrapolated(*memory.past)
        if isinstance(structure, LogCanonical) and structure.of_logarithms is not None:
            dH_u, origin, of_u = by_logarithms(system, y), vec(*[log_from_start(c) for c in y]), structure.of_logarithms
            p = self.solution(of_u, dH_u, middle, origin, p, h, (len(y),), vec(1.0))
            change = y * vec(*[expm1(c) for c in of_u.sharp(origin, p)])
        else:
            blocks = structure.unit_blocks
            p = self.solution(structure, dH, middle, y, p, h, blocks, one_norms(y, blocks))
            change, _ = structure.linear_motion(y, p)
        return self.after(memory, PoissonState(memory.state.y + change), p)

    def solution(
        self, structure: Any, dH: Any, t: float, y: Vec, guess: Vec, h: float, blocks: tuple[int, ...], sizes: Vec
    ) -> Vec:
        """The covector p = dS(x) of a step about the time t, x the mean of its motion from y.

        blocks : of the components that share a unit; sizes, beside which B dp vanishes, dp a correction.  Newton's
        method with the matrix 1 - h D^2H(x) dx/dp, wrong by O(h^3).
        """

        def sweep(p: Vec) -> tuple[Vec, Vec, Vec]:
            change, mean = structure.linear_motion(y, p)
            x = y + mean
            moved = [h * tangent(lambda z: dH(t, z), x, d, True)[1] for d in mean_by_covector(structure, x, p)]
            step = correction(identity_matrix(len(x)) - mat(*moved).T, p - self.covector(structure, dH, t, x, h))
            return p - step, one_norms(structure.sharp(x, step), blocks), sizes + one_norms(change, blocks)

        return fixed_point(sweep, guess, self, h)

    def covector(self, structure: Any, dH: Any, t: float, x: Vec, h: float) -> Vec:
        """The gradient of the generating function, p = dS(x), of a step about the time t."""
        if self.order == 2:
            return h * dH(t, x)
        if self.order == 4:
            return two_terms(structure, dH, t, x, h)
        return total(odd_terms(structure, dH, t, x, h, self.order // 2))


# -------------------------------------------------------------------- the generating function


def mean_by_covector(structure: Any, x: Vec, p: Vec) -> Mat:
    """dx/dp of the mean x of the motion y' = V(y) = B(y) p from a fixed start, to first order in p:

        B/2 + (W + W^T)/12,   W = V' B

    as y = x - V/2 + V' V/12 - ..., and DB[V] = W - W^T, since the motion keeps B.  x, p : (n,); (n, n), column by
    column.
    """
    columns = [tangent(lambda a: structure.sharp(x, a), p, unit, True)[1] for unit in axes(p)]
    bent = mat(*[tangent(lambda z: structure.sharp(z, p), x, b, True)[1] for b in columns])
    return mat(*[0.5 * b + (1.0 / 12.0) * w for b, w in zip(columns, bent + bent.T)])


def gradient_of(system: Any) -> Any:
    """The gradient dH(t, y) of the energy of a Poisson system."""
    if system.driven:
        return lambda t, y: system.gradient(t, y)
    return lambda t, y: system.gradient(y)


def log_from_start(y: Any) -> float:
    """log(y/y_0) for the value y_0 of y: zero, but for derivatives that y carries; zero of y = 0."""
    if not isinstance(y, Dual):
        return 0.0
    size = constant(y)
    return log(where(size == 0.0, 1.0, y / where(size == 0.0, 1.0, size)))


def by_logarithms(system: Any, y: Vec) -> Any:
    """The gradient by the coordinates u_i = log(y_i/y_0i), of components y_i dH/dy_i, for the values y_0 of y."""
    start = vec(*[constant(c) for c in y])

    def gradient_at(t: Any, u: Vec) -> Vec:
        y = start * vec(*[exp(c) for c in u])
        return y * system.gradient(t, y) if system.driven else system.logarithmic_gradient(y)

    return gradient_at


def two_terms(structure: Any, dH: Any, t: float, x: Vec, h: float) -> Vec:
    """h dH(x) + (h^3/6) dS_3(x) of S_3 = D^2H[w, w]/4, w = B v, v = dH:

    dS_3/6 = (d<a, B v> - D^2H B a)/12 + D^3H[w, w]/24,   a = D^2H w,  d of B alone;  the h goes with H.  Of an energy
    that changes with time, t is one more coordinate, whose rate is 1.
    """

    def along(z: Vec, w: Vec) -> Vec:
        return h * tangent(lambda z: dH(z[0], z[1:]), z, w, True)[1]

    v, at = h * dH(t, x), vec(t, *x)
    w = vec(h, *structure.sharp(x, v))
    a = along(at, w)
    curved = tangent(lambda z: along(z, w), at, w, True)[1]
    turned = gradient_to_add(lambda y: dot(a, structure.sharp(y, v)), x)
    return v + (1.0 / 12.0) * (0.5 * curved - (along(at, vec(0, *structure.sharp(x, a))) - turned))


def odd_terms(structure: Any, dH: Any, t: float, x: Vec, h: float, terms: int) -> list[Vec]:
    """p_1, p_3, ... of the covector p = s p_1 + s^3 p_3 + ... = dS(x) of the motion for the time s h, x fixed.

    The characteristics are motions y, half of the time before and after a point m.  With M the derivative by y of the
    mean of phi^p from y,

        y' = -B dH/2,   p' = the even part of q,   M^T q = dH(y),   x = the mean of phi^p from y = m + s^2 x_2 + ...

    From there m = x - s^2 x_2 - ... as a series in s^2.
    """
    n, last = len(x), 2 * terms - 2
    m = begun(x)
    y = begun(m)
    v = series(h * dH(Series(t, -0.5 * h), y))
    for component, rate in zip(y, series(structure.sharp(y, v))):
        component.grow(rate, -0.5)
    p, q = vec(*[Series(None) for _ in range(n)]), vec(*[Series() for _ in range(n)])
    for i, axis in enumerate(identity_matrix(n)):
        slopes = derivative(lambda z: mean_change(structure, z, p, last), y, axis)
        bent = vec(*[Series.holding(c) if is_series(c) else Series(None) for c in slopes])  # of s and higher powers
        q[i].by((v[i] - dot(bent, q)).term)
        p[i].grow_oddly(q[i], 1.0)
    mean = series(y + mean_change(structure, y, p, last))
    settle(m, [-vec(*[c[k] for c in mean]) for k in range(2, 2 * terms, 2)])
    return values([vec(*[c[k] for c in p]) for k in range(1, 2 * terms, 2)])


def mean_change(structure: Any, y: Vec, p: Vec, last: int) -> Vec:
    """The mean change of y on the motion y' = B(y) p, up to p^last."""
    terms = motion_terms(structure, y, p, last)
    return total([(1.0 / (k + 2)) * term for k, term in enumerate(terms)])


def require_jacobi(method: Any, structure: PoissonStructure) -> None:
    """Raise IncompatibleSystem for a matrix that breaks Jacobi's identity at one of three points: no motion keeps it."""
    if _obeying.get(structure):
        return
    n = structure.dim
    for y in ([math.cos(k + 1.0) for k in range(n)], [0.5 + 0.25 * math.sin(k) for k in range(n)], [1.0] * n):
        at = Vec.of(y)
        try:
            with np.errstate(all="ignore"):
                matrix = np.array(structure.matrix(at), dtype=float)
                slopes, terms = slopes_of(structure, at), structure.terms(at)
        except (ArithmeticError, ValueError):  # not in its domain
            continue
        units = np.outer(1.0 / like_sizes(terms), 1.0 / like_sizes(terms))
        sizes = terms + (terms / units).max() * units  # an entry may be rounding alone
        bent = np.abs(slopes) + np.where(slopes == 0.0, 0.0, sizes / np.abs(np.reshape(y, (n, 1, 1))))
        sums, bounds = jacobi_sums(slopes, matrix), ROUNDING * jacobi_sums(bent, sizes)
        for i, j, k in itertools.combinations(range(n), 3):
            if abs(sums[i, j, k]) > bounds[i, j, k]:
                raise IncompatibleSystem(
                    f"{method!r}: {structure!r} breaks Jacobi's identity at y = {tuple(y)}, for the components "
                    f"{i + 1}, {j + 1}, {k + 1} by {sums[i, j, k]:.3g}: it is no Poisson structure. "
                    "check_poisson tells more; RKMK accepts every system"
                )
    _obeying.set(structure, True)
