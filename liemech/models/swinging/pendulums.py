"""Pendulums in a plane, single and double, in canonical coordinates: angles and their momenta."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Vec, cos, record, sin, vec
from ...formulas.classes.derived import closed_form_of
from ...formulas.classes.fields import frozen_array
from ...systems.canonical import CanonicalState, HamiltonianSystem
from ...systems.separable import SeparableSystem
from ..input_checks import alone, check_positive, exact_motion, exact_times


@record
class Pendulum(SeparableSystem):
    """A mathematical pendulum, H(q, p) = p^2/(2 m l^2) - m g l cos q.

    mass : m, in kg.  length : l, in m.  gravity : g, in m/s^2.
    q : the angle from the downward vertical, in rad.  p : its momentum m l^2 q', in kg m^2/s.

    Source: Hairer, Lubich, Wanner, I.1.3.
    """

    degrees: ClassVar[int] = 1

    mass: float = 1.0
    length: float = 1.0
    gravity: float = 9.80665

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "mass", "length")

    def kinetic(self, p: Vec) -> float:
        """p^2/(2 m l^2), in J.  p : (1,)."""
        return p[0] * p[0] / (2.0 * self.mass * self.length * self.length)

    def potential(self, q: Vec) -> float:
        """-m g l cos q, in J.  q : (1,)."""
        return -self.mass * self.gravity * self.length * cos(q[0])

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """p/(m l^2).  q, p : (1,)."""
        return p / (self.mass * self.length * self.length)

    def force(self, q: Vec, p: Vec) -> Vec:
        """-m g l sin q.  q, p : (1,)."""
        return vec(-self.mass * self.gravity * self.length * sin(q[0]))

    def momentum(self, q: Vec, velocity: Vec) -> Vec:
        """The momentum that belongs to an angular velocity, m l^2 q'.  q, velocity : (1,)."""
        return self.mass * self.length * self.length * velocity

    # ---------------------------------------------------------------- the exact motion

    @closed_form_of("kinetic", "potential")
    def exact(self, start: CanonicalState, t: Any) -> CanonicalState:
        """The exact motion, swings, turns and the separatrix, by elliptic functions; error about
        1e-15 (1 + w t), w = sqrt(g/l).

        t : () or (n,), in s, from the start.  Returns q, p : (..., 1); q counts whole turns.
        The parameters and the start are taken to be exact.

        Source: Whittaker, Analytical Dynamics, 4th ed., section 44.
        """
        q, p = _single(start, "Pendulum.exact")
        times = exact_times(t, "Pendulum.exact")
        inertia = self.mass * self.length * self.length
        swing = self._swing(q, p) if self.gravity else None

        def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            if swing is not None:
                return swing.at(t)
            steady = 0.0 if self.gravity else p / inertia
            return q + steady * t, np.full(t.shape, steady)

        angle, speed = exact_motion(motion, times, "Pendulum.exact")
        return CanonicalState(frozen_array(angle[..., None], "q"), frozen_array(inertia * speed[..., None], "p"))

    @closed_form_of("kinetic", "potential")
    def period(self, start: CanonicalState) -> float:
        """The time after which the pendulum moves as before, in s; infinite on the separatrix, 0 if
        it hangs or stands still.
        """
        q, p = _single(start, "Pendulum.period")
        if self.gravity == 0.0:
            return abs(2.0 * np.pi * self.mass * self.length * self.length / p) if p else 0.0
        swing = self._swing(q, p)
        return 0.0 if swing is None else swing.period

    def _swing(self, q: float, p: float) -> Any:
        from .exact_pendulum import pendulum

        return pendulum(q, p, self.mass, self.gravity, self.length)


def _single(start: CanonicalState, name: str) -> tuple[float, float]:
    alone(start, name, "pendulum")
    return float(start.q[0]), float(start.p[0])


@record
class DoublePendulum(HamiltonianSystem):
    """A double pendulum: chaotic, with a kinetic energy that depends on the angles.

        L = (m1 + m2) l1^2 a'^2/2 + m2 l2^2 b'^2/2 + m2 l1 l2 cos(a - b) a' b' + (m1 + m2) g l1 cos
        a + m2 g l2 cos b

    masses : m1, m2, in kg.  lengths : l1, l2, in m.  gravity : g, in m/s^2.
    q = (a, b) : the angles of both from the downward vertical, in rad.  p = dL/dq' : in kg m^2/s;
    `momentum` gives it.

    Source: Landau and Lifshitz, Mechanics, 3rd ed., section 5, problem 1.
    """

    degrees: ClassVar[int] = 2

    masses: Vec = vec(1.0, 1.0)
    lengths: Vec = vec(1.0, 1.0)
    gravity: float = 9.80665

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("masses", "lengths"):
            if len(getattr(self, name)) != 2:
                raise InvalidInput(f"{type(self).__name__}: {name} are two, (2,); got {getattr(self, name)}")
        check_positive(self, "masses", "lengths")

    def energy(self, q: Vec, p: Vec) -> float:
        """p . M(q)^-1 p/2 - (m1 + m2) g l1 cos a - m2 g l2 cos b, in J.  q, p : (2,)."""
        v, (first, second) = self._velocity(q, p), self._weights()
        return 0.5 * (p[0] * v[0] + p[1] * v[1]) - first * cos(q[0]) - second * cos(q[1])

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """The angular velocities M(q)^-1 p.  q, p : (2,)."""
        return self._velocity(q, p)

    def _velocity(self, q: Vec, p: Vec) -> Vec:
        first, second, coupled = self._inertia(q)
        determinant = first * second - coupled * coupled
        return vec(second * p[0] - coupled * p[1], first * p[1] - coupled * p[0]) / determinant

    def force(self, q: Vec, p: Vec) -> Vec:
        """dL/dq at the velocities that belong to p.  q, p : (2,)."""
        v, (first, second) = self._velocity(q, p), self._weights()
        turning = self.masses[1] * self.lengths[0] * self.lengths[1] * sin(q[0] - q[1]) * v[0] * v[1]
        return vec(-turning - first * sin(q[0]), turning - second * sin(q[1]))

    def momentum(self, q: Vec, velocity: Vec) -> Vec:
        """The momenta that belong to angular velocities, M(q) q'.  q, velocity : (2,)."""
        first, second, coupled = self._inertia(q)
        return vec(first * velocity[0] + coupled * velocity[1], coupled * velocity[0] + second * velocity[1])

    def _inertia(self, q: Vec) -> Any:
        """M(q): its entries M_11, M_22 and M_12."""
        m, l = self.masses, self.lengths
        return ((m[0] + m[1]) * l[0] * l[0], m[1] * l[1] * l[1], m[1] * l[0] * l[1] * cos(q[0] - q[1]))

    def _weights(self) -> Any:
        """The factors of -cos a and -cos b in the potential energy."""
        m, l = self.masses, self.lengths
        return (m[0] + m[1]) * self.gravity * l[0], m[1] * self.gravity * l[1]
