"""Inertial navigation: gyroscopes and accelerometers as processes."""

from __future__ import annotations

from typing import Any

from ..formulas import Element, Vec, record, sqrt, vec
from ..groups.composed.product import ProductGroup
from ..groups.rigid.se23 import SE23, extended, parts
from ..groups.rigid.sgal3 import SGal3
from ..groups.rigid.so3 import SO3
from ..groups.vector_space import VectorSpace
from .noise import check_noise
from .processes import Process


def _navigated(g: Any, turn: Vec, force: Vec, shift: Vec, gravity: Vec, h: float) -> Any:
    """The exact motion of a body whose angular velocity and specific force are constant in the body:
    a translation along exp of SGal(3), and the fall in space.
    """
    (R, v, p, _) = parts(g)
    D, dv, dp, _ = parts(SGal3().exp(vec(*(h * turn), *(h * force), 0.0, 0.0, 0.0, h)))
    return extended(
        R @ D, v + (h * gravity + R @ dv), p + (h * v + ((0.5 * h * h) * gravity + R @ (dp + h * shift))), 0.0
    )


def _inertial(gyroscope: Vec, accelerometer: Vec, h: float) -> Vec:
    """Standard deviations of the mean of white noise over a step, and of the part of the position that is independent
    of the mean: h^3/12 of the variance h^3/3.
    """
    return vec(*(gyroscope / sqrt(h)), *(accelerometer / sqrt(h)), *(accelerometer * sqrt(h / 12.0)))


@record
class Imu(Process):
    """A body with gyroscope and accelerometer, R' = R w, v' = R a + gravity, p' = v, on SE_2(3).

    Input (w, a): angular velocity in rad/s and specific force in m/s^2, both in the body.  They are
    constant over a step, for which the motion is exact.

    gyroscope, accelerometer : (3,) densities of their white noise, rad/s and m/s^2 per root of Hz.
    gravity : (3,) in space, m/s^2.

    Source: Barrau and Bonnabel, IEEE Trans. Autom. Control 62 (2017), section V; Brossard, Barrau,
    Chauchat, Bonnabel, IEEE Trans. Robotics 38 (2022), on preintegration.
    """

    gyroscope: Vec
    accelerometer: Vec
    gravity: Vec = (0.0, 0.0, -9.80665)
    group = SE23()  # attitude, velocity and position
    inputs = 6  # three angular rates, three accelerations

    def __post_init__(self) -> None:
        super().__post_init__()
        check_noise(self, gyroscope=3, accelerometer=3)

    def move(self, g: Element, u: Vec, w: Vec, h: float) -> Element:
        """(R D, v + h gravity + R dv, p + h v + h^2/2 gravity + R dp), (D, dv, dp) the exponential of SGal(3)."""
        return _navigated(g, u[:3] + w[:3], u[3:] + w[3:6], w[6:], self.gravity, h)

    def deviations(self, h: float) -> Vec:
        """The deviations of the means of angular velocity and force over a step, and of the position beside them."""
        return _inertial(self.gyroscope, self.accelerometer, h)


@record
class BiasedImu(Process):
    """An inertial unit whose biases wander, on SE_2(3) x R^6: (w, a) are measured with (b_w, b_a) added.

    wander : (6,) densities of the random walks of the biases, of gyroscope and accelerometer.

    Source: Hartley, Ghaffari, Eustice, Grizzle, Int. J. Robotics Research 39 (2020), section 4.
    """

    gyroscope: Vec
    accelerometer: Vec
    wander: Vec
    gravity: Vec = (0.0, 0.0, -9.80665)
    group = ProductGroup(SE23(), VectorSpace(6))  # SE_2(3) x R^6, of motions and biases
    inputs = 6  # three angular rates, three accelerations

    def __post_init__(self) -> None:
        super().__post_init__()
        check_noise(self, gyroscope=3, accelerometer=3, wander=6)

    def move(self, g: Element, u: Vec, w: Vec, h: float) -> Element:
        """The motion of an Imu without biases for u - b; the biases change by h w_b."""
        x, b = self.group.split(g)
        turn, force = u[:3] - b[:3] + w[:3], u[3:] - b[3:] + w[3:6]
        navigated = _navigated(x, turn, force, w[6:9], self.gravity, h)
        return self.group.join(navigated, b + h * w[9:])

    def deviations(self, h: float) -> Vec:
        """The deviations of an Imu without biases, and wander/sqrt(h)."""
        return vec(*_inertial(self.gyroscope, self.accelerometer, h), *(self.wander / sqrt(h)))


@record
class BiasedGyroscope(Process):
    """An attitude by a gyroscope whose bias wanders, on SO(3) x R^3: R' = R (u - b + w).

    density, wander : (3,), rad/s and rad/s^2 per root of Hz.

    Source: Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014),
    section 6.2.4.
    """

    density: Vec
    wander: Vec
    group = ProductGroup(SO3(), VectorSpace(3))  # SO(3) x R^3, of attitudes and biases
    inputs = 3  # three angular rates

    def __post_init__(self) -> None:
        super().__post_init__()
        check_noise(self, density=3, wander=3)

    def move(self, g: Element, u: Vec, w: Vec, h: float) -> Element:
        """(R exp(h (u - b + w_1)), b + h w_2)."""
        R, b = self.group.split(g)
        turned = SO3().compose_exp(R, h * (u - b + w[:3]))
        return self.group.join(turned, b + h * w[3:])

    def deviations(self, h: float) -> Vec:
        """The deviations of the noise, density/sqrt(h) and wander/sqrt(h)."""
        return vec(*(self.density / sqrt(h)), *(self.wander / sqrt(h)))
