"""The group SE(2) of rigid motions of the plane.

Its bracket obeys ad^3 = -w^2 ad, as that of rotations does, so that functions of ad have the same
coefficients here and there: dexp = 1 - b ad + c ad^2, and so on, with th = |w|.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InvalidInput, OutsideChart
from ...formulas import Ambient, Element, Mat, Vec, atan2, mat, norm, outer, record, vec
from ...formulas.calls.batches import MEMBERSHIP
from ..bernoulli import BERNOULLI
from ..lie_algebra import LieAlgebra
from ..lie_group import LieGroup
from .rotation_coefficients import WHOLE_TURN, bernoulli, dexp_coefficients, exp_coefficients
from .so3 import AT_HALF_TURN, HALF_TURN, HUGE

NONE = (0.0, 0.0, 0.0)


@record
class SE2Algebra(LieAlgebra):
    """se(2): a turning rate and a velocity of the plane, (w, v), [(w, v),
    (a, u)] = (0, w J u - a J v), J a quarter turn.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 14.6.
    """

    dim = 3
    structure_constants = (  # [E1, E2] = E3, [E1, E3] = -E2
        (NONE, NONE, NONE),
        ((0.0, 0.0, -1.0), NONE, (1.0, 0.0, 0.0)),
        ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), NONE),
    )

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """(0, w J u - a J v)."""
        return vec(0.0, eta[0] * xi[2] - xi[0] * eta[2], xi[0] * eta[1] - eta[0] * xi[1])

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """(-P.J v, -w J P)."""
        return vec(mu[1] * xi[2] - mu[2] * xi[1], xi[0] * mu[2], -(xi[0] * mu[1]))

    def hat(self, xi: Vec) -> Mat:
        """The matrix [[w J, v], [0, 0]]."""
        return mat(vec(0.0, -xi[0], xi[1]), vec(xi[0], 0.0, xi[2]), vec(0.0, 0.0, 0.0))

    def vee(self, matrix: Mat) -> Vec:
        """(w, v) of a matrix [[w J, v], [0, 0]], w that of the antisymmetric part."""
        return vec(0.5 * (matrix[1, 0] - matrix[0, 1]), matrix[0, 2], matrix[1, 2])

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """1 + (sin w/w) ad* + ((1 - cos w)/w^2) ad*^2."""
        a, b = exp_coefficients(xi[0] * xi[0], vec(xi[0]))
        return _series_dual(xi, mu, a, b)

    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        """eta - b [xi, eta] + c [xi, [xi, eta]], b = (1 - cos w)/w^2, c = (w - sin w)/w^3."""
        b, c, _, _ = dexp_coefficients(xi[0] * xi[0])
        return _series(xi, eta, -b, c)

    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """mu - b ad*_xi mu + c ad*_xi^2 mu."""
        b, c, _, _ = dexp_coefficients(xi[0] * xi[0])
        return _series_dual(xi, mu, -b, c)

    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """eta + [xi, eta]/2 + d [xi, [xi, eta]], d = (1 - (w/2) cot(w/2))/w^2; raises OutsideChart
        unless |w| < 2 pi.
        """
        return _series(xi, eta, 0.5, bernoulli(xi[0] * xi[0]))

    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """mu + ad*_xi mu/2 + d ad*_xi^2 mu; raises OutsideChart unless |w| < 2 pi."""
        return _series_dual(xi, mu, 0.5, bernoulli(xi[0] * xi[0]))

    def dexp_inv_series(self, xi: Vec, eta: Vec, terms: int) -> Vec:
        """Since ad^3 = -w^2 ad, the series is 1 + ad/2 + (1/12 + w^2/720 + ...) ad^2."""
        x, total = xi[0] * xi[0], 0.0
        for k in range(terms - terms % 2, 1, -2):
            total = BERNOULLI[k] - x * total
        return _series(xi, eta, 0.5 if terms else 0.0, total)

    def is_exp_chart(self, xi: Vec) -> bool:
        """|w| < 2 pi: less than a whole turn."""
        return xi[0] * xi[0] < WHOLE_TURN

    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = p - (mu + b y + c ad*_xi y), y = ad*_xi mu; with y = B(mu) xi and the derivatives b',
        c' with respect to w^2

        dr/dxi = -2 w (b' y + c' ad*_xi y) e_1^T - b B(mu) - c (B(y) + ad*_xi B(mu)).
        """
        w, along, across_x, across_y = (xi[0], mu[1] * xi[1] + mu[2] * xi[2], xi[0] * mu[1], xi[0] * mu[2])
        b, c, b_slope, c_slope = dexp_coefficients(w * w)
        ad_star, structure = self.ad_star, self.poisson_structure
        y = ad_star(xi, mu)
        z = ad_star(xi, y)
        second = mat(vec(along, across_x, across_y), vec(-2.0 * across_x, 0.0, 0.0), vec(-2.0 * across_y, 0.0, 0.0))
        first = outer((2.0 * w) * (b_slope * y + c_slope * z), vec(1.0, 0.0, 0.0))
        return p - (mu + (b * y + c * z)), 1.0, -(first + (b * structure(mu) + c * second))

    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """1 + f ad* + (f/2) ad*^2, f = 4/(4 + w^2)."""
        f = _cayley_factor(xi)
        return _series_dual(xi, mu, f, 0.5 * f)

    def dcayley(self, xi: Vec, eta: Vec) -> Vec:
        """f (eta - [xi, eta]/2)."""
        return _cayley_factor(xi) * (eta - 0.5 * self.bracket(xi, eta))

    def dcayley_dual(self, xi: Vec, mu: Vec) -> Vec:
        """f (mu - ad*_xi mu/2)."""
        return _cayley_factor(xi) * (mu - 0.5 * self.ad_star(xi, mu))

    def dcayley_inv(self, xi: Vec, eta: Vec) -> Vec:
        """eta + [xi, eta]/2 + w a (w, v)/4."""
        return eta + (0.5 * self.bracket(xi, eta) + (0.25 * xi[0] * eta[0]) * xi)

    def dcayley_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """mu + ad*_xi mu/2 + (w <mu, xi>/4, 0)."""
        pairing = mu[0] * xi[0] + (mu[1] * xi[1] + mu[2] * xi[2])
        return mu + (0.5 * self.ad_star(xi, mu) + vec(0.25 * xi[0] * pairing, 0.0, 0.0))

    def cayley_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = 4 (p - mu) + w^2 p - 2 ad*_xi mu,  dr/dp = 4 + w^2,  dr/dxi = 2 w p e_1^T - 2 B(mu)."""
        square = xi[0] * xi[0]
        r = 4.0 * (p - mu) + (square * p - 2.0 * self.ad_star(xi, mu))
        by_xi = outer((2.0 * xi[0]) * p, vec(1.0, 0.0, 0.0)) - 2.0 * self.poisson_structure(mu)
        return r, 4.0 + square, by_xi


@record
class SE2(LieGroup):
    """Rigid motions of the plane: g = [[R, p], [0, 1]] takes body coordinates to space coordinates,
    R = [[c, -s], [s, c]].

    Velocities are (w, v_x, v_y), momenta (Pi, P_x, P_y), the angular part first.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 14.6; Sola
    et al., A micro Lie theory for state estimation in robotics (2018), appendix C.
    """

    algebra = SE2Algebra()
    unit_blocks = (1, 2)  # Pi and P

    def identity(self) -> Element:
        return mat(vec(1.0, 0.0, 0.0), vec(0.0, 1.0, 0.0), vec(0.0, 0.0, 1.0))

    def compose(self, g: Element, h: Element) -> Element:
        """(R S, p + R q)."""
        c, s = h[0, 0], h[1, 0]
        return _moved(g, c, s, h[0, 2], h[1, 2])

    def inverse(self, g: Element) -> Element:
        """The inverse motion, (R^T, -R^T p)."""
        c, s, x, y = g[0, 0], g[1, 0], g[0, 2], g[1, 2]
        return _motion(c, -s, -(c * x + s * y), s * x - c * y)

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """(w, R v - w J p)."""
        c, s, w = g[0, 0], g[1, 0], xi[0]
        return vec(w, (c * xi[1] - s * xi[2]) + w * g[1, 2], (s * xi[1] + c * xi[2]) - w * g[0, 2])

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """(Pi - P.J p, R^T P)."""
        c, s = g[0, 0], g[1, 0]
        return vec(mu[0] + (mu[1] * g[1, 2] - mu[2] * g[0, 2]), c * mu[1] + s * mu[2], c * mu[2] - s * mu[1])

    def casimirs(self, mu: Vec) -> Vec:
        """The only Casimir, P.P of mu = (Pi, P)."""
        return vec(mu[1] * mu[1] + mu[2] * mu[2])

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """Pi where P = 0: such orbits are points.  All others are cylinders about the axis P = 0."""
        return () if mu[1:].any() else (float(mu[0]),)

    def scale(self, g: Element | None) -> Vec:
        """1 rad, and the distance from the origin of the plane (None: 1)."""
        if g is None:
            return super().scale(None)
        away = norm(vec(g[0, 2], g[1, 2]))
        return vec(1.0, away, away)

    def defect(self, g: Ambient) -> float:
        """The largest difference of R from a rotation, and of the last row from 0 0 1."""
        a, b, c, d = g[0, 0], g[0, 1], g[1, 0], g[1, 1]
        turned = max(abs(a - d), abs(b + c), abs((a * a + c * c) - 1.0), abs((b * b + d * d) - 1.0))
        return max(turned, abs(g[2, 0]), abs(g[2, 1]), abs(g[2, 2] - 1.0))

    def objection(self, g: np.ndarray) -> str | None:
        """The last row is not 0 0 1, or the rotation is a reflection, or none."""
        R = g[:2, :2]
        off = np.abs(R.T @ R - np.eye(2)).max()
        if np.abs(g[2] - [0.0, 0.0, 1.0]).max() > MEMBERSHIP:
            return f"its last row is {g[2].tolist()}, not 0 0 1"
        if off > MEMBERSHIP:
            return f"of its rotation, R^T R differs from the unit matrix by {off:.1e}, more than {MEMBERSHIP:.0e}"
        return (
            "of its rotation, the determinant is -1, it is a reflection"
            if R[0, 0] * R[1, 1] < R[0, 1] * R[1, 0]
            else None
        )

    def nearest(self, g: Ambient) -> Element:
        """The nearest rotation with the same displacement: the direction of
        (g_11 + g_22, g_21 - g_12).

        Raises InvalidInput for an array that is as close to one rotation as to any other.
        """
        c, s = 0.5 * g[0, 0] + 0.5 * g[1, 1], 0.5 * g[1, 0] - 0.5 * g[0, 1]
        size = float(np.hypot(c, s))
        if size == 0.0:
            raise InvalidInput("SE2.nearest: the array is as close to one rotation as to any other")
        return _motion(c / size, s / size, g[0, 2], g[1, 2])

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Uniformly distributed angles, normally distributed displacements."""
        generator, shape = (np.random.default_rng(rng), (size,) if isinstance(size, int) else tuple(size))
        xi = np.zeros((*shape, 3))
        xi[..., 0] = generator.uniform(-np.pi, np.pi, size=shape)
        g = np.array(self.exp(xi))
        g[..., :2, 2] = generator.normal(size=(*shape, 2))
        return g

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        """(R(w), V v), the displacement (sin w/w) v + ((1 - cos w)/w) J v."""
        c, s, x, y = _exp_less_one(xi)
        return _motion(1.0 + c, s, x, y)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """g + g (exp(xi) - 1): rounded by what the step adds, not by what is there."""
        return _advanced(g, *_exp_less_one(xi))

    def log(self, g: Element) -> Vec:
        """(w, (w/2) cot(w/2) p - w J p/2), |w| at most pi."""
        w = atan2(g[1, 0] - g[0, 1], g[0, 0] + g[1, 1])
        along, x, y = 1.0 - (w * w) * bernoulli(w * w), g[0, 2], g[1, 2]
        return vec(w, along * x + (0.5 * w) * y, along * y - (0.5 * w) * x)

    # ---------------------------------------------------------------- Cayley map

    def cayley(self, xi: Vec) -> Element:
        """A turn by 2 atan(w/2) and the displacement (1 - w J/2)^-1 v."""
        c, s, x, y = _cayley_less_one(xi)
        return _motion(1.0 + c, s, x, y)

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """g + g (cay(xi) - 1)."""
        return _advanced(g, *_cayley_less_one(xi))

    def cayley_inv(self, g: Element) -> Vec:
        """(2 tan(angle/2), p - w J p/2).  Raises OutsideChart at half a turn."""
        c, s, x, y = 0.5 * (g[0, 0] + g[1, 1]), 0.5 * (g[1, 0] - g[0, 1]), g[0, 2], g[1, 2]
        if c < 0.0 and abs(s) <= 2.0 * HALF_TURN:
            raise OutsideChart(AT_HALF_TURN)
        w = 2.0 * s / (1.0 + c) if c > 0.0 else 2.0 * (1.0 - c) / s
        return vec(w, x + (0.5 * w) * y, y - (0.5 * w) * x)

    @property
    def by_adjoint(self) -> LieGroup:
        """Itself: the Cayley map of ad is Ad of the Cayley map."""
        return self


