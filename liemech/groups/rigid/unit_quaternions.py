"""The unit quaternions: rotations as four numbers, and the group that covers SO(3) twice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InvalidInput, OutsideChart
from ...formulas import Ambient, Element, Mat, Vec, atan2, constant, cross, dot, mat, record, sqrt, vec
from ...formulas.calls.batches import MEMBERSHIP
from ..lie_group import LieGroup
from .rotation_coefficients import LIMIT, exp_coefficients, lost_in_square, sin_cos_root
from .rotation_logarithm import rotation_quaternion
from .so3 import HALF_TURN, HUGE, SO3, SO3_ALGEBRA, TINY

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from scipy.spatial.transform import Rotation

WHOLE_TURN = 6.283185307179586
"""2 pi."""


@record
class UnitQuaternions(LieGroup):
    """Quaternions q = (x, y, z, w) of length one, the scalar last; q and -q turn a body in the same
    way.

    Velocities are angular velocities, those of SO(3): with th = |xi| and the axis n,

        exp(xi) = (sin(th/2) n, cos(th/2)),      Ad_q xi = q xi q^-1,

    so that q -> `matrix(q)` is a homomorphism onto SO(3) that takes exp to exp and the Cayley map
    to the Cayley map.  What depends on velocities and momenta alone is the same for both groups.
    Two whole turns lead back to 1, and one to -1.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.5.3; Marsden and
    Ratiu, section 9.2.
    """

    algebra = SO3_ALGEBRA

    def identity(self) -> Element:
        """The neutral element, (0, 0, 0, 1)."""
        return vec(0.0, 0.0, 0.0, 1.0)

    def compose(self, g: Element, h: Element) -> Element:
        """Hamilton's product: the rotation h, then g."""
        u, v = _vector(g), _vector(h)
        return _quaternion(g[3] * v + h[3] * u + cross(u, v), g[3] * h[3] - dot(u, v))

    def inverse(self, g: Element) -> Element:
        """The inverse, which is the conjugate (-v, w)."""
        return vec(-g[0], -g[1], -g[2], g[3])

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """The rotated vector, xi + 2 (w v x xi + v x (v x xi)) with q = (v, w)."""
        v = _vector(g)
        turned = 2.0 * cross(v, xi)
        return xi + (g[3] * turned + cross(v, turned))

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The coadjoint action, the momentum rotated back."""
        v = _vector(g)
        turned = 2.0 * cross(v, mu)
        return mu + (cross(v, turned) - g[3] * turned)

    def body_velocity(self, g: Element, rate: Ambient) -> Vec:
        """2 q^-1 q', without its scalar part, which is zero."""
        return 2.0 * _vector(self.compose(self.inverse(g), rate))

    def casimirs(self, mu: Vec) -> Vec:
        """|mu|^2: momenta move on spheres."""
        return vec(dot(mu, mu))

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """None: spheres about zero differ by their radius."""
        return ()

    def defect(self, g: Ambient) -> float:
        """| |q|^2 - 1 |."""
        return abs(dot(g, g) - 1.0)

    def objection(self, g: np.ndarray) -> str | None:
        """Its length is not one."""
        size = float(np.linalg.norm(g))
        return None if abs(size * size - 1.0) <= MEMBERSHIP else f"its length is {size:.6g}, not 1, by {size - 1.0:.1e}"

    def nearest(self, g: Ambient) -> Element:
        """q/|q|.  Raises InvalidInput for zero."""
        q = np.array(g, dtype=float)
        largest = float(np.abs(q).max())
        if largest == 0.0:
            raise InvalidInput(
                "UnitQuaternions.nearest: the zero quaternion is as close to one rotation as to any other"
            )
        q = q / largest  # so that squares neither overflow nor vanish
        return Vec.of((q / np.linalg.norm(q)).tolist())

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Uniformly distributed on the sphere S^3 (Haar measure)."""
        shape = (size,) if isinstance(size, int) else tuple(size)
        q = np.random.default_rng(rng).normal(size=(*shape, 4))
        return q / np.linalg.norm(q, axis=-1, keepdims=True)

    # ---------------------------------------------------------------- the way to SO(3) and back

    def matrix(self, g: Element) -> Mat:
        """The rotation matrix, 1 + 2 w V + 2 V^2 with V = hat(v): what q does to vectors.
        g : (4,);  returns (3, 3).
        """
        x, y, z, w = 2.0 * g[0], 2.0 * g[1], 2.0 * g[2], g[3]
        xx, yy, zz = x * g[0], y * g[1], z * g[2]
        xy, xz, yz = x * g[1], x * g[2], y * g[2]
        wx, wy, wz = w * x, w * y, w * z
        return mat(
            vec(1.0 - (yy + zz), xy - wz, xz + wy),
            vec(xy + wz, 1.0 - (xx + zz), yz - wx),
            vec(xz - wy, yz + wx, 1.0 - (xx + yy)),
        )

    def from_matrix(self, R: Mat) -> Element:
        """The quaternion of a rotation matrix with w >= 0; its negative is the other one.

        R : (3, 3), or SciPy rotations;  returns (4,).  Raises InvalidInput unless R is a rotation.
        """
        if not SO3().defect(R) <= MEMBERSHIP:
            raise InvalidInput(f"UnitQuaternions.from_matrix: R is off the rotations by {SO3().defect(R):.1e}")
        return rotation_quaternion(R)

    def rotation(self, g: ArrayLike) -> Rotation:
        """Quaternions as SciPy's class.  g : (..., 4)."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(np.asarray(g, dtype=float))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (3, 3) if kind == "Mat" else super()._shape(argument, kind)

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        """The exponential map, (sin(th/2)/th xi, cos(th/2)), th = |xi|."""
        half = 0.5 * xi
        s, _, c = _half_angle(half)
        return _quaternion(s * half, c)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """q + q (exp(xi) - 1): rounded by what the step adds, not by what is there."""
        half = 0.5 * xi
        s, below, _ = _half_angle(half)
        return g + self.compose(g, _quaternion(s * half, below))

    def log(self, g: Element) -> Vec:
        """The rotation vector 2 atan2(|v|, w) v/|v|, of length at most 2 pi; at -1, where every
        axis will do, 2 pi e_1.
        """
        v = _vector(g)
        square = dot(v, v)
        if constant(square) == 0.0:  # v is zero, or its square underflows; the root has no slope
            return 2.0 * v if g[3] > 0.0 else vec(WHOLE_TURN, 0.0, 0.0)
        size = sqrt(square)
        return (2.0 * atan2(size, g[3]) / size) * v

    # ---------------------------------------------------------------- Cayley map

    def cayley(self, xi: Vec) -> Element:
        """(xi/2, 1)/sqrt(1 + |xi|^2/4): the rotation by 2 atan(|xi|/2), whose matrix is
        (1 - hat(xi)/2)^-1 (1 + hat(xi)/2).
        """
        scale = TINY if dot(xi, xi) >= HUGE else 1.0
        u = (0.5 * scale) * xi
        size = sqrt(scale * scale + dot(u, u))
        return _quaternion(u / size, scale / size)

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """q + q (cay(xi) - 1)."""
        half = 0.5 * xi
        y = dot(half, half)
        if 4.0 * y >= HUGE:
            return self.compose(g, self.cayley(xi)) - (g - g)  # a zero that remembers, if g does
        size = sqrt(1.0 + y)
        return g + self.compose(g, _quaternion(half / size, -y / (size * (1.0 + size))))

    def cayley_inv(self, g: Element) -> Vec:
        """2 v/w.  Raises OutsideChart unless w > 0: the map stops short of half a turn."""
        if g[3] <= HALF_TURN:
            raise OutsideChart(
                f"cayley_inv of a quaternion with scalar part {g[3]}: the Cayley map reaches only "
                "positive ones, less than half a turn; use log, or -q, which is the same rotation"
            )
        return (2.0 / g[3]) * _vector(g)

    @property
    def by_adjoint(self) -> LieGroup:
        """Itself: the Cayley map of ad is Ad of the Cayley map."""
        return self


def _vector(q: Vec) -> Vec:
    """The vector part v of (v, w)."""
    return vec(q[0], q[1], q[2])


def _quaternion(v: Vec, w: float) -> Vec:
    """The quaternion (v, w) of its parts."""
    return vec(v[0], v[1], v[2], w)


def _half_angle(half: Vec) -> tuple[float, float, float]:
    """sin(a)/a, cos(a) - 1 and cos(a) at the half angle a = |half|."""
    y = dot(half, half)
    s, versine = exp_coefficients(y, half)
    below = -y * versine
    c = 1.0 + below
    if y > LIMIT:  # next to its zeros the cosine is no difference
        _, c = sin_cos_root(y, lost_in_square(half, y))
    return s, below, c
