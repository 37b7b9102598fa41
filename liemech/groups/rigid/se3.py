"""The group SE(3) of rigid motions of space: rotations together with displacements.

A screw w + eps v, an angular and a linear velocity put together with eps^2 = 0, is a vector of dual
numbers, and SE(3) is the rotation group over dual numbers: every formula of SO(3) holds with

    |w + eps v|^2 = |w|^2 + eps 2 w.v,      f(|w|^2 + eps 2 w.v) = f + eps 2 (w.v) f',

the bracket is the vector product, and the displacement of tau(w + eps v) is dtau_w v, right-trivialised.  The pairing
of a momentum (Pi, P) with a screw, Pi.w + P.v, is the eps part of the scalar product with P + eps
Pi.  Hence momenta are dual vectors too, and the dual of a map made of ad is the same map with -ad:
no transpose is taken in this file.

Source: Selig, Geometric Fundamentals of Robotics, 2nd ed., chapters 4 and 9 (the principle of
transference).
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...formulas import Ambient, Element, Mat, Vec, cross, dot, mat, norm, outer, record, vec
from ...formulas.calls.batches import MEMBERSHIP
from ..bernoulli import BERNOULLI
from ..lie_algebra import Constants, LieAlgebra
from ..lie_group import LieGroup
from .rotation_coefficients import all_coefficients, bernoulli_coefficients, dexp_curvatures
from .so3 import SO3, SO3Algebra, plus, rotation_defect, turn

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from scipy.spatial.transform import RigidTransform

EPSILON_IJK = SO3Algebra().structure_constants
SCREWS: Constants = tuple(
    tuple(
        tuple(EPSILON_IJK[k % 3][i % 3][j % 3] if k // 3 == i // 3 + j // 3 else 0.0 for j in range(6))
        for i in range(6)
    )
    for k in range(6)
)
"""The Levi-Civita symbol, graded by powers of eps."""


@record
class SE3Algebra(LieAlgebra):
    """se(3): screws (w, v), angular velocity first, [(w, v), (a, u)] = (w x a, w x u + v x a).

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 14.7.
    """

    dim = 6
    structure_constants = SCREWS

    @cached_property
    def invariant_form(self) -> np.ndarray:
        """The Klein form, ((w, v), (a, u)) = w . u + v . a; adding a multiple of w . a leaves it
        invariant.  (6, 6)
        """
        return np.kron([[0.0, 1.0], [1.0, 0.0]], np.eye(3))

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """(w x a, w x u + v x a)."""
        (w, v), (a, u) = halves(xi), halves(eta)
        return join(cross(w, a), cross(w, u) + cross(v, a))

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """(Pi x w + P x v, P x w): Kirchhoff's equations are mu' = ad*_xi mu."""
        (w, v), (Pi, P) = halves(xi), halves(mu)
        return join(cross(Pi, w) + cross(P, v), cross(P, w))

    def hat(self, xi: Vec) -> Mat:
        """The matrix [[hat w, v], [0, 0]]."""
        w, v = halves(xi)
        return _matrix(SO3Algebra().hat(w), v, 0.0)

    def vee(self, matrix: Mat) -> Vec:
        """The screw of a matrix [[hat w, v], [0, 0]], w that of the antisymmetric part."""
        W, v = _parts(matrix)
        return join(SO3Algebra().vee(W), v)

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """exp(-ad) on P + eps Pi, without forming a matrix."""
        x, slope = _square(xi)
        a, b, _, a_slope, b_slope, _ = all_coefficients(x, halves(xi)[0])
        return _series_dual(xi, mu, (a, b), (slope * a_slope, slope * b_slope))

    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        """1 - b ad + c ad^2 over dual numbers, b = (1 - cos th)/th^2, c = (th - sin th)/th^3."""
        return _series(xi, eta, *_dexp(xi))

    def dexp_blocks(self, xi: Vec) -> tuple[Mat, Mat]:
        """The matrix a + eps b = 1 - b hat + c hat^2 over dual numbers: dexp_xi = [[a, 0], [b, a]]."""
        (w, v), ((k, c), (dk, dc)) = halves(xi), _dexp(xi)
        a = plus(turn(k, c, w), 1.0)
        # hat(w) hat(v) + hat(v) hat(w) = v w^T + w v^T - 2 w.v
        both = c * (outer(v, w) + outer(w, v)) + SO3Algebra().hat(k * v)
        return a, plus(turn(dk, dc, w) + both, -2.0 * (c * dot(w, v)))

    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """1 + b ad + c ad^2 on P + eps Pi."""
        return _series_dual(xi, mu, *_dexp(xi))

    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """1 + ad/2 + d ad^2 over dual numbers, d = (1 - (th/2) cot(th/2))/th^2.

        Raises OutsideChart unless |w| < 2 pi.
        """
        return _series(xi, eta, *_dexp_inv(xi))

    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """1 - ad/2 + d ad^2 on P + eps Pi.  Raises OutsideChart unless |w| < 2 pi."""
        return _series_dual(xi, mu, *_dexp_inv(xi))

    def dexp_inv_series(self, xi: Vec, eta: Vec, terms: int) -> Vec:
        """Since ad^3 = -|xi|^2 ad over dual numbers, the series is
        1 + ad/2 + (1/12 + |xi|^2/720 + ...) ad^2.
        """
        x, slope = _square(xi)
        total, total_slope = 0.0, 0.0
        # Horner's rule, for the polynomial and for its derivative
        for k in range(terms - terms % 2, 1, -2):
            total_slope = -(total + x * total_slope)
            total = BERNOULLI[k] - x * total
        first = 0.5 if terms else 0.0
        return _series(xi, eta, (first, total), None if terms < 4 else (0.0, slope * total_slope))

    def is_exp_chart(self, xi: Vec) -> bool:
        """|w| < 2 pi: less than a whole turn."""
        return SO3Algebra().is_exp_chart(halves(xi)[0])

    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = p - (dexp_xi)* mu; r and its Jacobian are those of SO(3) over dual numbers.

        A Jacobian A + eps B over dual numbers is [[B, A], [A, 0]] for the parts (eps, 1) of r and
        (1, eps) of xi.
        """
        (w, v), (Pi, P), hat = halves(xi), halves(mu), SO3Algebra().hat
        x, slope = _square(xi)
        a, b, c, a1, b1, c1 = all_coefficients(x)
        b2, c2 = dexp_curvatures(x)
        # the eps parts of a, b, c, b', c'
        da, db, dc, db1, dc1 = slope * a1, slope * b1, slope * c1, slope * b2, slope * c2
        s, ds = dot(w, P), dot(w, Pi) + dot(v, P)
        cs, dcs = c * s, c * ds + dc * s
        y, dy = cross(w, P), cross(w, Pi) + cross(v, P)
        carried = (a * P - b * y) + cs * w
        dcarried = ((a * Pi + da * P) - (b * dy + db * y)) + (cs * v + dcs * w)
        along = (b - c) * P + 2.0 * (b1 * y - (c1 * s) * w)
        dalong = ((b - c) * Pi + (db - dc) * P) + 2.0 * ((b1 * dy + db1 * y) - ((c1 * s) * v + (c1 * ds + dc1 * s) * w))
        A = outer(along, w) - outer(c * w, P) - hat(b * P)
        B = (outer(dalong, w) + outer(along, v)) - (outer(c * v + dc * w, P) + outer(c * w, Pi)) - hat(b * Pi + db * P)
        A, B = plus(A, -cs), plus(B, -dcs)
        return p - join(dcarried, carried), 1.0, _blocks(B, A, A)

    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad* of (cay w, (1 - W/2)^-1 v), without forming the matrix."""
        (w, v), (Pi, P) = halves(xi), halves(mu)
        moved = Pi - cross(half_inverse(w, v), P)
        return join(SO3Algebra().cayley_Ad_star(w, moved), SO3Algebra().cayley_Ad_star(w, P))

    def dcayley(self, xi: Vec, eta: Vec) -> Vec:
        """(a', (1 + W/2)^-1 u - v x a'/2) with a' = dcay_w a."""
        (w, v), (a, u) = halves(xi), halves(eta)
        turned = SO3Algebra().dcayley(w, a)
        return join(turned, half_inverse(-w, u) - 0.5 * cross(v, turned))

    def dcayley_dual(self, xi: Vec, mu: Vec) -> Vec:
        """((dcay_w)* (Pi + v x P/2), (1 - W/2)^-1 P)."""
        (w, v), (Pi, P) = halves(xi), halves(mu)
        return join(SO3Algebra().dcayley_dual(w, Pi + 0.5 * cross(v, P)), half_inverse(w, P))

    def dcayley_inv(self, xi: Vec, eta: Vec) -> Vec:
        """(dcay_w^-1 a, (1 + W/2)(u + v x a/2))."""
        (w, v), (a, u) = halves(xi), halves(eta)
        sheared = u + 0.5 * cross(v, a)
        return join(SO3Algebra().dcayley_inv(w, a), sheared + 0.5 * cross(w, sheared))

    def dcayley_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """((dcay_w^-1)* Pi - v x P'/2, P') with P' = (1 - W/2) P."""
        (w, v), (Pi, P) = halves(xi), halves(mu)
        turned = P - 0.5 * cross(w, P)
        return join(SO3Algebra().dcayley_inv_dual(w, Pi) - 0.5 * cross(v, turned), turned)

    def cayley_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """4 + |w|^2 times p - (dcay_xi)* mu, a polynomial; with N = Pi - v x P/2 and p = (l, m)

        ( 4 (l - Pi) + |w|^2 l + 2 w x N + 2 v x P,  4 (m - P) + |w|^2 m + 2 w x P - w (w.P) ).
        """
        (w, v), (Pi, P), (l, m) = halves(xi), halves(mu), halves(p)
        hat, square, arm, s = SO3Algebra().hat, dot(w, w), cross(v, P), dot(w, P)
        N = Pi - 0.5 * arm
        angular = 4.0 * (l - Pi) + ((square * l + cross(w, 2.0 * N)) + 2.0 * arm)
        r = join(angular, 4.0 * (m - P) + ((square * m + cross(w, 2.0 * P)) - s * w))
        # (W - 2) hat(P) = P w^T - w.P - 2 hat(P)
        angular_by_w = outer(2.0 * l, w) - hat(2.0 * N)
        angular_by_v = plus(outer(P, w) - hat(2.0 * P), -s)
        linear_by_w = plus((outer(2.0 * m, w) - outer(w, P)) - hat(2.0 * P), -s)
        return r, 4.0 + square, _blocks(angular_by_w, angular_by_v, linear_by_w)