# ------------------------------------------------------------------ series


def _series(xi: Vec, eta: Vec, k1: float, k2: float) -> Vec:
    """eta + k_1 ad eta + k_2 ad^2 eta."""
    w, y = xi[0], SE2Algebra().bracket(xi, eta)
    return vec(eta[0], eta[1] + (k1 * y[1] - (k2 * w) * y[2]), eta[2] + (k1 * y[2] + (k2 * w) * y[1]))


def _series_dual(xi: Vec, mu: Vec, k1: float, k2: float) -> Vec:
    """mu + k_1 ad* mu + k_2 ad*^2 mu."""
    ad_star = SE2Algebra().ad_star
    y = ad_star(xi, mu)
    return mu + (k1 * y + k2 * ad_star(xi, y))


# ------------------------------------------------------------------ matrices


def _motion(c: float, s: float, x: float, y: float) -> Mat:
    """The turn with cosine c and sine s, then the displacement (x, y)."""
    return mat(vec(c, -s, x), vec(s, c, y), vec(0.0, 0.0, 1.0))


def _moved(g: Mat, c: float, s: float, x: float, y: float) -> Mat:
    """The product of g with the motion by the angle of (c, s) and by (x, y)."""
    a, b, d, e = g[0, 0], g[0, 1], g[1, 0], g[1, 1]
    return mat(
        vec(a * c + b * s, b * c - a * s, g[0, 2] + (a * x + b * y)),
        vec(d * c + e * s, e * c - d * s, g[1, 2] + (d * x + e * y)),
        vec(0.0, 0.0, 1.0),
    )


