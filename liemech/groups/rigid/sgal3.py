"""The special Galilean group SGal(3): rotations, boosts, displacements in space and in time.

The differential of the exponential is found by differentiating its closed form, which needs the
functions of the rotation vector w, W = hat(w), x = |w|^2,

    V = 1 + b W + c W^2,    E = 1/2 + c W + c_4 W^2,    b = (1 - cos th)/th^2,  c = (th - sin th)/th^3,

and c_4 = (1/2 - b)/x, and their slopes.
"""

from __future__ import annotations

import numpy as np

from ...formulas import Ambient, Element, Mat, Vec, cross, dot, record, vec
from ..ad_series import mean_slope
from ..lie_algebra import LieAlgebra
from ..lie_group import LieGroup
from .rotation_coefficients import LIMIT, STUMPFF4, all_coefficients, polynomial
from .se3 import SE3Algebra, half_inverse, halves, join
from .se23 import defect, extended, objection, parts, random, sizes, thirds
from .so3 import SO3, SO3Algebra

STUMPFF4_SLOPE = (-1 / 720, 1 / 20160, -1 / 1209600, 1 / 119750400, -1 / 17435658240, 0.0, 0.0)
"""The derivative of c_4 = 1/24 - x/720 + x^2/40320 - ..."""


@record
class SGal3Algebra(LieAlgebra):
    """sgal(3): (w, a, u, s), the matrices [[hat w, a, u], [0, 0, s], [0, 0, 0]].

    [(w, a, u, s), (w', a', u', s')] = (w x w', w x a' - w' x a, w x u' - w' x u + s' a - s a', 0).

    Source: Kelly, All about the Galilean group SGal(3), arXiv:2312.07555 (2023), section 3; there
    the order is (u, a, w, s).
    """

    dim = 10

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """(w x w', w x a' - w' x a, w x u' - w' x u + s' a - s a', 0)."""
        (w, a, u), (w2, a2, u2), s, s2 = thirds(xi), thirds(eta), xi[9], eta[9]
        moved = (cross(w, u2) - cross(w2, u)) + (s2 * a - s * a2)
        return vec(*cross(w, w2), *(cross(w, a2) - cross(w2, a)), *moved, 0.0)

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """(m x w + k x a + p x u, k x w - s p, p x w, p.a) for the momentum (m, k, p, e)."""
        (w, a, u), (m, k, p), s = thirds(xi), thirds(mu), xi[9]
        turned = cross(m, w) + (cross(k, a) + cross(p, u))
        return vec(*turned, *(cross(k, w) - s * p), *cross(p, w), dot(p, a))

    def hat(self, xi: Vec) -> Mat:
        """The matrix [[hat w, a, u], [0, 0, s], [0, 0, 0]]."""
        w, a, u = thirds(xi)
        return extended(SO3Algebra().hat(w), a, u, xi[9], corner=0.0)

    def vee(self, matrix: Mat) -> Vec:
        """(w, a, u, s) of a matrix of the algebra, w that of the antisymmetric part."""
        W, a, u, s = parts(matrix)
        return vec(*SO3Algebra().vee(W), *a, *u, s)

    # the exponential

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad* of (exp w, V a, V u + s E a, s)."""
        return SGal3().Ad_star(SGal3().exp(xi), mu)

    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        """With the motions (w, a) and (w, u) those of SE(3), and in u the terms with s too, which
        are those of E at -w.
        """
        (w, a, u), (w2, a2, u2), s, s2 = thirds(xi), thirds(eta), xi[9], eta[9]
        first = SE3Algebra().dexp(join(w, a), join(w2, a2))
        (turned, boosted), (_, moved) = (halves(first), halves(SE3Algebra().dexp(join(w, u), join(w2, u2))))
        by_a = _mean2(-w, s2 * a + s * a2)
        by_w = _mean2_slope(-w, a, w2) - cross(turned, _mean2(-w, a))
        return vec(*first, *(moved + (s * (by_w + boosted) - by_a)), s2)

    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The transpose, term by term."""
        (w, a, u), (m, k, p), s = thirds(xi), thirds(mu), xi[9]
        turned, boosted = halves(SE3Algebra().dexp_dual(join(w, a), join(m, k + s * p)))
        angular, moved = halves(SE3Algebra().dexp_dual(join(w, u), join(vec(0.0, 0.0, 0.0), p)))
        lever, mean = _mean2(-w, a), _mean2(w, p)
        swept = _mean2_slope_dual(-w, a, p) - SO3Algebra().dexp_dual(w, cross(lever, p))
        return vec(*(turned + angular + s * swept), *(boosted - s * mean), *moved, mu[9] - dot(lever, p))

    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """The solution of dexp, part by part.  Raises OutsideChart unless |w| < 2 pi."""
        (w, a, _), (w1, a1, u1), s1 = thirds(xi), thirds(eta), eta[9]
        first = SE3Algebra().dexp_inv(join(w, a), join(w1, a1))
        _, _, shift = thirds(self.dexp(xi, vec(*first, 0.0, 0.0, 0.0, s1)))
        return vec(*first, *SO3Algebra().dexp_inv(w, u1 - shift), s1)

    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The solution of dexp_dual, part by part.  Raises OutsideChart unless |w| < 2 pi."""
        (w, a, _), (m, k, p1) = thirds(xi), thirds(mu)
        p = SO3Algebra().dexp_inv_dual(w, p1)
        done = self.dexp_dual(xi, vec(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *p, 0.0))
        swept, dragged, _ = thirds(done)
        first = SE3Algebra().dexp_inv_dual(join(w, a), join(m - swept, k - dragged))
        return vec(*first, *p, mu[9] - done[9])

    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = p - (dexp_xi)* mu, and dr/dxi from the series."""
        size = self.ad_size(xi)
        return p - self.dexp_dual(-xi, mu), 1.0, -mean_slope(self.ad_star, xi, mu, size * size)

    def is_exp_chart(self, xi: Vec) -> bool:
        """|w| < 2 pi: less than a whole turn."""
        return SO3Algebra().is_exp_chart(thirds(xi)[0])


