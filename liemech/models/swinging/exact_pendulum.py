"""The plane pendulum in closed form: Jacobi's elliptic functions for swings and turns, hyperbolic
ones between.

    theta'' = -w^2 sin theta,   k^2 = sin^2(theta/2) + (theta'/(2 w))^2

    swings, k < 1:   sin(theta/2) = k sn u,  cos(theta/2) = dn u,  theta' = 2 w k cn u,   u = u_0 + w t,     modulus k
    turns,  k > 1:   sin(theta/2) = sn u,    cos(theta/2) = cn u,  theta' = 2 w k dn u,   u = u_0 + k w t,   modulus 1/k

k = 1 is the separatrix.  What tells swings from turns, 1 - k^2 = (1 + cos
theta)/2 - (theta'/(2 w))^2, is computed with a hundred digits from the numbers given: no nearness
of the separatrix spoils the time at which the pendulum passes its highest point.

Source: Whittaker, Analytical Dynamics, 4th ed., section 44; DLMF 22.19(i).
"""

from __future__ import annotations

import math
from decimal import Context, Decimal, localcontext
from typing import NamedTuple

import numpy as np

from ..bodies.jacobi import Jacobi
from ..planets.decimals import DIGITS, PI, cos_sin


class Swing(NamedTuple):
    """A motion of the pendulum: theta = shift + sign * (the formulas above).

    rate : of u, in 1/s.  begin : u_0.  k : the modulus of swings, the inverse of that of turns.
    """

    jacobi: Jacobi
    turns: bool
    k: float
    frequency: float
    begin: float
    sign: float
    shift: float

    @property
    def rate(self) -> float:
        """The rate u' of the argument of the elliptic functions."""
        return self.k * self.frequency if self.turns else self.frequency

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """theta and theta' at the times t."""
        s, c, d, halves = self.jacobi.functions(self.begin + self.rate * t)
        if self.turns:
            angle, speed = 2.0 * (np.arctan2(s, c) + math.pi * halves), d
        else:
            odd = 1.0 - 2.0 * np.abs(halves - 2.0 * np.round(0.5 * halves))
            angle, speed = 2.0 * odd * np.arctan2(self.k * s, d), odd * c
        return self.shift + self.sign * angle, (self.sign * 2.0 * self.k * self.frequency) * speed

    @property
    def period(self) -> float:
        """After which time the motion returns, of a turning pendulum up to a whole turn."""
        return (1.0 if self.turns else 2.0) * self.jacobi.half / self.rate


def pendulum(theta: float, momentum: float, mass: float, gravity: float, length: float) -> Swing | None:
    """The motion from theta, in rad, with the momentum m l^2 theta', under gravity, not 0; None if
    the pendulum stays where it is.

    Source: Whittaker, Analytical Dynamics, 4th ed., section 44.
    """
    with localcontext(Context(prec=DIGITS + 20)):
        square = abs(Decimal(gravity)) / Decimal(length)
        angle = Decimal(theta) - (PI if gravity < 0.0 else 0)
        reduced = angle - 2 * PI * (angle / (2 * PI)).to_integral_value()
        cosine, sine = cos_sin(reduced)
        speed = Decimal(momentum) / (Decimal(mass) * Decimal(length) ** 2)
        fall = speed * speed / (4 * square)
        high, low = (1 + cosine) / 2, (1 - cosine) / 2
        high, low = max(high, Decimal(0)), max(low, Decimal(0))
        least, k = high - fall, float((low + fall).sqrt())
        if abs(least) < Decimal(10) ** -DIGITS:
            least = Decimal(0)
        frequency, shift = float(square.sqrt()), float(Decimal(theta) - reduced)
        S = math.copysign(float(low.sqrt()), sine)
        C, V, k1 = float(high.sqrt()), float(fall.sqrt()), float(abs(least).sqrt())
    if k == 0.0 or (momentum == 0.0 and (C < 1e-60 or S == 0.0)):
        return None
    sign = -1.0 if momentum < 0.0 else 1.0
    turns = least < 0
    jacobi = Jacobi.of_modulus(k1 / k if turns else k1)
    begin = jacobi.argument(sign * S, C) if turns else jacobi.argument(sign * S / k, C if not jacobi.k1 else V / k)
    return Swing(jacobi, turns, k, frequency, begin, sign, shift)
