"""The rotation group SO(3), its algebra of angular velocities, and its action on angular momenta."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InvalidInput, OutsideChart
from ...formulas import Ambient, Element, Mat, Vec, cross, dot, mat, outer, record, vec
from ...formulas.calls.batches import MEMBERSHIP
from ...formulas.vectors import small
from ..bernoulli import BERNOULLI
from ..lie_algebra import LieAlgebra
from ..lie_group import LieGroup
from ..matrices.nearest import nearest_unitary
from .rotation_coefficients import WHOLE_TURN, all_coefficients, bernoulli, dexp_coefficients, exp_coefficients
from .rotation_logarithm import rotation_quaternion, rotation_vector

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from scipy.spatial.transform import Rotation

HALF_TURN = 2.0**-51
"""A rotation whose quaternion has a smaller scalar part is half a turn, up to rounding."""

AT_HALF_TURN = (
    "cayley_inv of half a turn: the Cayley map cannot represent it, |xi| = 2 tan(angle/2) is infinite; use log"
)

ORDERS = "wxyz", "xyzw"
"""Where the scalar part of a quaternion stands, first or last."""

HUGE, TINY = 1e300, 2.0**-600
"""Squares above the first may overflow; their vectors are scaled by the second."""


@record
class SO3Algebra(LieAlgebra):
    """so(3): angular velocities w in R^3 with the vector product, [hat a, hat b] = hat(a x b).

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 9.2.
    """

    dim = 3
    structure_constants = (  # the Levi-Civita symbol
        ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
        ((0.0, 0.0, -1.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    )

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        return cross(xi, eta)

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """mu x xi: Euler's equation is mu' = mu x xi."""
        return cross(mu, xi)

    def hat(self, xi: Vec) -> Mat:
        """The antisymmetric matrix with hat(w) x = w x x."""
        return mat(vec(0.0, -xi[2], xi[1]), vec(xi[2], 0.0, -xi[0]), vec(-xi[1], xi[0], 0.0))

    def vee(self, matrix: Mat) -> Vec:
        """The vector of an antisymmetric matrix, of the antisymmetric part of any other."""
        m = matrix
        return 0.5 * vec(m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """exp(-hat xi) mu, without forming the matrix."""
        a, b = exp_coefficients(dot(xi, xi), xi)
        w = cross(xi, mu)
        return mu + (b * cross(xi, w) - a * w)

    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        """eta - b xi x eta + c xi x (xi x eta), b = (1 - cos th)/th^2, c = (th - sin th)/th^3."""
        b, c, _, _ = dexp_coefficients(dot(xi, xi))
        w = cross(xi, eta)
        return eta + (c * cross(xi, w) - b * w)

    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """mu + b xi x mu + c xi x (xi x mu): the differential at -xi."""
        return self.dexp(-xi, mu)

    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """eta + xi x eta/2 + d xi x (xi x eta), d = (1 - (th/2) cot(th/2))/th^2; raises
        OutsideChart unless |xi| < 2 pi.
        """
        w = cross(xi, eta)
        return eta + (bernoulli(dot(xi, xi)) * cross(xi, w) + 0.5 * w)

    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """mu - xi x mu/2 + d xi x (xi x mu): the inverse differential at -xi."""
        return self.dexp_inv(-xi, mu)

    def dexp_inv_series(self, xi: Vec, eta: Vec, terms: int) -> Vec:
        """Since ad^3 = -x ad, the series is 1 + W/2 + (1/12 + x/720 + ...) W^2: a matrix, ready
        before eta is.
        """
        x = dot(xi, xi)
        power, total = 1.0, 0.0
        for k in range(2, terms + 1, 2):
            total = total + BERNOULLI[k] * power
            power = -x * power
        return plus(turn(0.5 if terms else 0.0, total, xi), 1.0) @ eta

    def is_exp_chart(self, xi: Vec) -> bool:
        """|xi| < 2 pi: less than a whole turn."""
        return dot(xi, xi) < WHOLE_TURN

    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = p - a mu + b xi x mu - c s xi,  s = xi . mu,  with a = sin th/th, b = (1 - cos th)/th^2, c = (th - sin th)/th^3 and

        dr/dxi = ((b - c) mu + 2 b' xi x mu - 2 c' s xi) xi^T - c (xi mu^T + s) - b hat(mu),  primes with respect to th^2.
        """
        x, w, s = dot(xi, xi), cross(xi, mu), dot(xi, mu)
        a, b, c, _, b_slope, c_slope = all_coefficients(x)
        r = (p - a * mu) + (b * w - c * (s * xi))
        m = outer(mu, xi)
        along = (2.0 * b_slope) * w - (2.0 * c_slope) * (s * xi)
        by_xi = (b * (m - self.hat(mu)) - c * plus(m + m.T, s)) + outer(along, xi)
        return r, 1.0, by_xi

    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """cay(-hat xi) mu, without forming the matrix."""
        f, w = 4.0 / (4.0 + dot(xi, xi)), cross(xi, mu)
        return mu + f * (0.5 * cross(xi, w) - w)

    def dcayley(self, xi: Vec, eta: Vec) -> Vec:
        """4/(4 + |xi|^2) (eta - xi x eta/2)."""
        return (4.0 / (4.0 + dot(xi, xi))) * (eta - 0.5 * cross(xi, eta))

    def dcayley_dual(self, xi: Vec, mu: Vec) -> Vec:
        """4/(4 + |xi|^2) (mu + xi x mu/2): the differential at -xi."""
        return self.dcayley(-xi, mu)

    def dcayley_inv(self, xi: Vec, eta: Vec) -> Vec:
        """eta + xi x eta/2 + xi (xi . eta)/4."""
        return eta + ((0.25 * dot(xi, eta)) * xi + 0.5 * cross(xi, eta))

    def dcayley_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """mu - xi x mu/2 + xi (xi . mu)/4: the inverse differential at -xi."""
        return self.dcayley_inv(-xi, mu)

    def cayley_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = 2 (p - mu) + (|xi|^2/2) p + xi x mu,  dr/dp = 2 + |xi|^2/2,  dr/dxi = p xi^T - hat(mu).

        p - mu is small and rounds by its own size, so r rounds by the size of xi and not by that of
        mu.
        """
        half = 0.5 * dot(xi, xi)
        r = 2.0 * (p - mu) + (half * p + cross(xi, mu))
        return r, 2.0 + half, outer(p, xi) - self.hat(mu)


SO3_ALGEBRA = SO3Algebra()
"""One for all: it remembers the shapes of what its methods are given."""


@record
class SO3(LieGroup):
    """Rotations: g is the orthogonal matrix that turns body coordinates into space coordinates.

    With th = |w|, x = th^2, W = hat(w):  exp w = 1 + (sin th/th) W + ((1 - cos th)/x) W^2,  cay w = 1 + 4/(4 + x) (W + W^2/2).

    Source: Iserles et al., Lie-group methods, Acta Numerica 9 (2000), appendix B; Hairer, Lubich,
    Wanner, IV.8.3.
    """

    algebra = SO3_ALGEBRA

    def identity(self) -> Element:
        return mat(vec(1.0, 0.0, 0.0), vec(0.0, 1.0, 0.0), vec(0.0, 0.0, 1.0))

    def inverse(self, g: Element) -> Element:
        """The inverse rotation, the transpose g^T."""
        return g.T

    def Ad(self, g: Element, xi: Vec) -> Vec:
        return g @ xi

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The coadjoint action, the momentum g^T mu."""
        return mu @ g

    def defect(self, g: Ambient) -> float:
        """The largest entry of |g^T g - 1|, and of |det g - 1|."""
        (a, b, c), (d, e, f), (p, q, r) = g
        return rotation_defect(a, b, c, d, e, f, p, q, r)

    def objection(self, g: np.ndarray) -> str | None:
        """A reflection, or not orthogonal to 1e-6."""
        if self.defect(small(g)) <= MEMBERSHIP:
            return None
        off = np.abs(g.T @ g - np.eye(3)).max()
        if off <= MEMBERSHIP:
            return "its determinant is -1, it is a reflection"
        return f"g^T g differs from the unit matrix by {off:.1e}, more than {MEMBERSHIP:.0e}"

    def nearest(self, g: Ambient) -> Element:
        """The rotation with the least sum of squared differences of entries.

        Raises InvalidInput for an array that is as close to several.  Source: Kabsch, Acta
        Crystallographica A32 (1976).
        """
        h = nearest_unitary(np.array(g, dtype=float), oriented=True)
        if h is None:
            raise InvalidInput("SO3.nearest: the array is as close to one rotation as to others")
        return Mat.of(h.tolist())

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Rotations distributed uniformly (Haar measure): those of uniformly distributed unit
        quaternions.
        """
        from scipy.spatial.transform import Rotation

        shape = (size,) if isinstance(size, int) else tuple(size)
        q = np.random.default_rng(rng).normal(size=(*shape, 4))
        return Rotation.from_quat(q.reshape(-1, 4)).as_matrix().reshape(*shape, 3, 3)

    def rotation(self, g: ArrayLike) -> Rotation:
        """Rotation matrices as SciPy's class; the way back is automatic: arguments may be SciPy
        rotations.  g : (..., 3, 3).
        """
        from scipy.spatial.transform import Rotation

        return Rotation.from_matrix(np.asarray(g, dtype=float))

    def from_quaternion(self, q: Vec, order: str) -> Element:
        """The rotation of a unit quaternion: 1 + 2 w hat(v) + 2 hat(v)^2, over |q|^2, with its
        vector v and its scalar w.

        q : (4,).  order : "wxyz", scalar first, as MuJoCo, Eigen's constructor and textbooks have
        it, or "xyzw", scalar last, as SciPy, ROS and `quaternion` have it: there is no default.
        Raises InvalidInput for another order, and if |q|^2 differs from 1 by more than 1e-6.
        Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 9.2.
        """
        size = dot(q, q)
        if abs(size - 1.0) > MEMBERSHIP:
            raise InvalidInput(
                f"SO3.from_quaternion: q is no unit quaternion, |q|^2 is {size:.8g}, not 1 to 1e-6; divide by |q|"
            )
        v, w = (vec(q[1], q[2], q[3]), q[0]) if order == "wxyz" else (vec(q[0], q[1], q[2]), q[3])
        return plus(turn(2.0 * w / size, 2.0 / size, v), 1.0)

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (4,) if argument == "q" else super()._shape(argument, kind)

    def _objection(self, argument: str, value: Any) -> str | None:
        if argument == "order" and not (isinstance(value, str) and value in ORDERS):
            return f'is "wxyz", scalar first, or "xyzw", scalar last; got {value!r}'
        return super()._objection(argument, value)

    def casimirs(self, mu: Vec) -> Vec:
        """|mu|^2: momenta move on spheres."""
        return vec(dot(mu, mu))

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """None: spheres about zero differ by their radius."""
        return ()

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        """The rotation about xi by the angle |xi|."""
        a, b = exp_coefficients(dot(xi, xi), xi)
        return plus(turn(a, b, xi), 1.0)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """g + g (exp(xi) - 1): rounded by what the step adds, not by what is there."""
        a, b = exp_coefficients(dot(xi, xi), xi)
        return g + g @ turn(a, b, xi)

    def log(self, g: Element) -> Vec:
        """The rotation vector, of length at most pi."""
        return rotation_vector(g)

    def quaternion(self, g: Element) -> Vec:
        """The unit quaternion (x, y, z, w) of a rotation, scalar last and not negative.
        g : (3, 3).
        """
        return rotation_quaternion(g)

    # ---------------------------------------------------------------- Cayley map

    def cayley(self, xi: Vec) -> Element:
        """The rotation about xi by the angle 2 atan(|xi|/2)."""
        return plus(_cayley_turn(xi), 1.0)

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """g + g (cay(xi) - 1)."""
        return g + g @ _cayley_turn(xi)

    def cayley_inv(self, g: Element) -> Vec:
        """2 tan(angle/2) times the axis.  Raises OutsideChart at half a turn, where it is infinite."""
        q = rotation_quaternion(g)
        if q[3] <= HALF_TURN:
            raise OutsideChart(AT_HALF_TURN)
        return (2.0 / q[3]) * vec(q[0], q[1], q[2])

    @property
    def by_adjoint(self) -> LieGroup:
        """Itself: the Cayley map of ad is Ad of the Cayley map."""
        return self


def rotation_defect(a: float, b: float, c: float, d: float, e: float, f: float, p: float, q: float, r: float) -> float:
    """The defect of the rows (a, b, c), (d, e, f), (p, q, r), which every start has to pass."""
    lengths = max(abs(a * a + b * b + c * c - 1.0), abs(d * d + e * e + f * f - 1.0), abs(p * p + q * q + r * r - 1.0))
    angles = max(abs(a * d + b * e + c * f), abs(d * p + e * q + f * r), abs(p * a + q * b + r * c))
    determinant = (b * f - c * e) * p + (c * d - a * f) * q + (a * e - b * d) * r
    return max(lengths, angles, abs(determinant - 1.0))


def _cayley_turn(xi: Vec) -> Mat:
    """cay(xi) - 1 = f W + f W^2/2, f = 4/(4 + |xi|^2)."""
    x = dot(xi, xi)
    u, f = xi, 4.0 / (4.0 + x)
    half = 0.5 * f
    if x >= HUGE:  # f is 4/|xi|^2; half a turn, nearly
        u = TINY * xi
        inverse_square = 1.0 / dot(u, u)
        f, half = 4.0 * TINY * inverse_square, 2.0 * inverse_square
    return turn(f, half, u)


def plus(m: Mat, s: float) -> Mat:
    """The matrix m + s 1, for a number s."""
    a, b, c = m
    return mat(vec(a[0] + s, a[1], a[2]), vec(b[0], b[1] + s, b[2]), vec(c[0], c[1], c[2] + s))


def turn(s: float, b: float, w: Vec) -> Mat:
    """s hat(w) + b hat(w)^2: what a rotation adds to 1."""
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = b * (w[0] * w[1]), b * (w[0] * w[2]), b * (w[1] * w[2])
    sx, sy, sz = s * w[0], s * w[1], s * w[2]
    return mat(
        vec(-b * (yy + zz), xy - sz, xz + sy),
        vec(xy + sz, -b * (xx + zz), yz - sx),
        vec(xz - sy, yz + sx, -b * (xx + yy)),
    )