@record
class SGal3(LieGroup):
    """Changes of the inertial frame: g = [[R, v, p], [0, 1, t], [0, 0, 1]], with a rotation, a
    boost and an event.

    An event (x, t) goes to (R x + v t + p, t + t_g).  Velocities are (w, a, u, s), momenta
    (m, k, p, e), the angular part first and time last.  With V and E of the rotation vector:

        exp(w, a, u, s) = (exp w, V a, V u + s E a, s),
        Ad_g (w, a, u, s) = (R w, R a + v x R w, R (u - t a) + (p - t v) x R w + s v, s)
        with the time t and position p of g.

    Source: Kelly, All about the Galilean group SGal(3), arXiv:2312.07555 (2023), sections 4 to 6.
    """

    algebra = SGal3Algebra()
    unit_blocks = (3, 3, 3, 1)  # m, k, p and e

    def identity(self) -> Element:
        return extended(SO3().identity(), vec(0.0, 0.0, 0.0), vec(0.0, 0.0, 0.0), 0.0)

    def compose(self, g: Element, h: Element) -> Element:
        """(R S, v + R v', p + R p' + t' v, t + t')."""
        (R, v, p, t), (S, w, q, r) = parts(g), parts(h)
        return extended(R @ S, v + R @ w, p + (R @ q + r * v), t + r)

    def inverse(self, g: Element) -> Element:
        """(R^T, -R^T v, -R^T (p - t v), -t)."""
        R, v, p, t = parts(g)
        return extended(R.T, -(v @ R), (t * v - p) @ R, -t)

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """(R w, R a + v x R w, R (u - t a) + (p - t v) x R w + s v, s)."""
        (R, v, p, t), (w, a, u), s = parts(g), thirds(xi), xi[9]
        turned = R @ w
        moved = R @ (u - t * a) + (cross(p - t * v, turned) + s * v)
        return vec(*turned, *(R @ a + cross(v, turned)), *moved, s)

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The transpose, (R^T (m - v x k - (x - t v) x p), R^T (k - t p), R^T p, e + v.p)."""
        (R, v, x, t), (m, k, p) = parts(g), thirds(mu)
        turned = (m - (cross(v, k) + cross(x - t * v, p))) @ R
        return vec(*turned, *((k - t * p) @ R), *(p @ R), mu[9] + dot(v, p))

    def casimirs(self, mu: Vec) -> Vec:
        """p.p and |k x p|^2, as of a massless body."""
        _, k, p = thirds(mu)
        kp = cross(k, p)
        return vec(dot(p, p), dot(kp, kp))

    # ---------------------------------------------------------------- membership

    def scale(self, g: Element | None) -> Vec:
        """1 rad, the speed, the distance from the origin of space, and the time (None: 1)."""
        return super().scale(None) if g is None else vec(*sizes(g), abs(g[3, 4]))

    def defect(self, g: Ambient) -> float:
        """The defect of the rotation, and how far the last rows are from 0 0 0 1 t and 0 0 0 0 1."""
        return defect(g)

    def objection(self, g: np.ndarray) -> str | None:
        return objection(g)

    def nearest(self, g: Ambient) -> Element:
        """The nearest rotation with the same boost and event."""
        R, v, p, t = parts(g)
        return extended(SO3().nearest(R), v, p, t)

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Uniformly distributed rotations (Haar measure), the rest normally distributed."""
        generator = np.random.default_rng(rng)
        g = random(generator, size)
        g[..., 3, 4] = generator.normal(size=g.shape[:-2])
        return g

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        """(exp w, V a, V u + s E a, s)."""
        (w, a, u), s = thirds(xi), xi[9]
        V = SO3().dexp
        moved = V(w, u, "right") + s * _mean2(w, a)
        return extended(SO3().exp(w), V(w, a, "right"), moved, s)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """g moved: rounded by what the step adds, not by what is there."""
        (R, v, p, t), (w, a, u), s = parts(g), thirds(xi), xi[9]
        V = SO3().dexp
        moved = R @ (V(w, u, "right") + s * _mean2(w, a)) + s * v
        return extended(SO3().compose_exp(R, w), v + R @ V(w, a, "right"), p + moved, t + s)

    def log(self, g: Element) -> Vec:
        """(w, a, V^-1 (p - s E a), s) with a = V^-1 v and the rotation vector w, of length at most
        pi.
        """
        R, v, p, s = parts(g)
        w, V_inv = SO3().log(R), SO3().dexp_inv
        a = V_inv(w, v, "right")
        return vec(*w, *a, *V_inv(w, p - s * _mean2(w, a), "right"), s)

    # ---------------------------------------------------------------- Cayley map

    def cayley(self, xi: Vec) -> Element:
        """(cay w, H a, H (u + s a/2), s) with H = (1 - W/2)^-1."""
        (w, a, u), s = thirds(xi), xi[9]
        moved = half_inverse(w, u + (0.5 * s) * a)
        return extended(SO3().cayley(w), half_inverse(w, a), moved, s)

    def cayley_inv(self, g: Element) -> Vec:
        """The velocity of a motion.  Raises OutsideChart at half a turn."""
        R, v, p, s = parts(g)
        w = SO3().cayley_inv(R)
        a = v - 0.5 * cross(w, v)
        return vec(*w, *a, *((p - 0.5 * cross(w, p)) - (0.5 * s) * a), s)