def _advanced(g: Mat, c: float, s: float, x: float, y: float) -> Mat:
    """g plus g times what a motion differs from 1 by: cosine less one, sine, displacement."""
    m = _moved(g, c, s, x, y)
    return mat(
        vec(g[0, 0] + m[0, 0], g[0, 1] + m[0, 1], m[0, 2]),
        vec(g[1, 0] + m[1, 0], g[1, 1] + m[1, 1], m[1, 2]),
        vec(0.0, 0.0, 1.0),
    )


def _exp_less_one(xi: Vec) -> tuple[float, float, float, float]:
    """The parts of exp(xi): cosine less one, sine, displacement."""
    w, v, u = xi[0], xi[1], xi[2]
    a, b = exp_coefficients(w * w, vec(w))
    across = w * b
    return -(w * across), w * a, a * v - across * u, a * u + across * v


def _cayley_factor(xi: Vec) -> float:
    """The factor 4/(4 + w^2) of the Cayley map."""
    return 4.0 / (4.0 + xi[0] * xi[0])


def _cayley_less_one(xi: Vec) -> tuple[float, float, float, float]:
    """The parts of cay(xi): cosine less one, sine, displacement."""
    w, v, u = xi[0], xi[1], xi[2]
    if w * w >= HUGE:  # half a turn, nearly
        return -2.0, 4.0 / w, (-2.0 / w) * u, (2.0 / w) * v
    f, half = 4.0 / (4.0 + w * w), 0.5 * w
    return -(f * w) * half, f * w, f * (v - half * u), f * (u + half * v)
