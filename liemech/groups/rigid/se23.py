"""The group SE_2(3) of extended poses: rotations together with two vectors, a velocity and a
position.

Each vector makes a rigid motion with the rotation, and every map on SE_2(3) is that of the two
rigid motions, which share their angular part.  On momenta the angular parts of the two are added.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...formulas import Ambient, Element, Mat, Vec, cross, dot, mat, norm, record, vec
from ...formulas.calls.batches import MEMBERSHIP
from ..composed.parts import AlgebraOfParts
from ..lie_group import LieGroup
from .se3 import SE3Algebra, half_inverse, halves, join
from .so3 import SO3, SO3Algebra, rotation_defect

ZERO = (0.0, 0.0, 0.0)


@record
class SE23Algebra(AlgebraOfParts):
    """se_2(3): (w, a, u), [(w, a, u), (w', a', u')] = (w x w', w x a' - w' x a, w x u' - w' x u).

    Source: Barrau and Bonnabel, IEEE Transactions on Automatic Control 62 (2017), 1797.
    """

    dim = 9

    def hat(self, xi: Vec) -> Mat:
        """The matrix [[hat w, a, u], [0, 0, 0], [0, 0, 0]]."""
        w, a, u = thirds(xi)
        return extended(SO3Algebra().hat(w), a, u, 0.0, corner=0.0)

    def vee(self, matrix: Mat) -> Vec:
        """(w, a, u) of a matrix of the algebra, w that of the antisymmetric part."""
        W, a, u, _ = parts(matrix)
        return vec(*SO3Algebra().vee(W), *a, *u)

    def _of_velocities(self, name: str, xi: Vec, eta: Vec, *more: Any) -> Vec:
        """The map of both rigid motions, whose angular parts are the same.  xi, eta : (dim,)."""
        (w, a, u), (w2, a2, u2), formula = thirds(xi), thirds(eta), getattr(SE3Algebra(), name)
        first = formula(join(w, a), join(w2, a2), *more)
        _, second = halves(formula(join(w, u), join(w2, u2), *more))
        return vec(*first, *second)

    def _of_momenta(self, name: str, xi: Vec, mu: Vec) -> Vec:
        """The map of both rigid motions, whose angular parts are added.  xi, mu : (dim,)."""
        (w, a, u), (m, k, p), formula = thirds(xi), thirds(mu), getattr(SE3Algebra(), name)
        turned, first = halves(formula(join(w, a), join(m, k)))
        angular, second = halves(formula(join(w, u), join(vec(*ZERO), p)))
        return vec(*(turned + angular), *first, *second)

    def _of_equations(self, name: str, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """The equations of both rigid motions, whose angular parts are added; dr/dxi is
        [[B_1 + B_2, A_1, A_2], [A_1, 0, 0], [A_2, 0, 0]].  xi, p, mu : (dim,).
        """
        (w, a, u), (l, q1, q2), (m, k1, k2) = thirds(xi), thirds(p), thirds(mu)
        zero, formula = vec(*ZERO), getattr(SE3Algebra(), name)
        r1, by_p, A = formula(join(w, a), join(l, q1), join(m, k1))
        r2, _, B = formula(join(w, u), join(zero, q2), join(zero, k2))
        (angular, first), (angular2, second) = halves(r1), halves(r2)
        top = [vec(*(A[i] + B[i])[:3], *A[i][3:], *B[i][3:]) for i in range(3)]
        left = [vec(*A[i + 3], *ZERO) for i in range(3)]
        right = [vec(*B[i + 3][:3], *ZERO, *ZERO) for i in range(3)]
        return vec(*(angular + angular2), *first, *second), by_p, mat(*top, *left, *right)

    def is_exp_chart(self, xi: Vec) -> bool:
        """|w| < 2 pi: less than a whole turn."""
        return SO3Algebra().is_exp_chart(thirds(xi)[0])


@record
class SE23(LieGroup):
    """Extended poses: g = [[R, v, p], [0, 1, 0], [0, 0, 1]] with a rotation, a velocity and a
    position.

    Velocities are (w, a, u), momenta (m, k, p), the angular part first.  With V the right-trivialised dexp_w of SO(3):

        exp(w, a, u) = (exp w, V a, V u),    Ad_g (w, a, u) = (R w, R a + v x R w, R u + p x R w).

    Source: Barrau and Bonnabel, IEEE Transactions on Automatic Control 62 (2017), 1797; Brossard,
    Barrau, Chauchat and Bonnabel, IEEE Transactions on Robotics 38 (2022), 998.
    """

    algebra = SE23Algebra()
    unit_blocks = (3, 3, 3)  # m, k and p

    def identity(self) -> Element:
        return extended(SO3().identity(), vec(*ZERO), vec(*ZERO), 0.0)

    def compose(self, g: Element, h: Element) -> Element:
        """(R S, v + R v', p + R p')."""
        (R, v, p, _), (S, w, q, _) = parts(g), parts(h)
        return extended(R @ S, v + R @ w, p + R @ q, 0.0)

    def inverse(self, g: Element) -> Element:
        """(R^T, -R^T v, -R^T p)."""
        R, v, p, _ = parts(g)
        return extended(R.T, -(v @ R), -(p @ R), 0.0)

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """(R w, R a + v x R w, R u + p x R w)."""
        (R, v, p, _), (w, a, u) = parts(g), thirds(xi)
        turned = R @ w
        return vec(*turned, *(R @ a + cross(v, turned)), *(R @ u + cross(p, turned)))

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """(R^T (m - v x k - p x p'), R^T k, R^T p') for the momentum (m, k, p')."""
        (R, v, x, _), (m, k, p) = parts(g), thirds(mu)
        return vec(*((m - (cross(v, k) + cross(x, p))) @ R), *(k @ R), *(p @ R))

    def casimirs(self, mu: Vec) -> Vec:
        """The three Casimirs k.k, p.p and k.p of mu = (m, k, p)."""
        _, k, p = thirds(mu)
        return vec(dot(k, k), dot(p, p), dot(k, p))

    # ---------------------------------------------------------------- membership

    def scale(self, g: Element | None) -> Vec:
        """1 rad, the speed, and the distance from the origin of space (None: 1)."""
        return super().scale(None) if g is None else sizes(g)

    def defect(self, g: Ambient) -> float:
        """The defect of the rotation, and how far the last rows are from 0 0 0 1 0 and 0 0 0 0 1."""
        return max(defect(g), abs(g[3, 4]))

    def objection(self, g: np.ndarray) -> str | None:
        """The last rows are wrong, or the rotation is none."""
        if abs(g[3, 4]) > MEMBERSHIP:
            return f"its fourth row is {g[3].tolist()}, not 0 0 0 1 0"
        return objection(g)

    def nearest(self, g: Ambient) -> Element:
        """The nearest rotation with the same vectors."""
        R, v, p, _ = parts(g)
        return extended(SO3().nearest(R), v, p, 0.0)

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Uniformly distributed rotations (Haar measure), normally distributed vectors."""
        return random(rng, size)

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        """(exp w, V a, V u)."""
        w, a, u = thirds(xi)
        V = SO3().dexp
        return extended(SO3().exp(w), V(w, a, "right"), V(w, u, "right"), 0.0)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """(R exp w, v + R V a, p + R V u): rounded by what the step adds, not by what is there."""
        (R, v, p, _), (w, a, u) = parts(g), thirds(xi)
        V = SO3().dexp
        moved, displaced = R @ V(w, a, "right"), R @ V(w, u, "right")
        return extended(SO3().compose_exp(R, w), v + moved, p + displaced, 0.0)

    def log(self, g: Element) -> Vec:
        """(w, V^-1 v, V^-1 p) with the rotation vector w of R, of length at most pi."""
        R, v, p, _ = parts(g)
        w = SO3().log(R)
        V_inv = SO3().dexp_inv
        return vec(*w, *V_inv(w, v, "right"), *V_inv(w, p, "right"))

    # ---------------------------------------------------------------- Cayley map

    def cayley(self, xi: Vec) -> Element:
        """(cay w, (1 - W/2)^-1 a, (1 - W/2)^-1 u)."""
        w, a, u = thirds(xi)
        return extended(SO3().cayley(w), half_inverse(w, a), half_inverse(w, u), 0.0)

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """(R cay w, v + R (1 - W/2)^-1 a, p + R (1 - W/2)^-1 u)."""
        (R, v, p, _), (w, a, u) = parts(g), thirds(xi)
        return extended(SO3().compose_cayley(R, w), v + R @ half_inverse(w, a), p + R @ half_inverse(w, u), 0.0)

    def cayley_inv(self, g: Element) -> Vec:
        """(w, v - w x v/2, p - w x p/2) with w = cay^-1 R.  Raises OutsideChart at half a turn."""
        R, v, p, _ = parts(g)
        w = SO3().cayley_inv(R)
        return vec(*w, *(v - 0.5 * cross(w, v)), *(p - 0.5 * cross(w, p)))


# ------------------------------------------------------------------ two rigid motions in one


def thirds(xi: Vec) -> tuple[Vec, Vec, Vec]:
    """The angular part and the two vectors."""
    return vec(xi[0], xi[1], xi[2]), vec(xi[3], xi[4], xi[5]), vec(xi[6], xi[7], xi[8])


# ------------------------------------------------------------------ 5 by 5 matrices


def parts(g: Mat) -> tuple[Mat, Vec, Vec, float]:
    """The rotation, the velocity, the position and the time of a matrix [[R, v, p], [0, 1, t],
    [0, 0, 1]].
    """
    rotation = mat(vec(g[0, 0], g[0, 1], g[0, 2]), vec(g[1, 0], g[1, 1], g[1, 2]), vec(g[2, 0], g[2, 1], g[2, 2]))
    return rotation, vec(g[0, 3], g[1, 3], g[2, 3]), vec(g[0, 4], g[1, 4], g[2, 4]), g[3, 4]


def sizes(g: Mat) -> Vec:
    """1 rad, the speed, and the distance from the origin, each for three components."""
    _, v, p, _ = parts(g)
    speed, away = norm(v), norm(p)
    return vec(1.0, 1.0, 1.0, speed, speed, speed, away, away, away)


def extended(R: Mat, v: Vec, p: Vec, t: float, corner: float = 1.0) -> Mat:
    """[[R, v, p], [0, 1, t], [0, 0, 1]]."""
    rows = [vec(*R[i], v[i], p[i]) for i in range(3)]
    return mat(*rows, vec(*ZERO, corner, t), vec(*ZERO, 0.0, corner))


def defect(g: Any) -> float:
    """The defect of the rotation, and the distance of the last rows from 0 0 0 1 t and 0 0 0 0 1."""
    (a, b, c, _, _), (d, e, f, _, _), (p, q, r, _, _), (x, y, z, one1, _), (x2, y2, z2, z3, one2) = g
    rows = max(abs(x), abs(y), abs(z), abs(one1 - 1.0), abs(x2), abs(y2), abs(z2), abs(z3))
    return max(rotation_defect(a, b, c, d, e, f, p, q, r), rows, abs(one2 - 1.0))


def objection(g: np.ndarray) -> str | None:
    """The last rows are wrong, or the rotation is none."""
    for row, expected in ((g[3, :4], [0.0, 0.0, 0.0, 1.0]), (g[4], [0.0, 0.0, 0.0, 0.0, 1.0])):
        if np.abs(row - expected).max() > MEMBERSHIP:
            return f"its last rows begin {g[3].tolist()}, {g[4].tolist()}, not 0 0 0 1 and 0 0 0 0 1"
    reason = SO3().objection(g[:3, :3])
    return reason and f"of its rotation, {reason}"


def random(rng: np.random.Generator | int | None, size: int | tuple[int, ...]) -> np.ndarray:
    """Uniformly distributed rotations, normally distributed vectors, no time."""
    generator = np.random.default_rng(rng)
    R = SO3().random(generator, size)
    g = np.zeros((*R.shape[:-2], 5, 5))
    g[..., :3, :3], g[..., :3, 3:] = R, generator.normal(size=(*R.shape[:-2], 3, 2))
    g[..., 3, 3] = g[..., 4, 4] = 1.0
    return g