@record
class SE3(LieGroup):
    """Rigid motions: g = [[R, p], [0, 1]] takes body coordinates to space coordinates, x_space = R
    x_body + p.

    Velocities are (w, v), momenta (Pi, P), the angular part first.  With W = hat(w) and V the
    right-trivialised dexp_w of SO(3):

        exp(w, v) = (exp w, V v),   Ad_g (a, u) = (R a, R u + p x R a),   Ad*_g (Pi, P) = (R^T (Pi - p x P), R^T P).

    `cayley` is the Cayley map of 4 by 4 matrices; `by_adjoint` has the one of the matrices Ad_g,
    6 by 6.  They agree up to the third order.

    Source: Bou-Rabee and Marsden (2009), section 4; Selig, Cayley maps for SE(3), 12th IFToMM World
    Congress (2007).
    """

    algebra = SE3Algebra()
    unit_blocks = (3, 3)  # Pi and P

    def identity(self) -> Element:
        return _matrix(SO3().identity(), vec(0.0, 0.0, 0.0))

    def compose(self, g: Element, h: Element) -> Element:
        """(R S, p + R q)."""
        (R, p), (S, q) = _parts(g), _parts(h)
        return _matrix(R @ S, p + R @ q)

    def inverse(self, g: Element) -> Element:
        """The inverse motion, (R^T, -R^T p)."""
        R, p = _parts(g)
        return _matrix(R.T, -(p @ R))

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """(R w, R v + p x R w)."""
        (R, p), (w, v) = _parts(g), halves(xi)
        turned = R @ w
        return join(turned, R @ v + cross(p, turned))

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """(R^T (Pi - p x P), R^T P)."""
        (R, p), (Pi, P) = _parts(g), halves(mu)
        return join((Pi - cross(p, P)) @ R, P @ R)

    def casimirs(self, mu: Vec) -> Vec:
        """P.P and Pi.P: |P + eps Pi|^2 is P.P + eps 2 Pi.P."""
        Pi, P = halves(mu)
        return vec(dot(P, P), dot(Pi, P))

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """|Pi| where P = 0: such orbits are spheres.  All others are told apart by P.P and Pi.P."""
        return () if mu[3:].any() else (float(np.linalg.norm(mu[:3])),)

    def scale(self, g: Element | None) -> Vec:
        """1 rad, and the distance from the origin of space (None: 1)."""
        if g is None:
            return super().scale(None)
        away = norm(_parts(g)[1])
        return vec(1.0, 1.0, 1.0, away, away, away)

    def _scales(self, g: np.ndarray) -> np.ndarray:
        x, y, z = g[:, :3, 3].T
        away = np.sqrt(x * x + y * y + z * z)
        return np.stack([np.ones(len(g))] * 3 + [away] * 3, axis=-1)

    def defect(self, g: Ambient) -> float:
        """The defect of the rotation, and how far the last row is from 0 0 0 1."""
        (a, b, c, _), (d, e, f, _), (p, q, r, _), (x, y, z, corner) = g
        return max(rotation_defect(a, b, c, d, e, f, p, q, r), abs(x), abs(y), abs(z), abs(corner - 1.0))

    def objection(self, g: np.ndarray) -> str | None:
        """The last row is not 0 0 0 1, or the rotation is none."""
        if np.abs(g[3] - [0.0, 0.0, 0.0, 1.0]).max() > MEMBERSHIP:
            return f"its last row is {g[3].tolist()}, not 0 0 0 1"
        reason = SO3().objection(g[:3, :3])
        return reason and f"of its rotation, {reason}"

    def nearest(self, g: Ambient) -> Element:
        """The nearest rotation with the same displacement."""
        R, p = _parts(g)
        return _matrix(SO3().nearest(R), p)

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Uniformly distributed rotations (Haar measure), normally distributed displacements."""
        generator = np.random.default_rng(rng)
        R = SO3().random(generator, size)
        g = np.zeros((*R.shape[:-2], 4, 4))
        g[..., :3, :3], g[..., :3, 3], g[..., 3, 3] = R, generator.normal(size=R.shape[:-1]), 1.0
        return g

    def rigid_transform(self, g: ArrayLike) -> RigidTransform:
        """Rigid motions as SciPy's class (1.16 or later); the way back is automatic: arguments may
        be of that class.

        g : (..., 4, 4).  Raises ImportError if SciPy is older.
        """
        try:
            from scipy.spatial.transform import RigidTransform
        except ImportError:
            raise ImportError('scipy.spatial.transform has no RigidTransform yet: pip install "scipy>=1.16"') from None
        return RigidTransform.from_matrix(np.asarray(g, dtype=float))

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        """The screw motion (exp w, v + b w x v + c w x (w x v)): the displacement is V v."""
        rotation, p = _screw(xi)
        return _matrix(plus(rotation, 1.0), p)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """(R + R (exp(w) - 1), p + R V v): rounded by what the step adds, not by what is there."""
        (R, p), (rotation, q) = _parts(g), _screw(xi)
        return _matrix(R + R @ rotation, p + R @ q)

    def log(self, g: Element) -> Vec:
        """(w, V^-1 p) with the rotation vector w of R, of length at most pi."""
        R, p = _parts(g)
        w = SO3().log(R)
        return join(w, SO3().dexp_inv(w, p, side="right"))

    # ---------------------------------------------------------------- Cayley map of 4 by 4 matrices

    @property
    def by_adjoint(self) -> LieGroup:
        """SE(3) with the Cayley map of 6 by 6 matrices."""
        return SE3ByAdjoint()

    def cayley(self, xi: Vec) -> Element:
        """(cay w, (1 - W/2)^-1 v)."""
        w, v = halves(xi)
        return _matrix(SO3().cayley(w), half_inverse(w, v))

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """(R + R (cay(w) - 1), p + R (1 - W/2)^-1 v)."""
        (R, p), (w, v) = _parts(g), halves(xi)
        return _matrix(SO3().compose_cayley(R, w), p + R @ half_inverse(w, v))

    def cayley_inv(self, g: Element) -> Vec:
        """(cay^-1 R, p - w x p/2).  Raises OutsideChart at half a turn."""
        R, p = _parts(g)
        w = SO3().cayley_inv(R)
        return join(w, p - 0.5 * cross(w, p))


@record
class SE3ByAdjointAlgebra(SE3Algebra):
    """se(3) with the differentials of the Cayley map of 6 by 6 matrices, those of SO(3) over dual
    numbers.
    """

    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """1 - f ad + (f/2) ad^2 on P + eps Pi, f = 4/(4 + |w|^2 + eps 2 w.v)."""
        f, df = _cayley_factor(xi)
        return _series_dual(xi, mu, (f, 0.5 * f), (df, 0.5 * df))

    def dcayley(self, xi: Vec, eta: Vec) -> Vec:
        """f (1 - ad/2) over dual numbers."""
        (w, v), (a, u) = halves(xi), halves(eta)
        f, df = _cayley_factor(xi)
        first, second = a - 0.5 * cross(w, a), u - 0.5 * (cross(w, u) + cross(v, a))
        return join(f * first, f * second + df * first)

    def dcayley_inv(self, xi: Vec, eta: Vec) -> Vec:
        """1 + ad/2 + xi (xi . )/4 over dual numbers."""
        (w, v), (a, u) = halves(xi), halves(eta)
        s, ds = 0.25 * dot(w, a), 0.25 * (dot(w, u) + dot(v, a))
        first, second = cross(w, a), cross(w, u) + cross(v, a)
        return join(a + (s * w + 0.5 * first), u + ((s * v + ds * w) + 0.5 * second))

    def dcayley_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The differential at -xi, of P + eps Pi."""
        return _exchanged(self.dcayley(-xi, _exchanged(mu)))

    def dcayley_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The inverse differential at -xi, of P + eps Pi."""
        return _exchanged(self.dcayley_inv(-xi, _exchanged(mu)))

    def cayley_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """4 + |w|^2 times p - (dcay_xi)* mu, that is, over dual numbers, with k = 1/(1 + eps 2
        w.v/(4 + |w|^2)),

        r = (4 + |w|^2) p + k (2 xi x mu - 4 mu),  where (4 + |w|^2) p - 4 mu is 4 (p - mu) + |w|^2 p.
        """
        (w, v), (Pi, P), (l, m) = halves(xi), halves(mu), halves(p)
        hat, square, across = SO3Algebra().hat, dot(w, w), cross(w, 2.0 * P)
        scale, first = 4.0 + square, across - 4.0 * P
        k = 2.0 * dot(w, v) / scale
        second = (cross(w, 2.0 * Pi) + cross(v, 2.0 * P)) - k * first
        r = join(4.0 * (l - Pi) + (square * l + second), 4.0 * (m - P) + (square * m + across))
        A = outer(2.0 * m, w) - hat(2.0 * P)
        by_v = hat(-2.0 * P) - outer(first, (2.0 / scale) * w)
        by_w = (outer(2.0 * l, w) - hat(2.0 * (Pi - k * P))) - outer(first, (2.0 / scale) * (v - k * w))
        return r, scale, _blocks(by_w, by_v, A)


@record
class SE3ByAdjoint(SE3):
    """SE(3) with the Cayley map of the matrices Ad_g, 6 by 6: that of SO(3) over dual numbers.

    It differs from that of 4 by 4 matrices in the third order of the displacement.

    Source: Selig, Cayley maps for SE(3), 12th IFToMM World Congress (2007).
    """

    algebra = SE3ByAdjointAlgebra()

    def cayley(self, xi: Vec) -> Element:
        """(cay w, dcay_w v), right-trivialised."""
        w, v = halves(xi)
        return _matrix(SO3().cayley(w), SO3Algebra().dcayley(-w, v))

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """(R + R (cay(w) - 1), p + R dcay_w v), right-trivialised."""
        (R, p), (w, v) = _parts(g), halves(xi)
        return _matrix(SO3().compose_cayley(R, w), p + R @ SO3Algebra().dcayley(-w, v))

    def cayley_inv(self, g: Element) -> Vec:
        """(w, dcay_w^-1 p), right-trivialised, with w = cay^-1 R.  Raises OutsideChart at half a turn."""
        R, p = _parts(g)
        w = SO3().cayley_inv(R)
        return join(w, SO3Algebra().dcayley_inv(-w, p))


# ------------------------------------------------------------------ screws


def halves(xi: Vec) -> tuple[Vec, Vec]:
    """The angular and the linear part."""
    return vec(xi[0], xi[1], xi[2]), vec(xi[3], xi[4], xi[5])


def join(w: Vec, v: Vec) -> Vec:
    """The vector (w, v) of two halves."""
    return vec(w[0], w[1], w[2], v[0], v[1], v[2])


def _exchanged(mu: Vec) -> Vec:
    """The momentum (Pi, P) as the dual vector P + eps Pi, and back."""
    return vec(mu[3], mu[4], mu[5], mu[0], mu[1], mu[2])


def _square(xi: Vec) -> tuple[float, float]:
    """The square |w + eps v|^2 = |w|^2 + 2 eps w.v as a pair."""
    w, v = halves(xi)
    return dot(w, w), 2.0 * dot(w, v)


Pair = tuple[float, float]


def _series(xi: Vec, eta: Vec, k: Pair, dk: Pair | None) -> Vec:
    """eta + k_1 ad eta + k_2 ad^2 eta over dual numbers with coefficients k + eps dk; dk None is
    zero.
    """
    (w, v), (a, u) = halves(xi), halves(eta)
    first, second = _dual_series(k, dk, w, v, a, u)
    return join(first, second)


def _series_dual(xi: Vec, mu: Vec, k: Pair, dk: Pair | None) -> Vec:
    """The dual of `_series`: the same with -ad, on P + eps Pi."""
    (w, v), (Pi, P) = halves(xi), halves(mu)
    first, second = _dual_series(k, dk, -w, -v, P, Pi)
    return join(second, first)


def _dual_series(k: Pair, dk: Pair | None, w: Vec, v: Vec, a: Vec, u: Vec) -> tuple[Vec, Vec]:
    """Both parts of 1 + k_1 ad + k_2 ad^2, ad = hat(w + eps v), on a + eps u."""
    y, dy = cross(w, a), cross(w, u) + cross(v, a)
    z, dz = cross(w, y), cross(w, dy) + cross(v, y)
    first, second = a + (k[0] * y + k[1] * z), u + (k[0] * dy + k[1] * dz)
    if dk is None:
        return first, second
    return first, second + (dk[0] * y + dk[1] * z)


def _dexp(xi: Vec) -> tuple[Pair, Pair]:
    """The coefficients of dexp and their slopes."""
    x, slope = _square(xi)
    _, b, c, _, b_slope, c_slope = all_coefficients(x)
    return (-b, c), (-slope * b_slope, slope * c_slope)


def _dexp_inv(xi: Vec) -> tuple[Pair, Pair]:
    """The coefficients of its inverse."""
    x, slope = _square(xi)
    d, d_slope = bernoulli_coefficients(x)
    return (0.5, d), (0.0, slope * d_slope)


def _cayley_factor(xi: Vec) -> Pair:
    """The factor 4/(4 + |xi|^2) of the Cayley map and its slope."""
    x, slope = _square(xi)
    f = 4.0 / (4.0 + x)
    return f, (-0.25 * slope) * (f * f)


def half_inverse(w: Vec, v: Vec) -> Vec:
    """(1 - W/2)^-1 v = 4/(4 + |w|^2) (v + w x v/2 + w (w.v)/4)."""
    return (4.0 / (4.0 + dot(w, w))) * (v + (0.5 * cross(w, v) + (0.25 * dot(w, v)) * w))


def _screw(xi: Vec) -> tuple[Mat, Vec]:
    """The increment of the exponential: exp(w) - 1 and V v."""
    w, v = halves(xi)
    a, b, c, _, _, _ = all_coefficients(dot(w, w), w)
    y = cross(w, v)
    return turn(a, b, w), v + (b * y + c * cross(w, y))


# ------------------------------------------------------------------ matrices


def _parts(g: Mat) -> tuple[Mat, Vec]:
    """The rotation and the displacement."""
    rotation = mat(vec(g[0, 0], g[0, 1], g[0, 2]), vec(g[1, 0], g[1, 1], g[1, 2]), vec(g[2, 0], g[2, 1], g[2, 2]))
    return rotation, vec(g[0, 3], g[1, 3], g[2, 3])


def _matrix(R: Mat, p: Vec, corner: float = 1.0) -> Mat:
    """The block matrix [[R, p], [0, corner]] of a motion."""
    return mat(vec(*R[0], p[0]), vec(*R[1], p[1]), vec(*R[2], p[2]), vec(0.0, 0.0, 0.0, corner))


def _blocks(a: Mat, b: Mat, c: Mat) -> Mat:
    """The block matrix [[a, b], [c, 0]] of halves."""
    return mat(*[vec(*a[i], *b[i]) for i in range(3)], *[vec(*c[i], 0.0, 0.0, 0.0) for i in range(3)])