# ------------------------------------------------------------------ E = 1/2 + W/6 + W^2/24 + ...


def _stumpff4(x: float) -> tuple[float, float]:
    """c_4 = 1/24 - x/720 + ... and its slope.

    Beyond LIMIT by c_4 = (1/2 - b)/x, accurate beside 1/2, to which its multiple of W^2 is added.
    """
    value, slope = polynomial(STUMPFF4, x), polynomial(STUMPFF4_SLOPE, x)
    if x > LIMIT:
        _, b, _, _, b_slope, _ = all_coefficients(x)
        value = (0.5 - b) / x
        slope = -(value + b_slope) / x
    return value, slope


def _mean2(w: Vec, a: Vec) -> Vec:
    """E a, the integral of (1 - t) exp(t W) a over 0 <= t <= 1."""
    x = dot(w, w)
    _, _, c, _, _, _ = all_coefficients(x)
    c4, _ = _stumpff4(x)
    y = cross(w, a)
    return 0.5 * a + (c * y + c4 * cross(w, y))


def _mean2_slope(w: Vec, a: Vec, d: Vec) -> Vec:
    """The derivative of E a as w moves with d."""
    x = dot(w, w)
    _, _, c, _, _, c_slope = all_coefficients(x)
    c4, c4_slope = _stumpff4(x)
    y = cross(w, a)
    along = (2.0 * dot(w, d)) * (c_slope * y + c4_slope * cross(w, y))
    return along + (c * cross(d, a) + c4 * (cross(d, y) + cross(w, cross(d, a))))


def _mean2_slope_dual(w: Vec, a: Vec, p: Vec) -> Vec:
    """The dual of it: of d -> p . (derivative of E a)."""
    x = dot(w, w)
    _, _, c, _, _, c_slope = all_coefficients(x)
    c4, c4_slope = _stumpff4(x)
    y = cross(w, a)
    along = (2.0 * dot(p, c_slope * y + c4_slope * cross(w, y))) * w
    return along + (c * cross(a, p) + c4 * (cross(y, p) + cross(a, cross(p, w))))
