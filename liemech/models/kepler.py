"""Kepler's problem: a planet about a sun, and its exact motion."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ..errors import InvalidInput
from ..formulas import Vec, dot, norm, record, vec
from ..systems.canonical import CanonicalState
from ..systems.separable import SeparableSystem
from ..systems.system import exact_times
from .pendulums import check_positive


@record
class Kepler(SeparableSystem):
    """A planet in a plane, attracted by a sun in the origin, H(q, p) = |p|^2/2 - k/|q|.

    attraction : k = G M, in m^3/s^2 (of the Sun 1.32712440018e20); 1 by default.
    q : the position, (2,), in m.  p : the velocity, (2,), in m/s, that is the momentum for a unit
    mass.

    Conserved: the energy, the angular momentum and the Runge-Lenz vector, which points to the
    pericentre.

    Source: Hairer, Lubich, Wanner, I.2; Goldstein, Classical Mechanics, 3rd ed., section 3.9
    (Runge-Lenz vector).
    """

    called: ClassVar[str] = "kepler"
    degrees: ClassVar[int] = 2

    attraction: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "attraction")

    def kinetic(self, p: Vec) -> float:
        """|p|^2/2, in J/kg.  p : (2,)."""
        return 0.5 * dot(p, p)

    def potential(self, q: Vec) -> float:
        """-k/|q|, in J/kg.  q : (2,)."""
        return -self.attraction / norm(q)

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """p.  q, p : (2,)."""
        return p

    def force(self, q: Vec, p: Vec) -> Vec:
        """-k q/|q|^3.  q, p : (2,)."""
        square = dot(q, q)
        return (-self.attraction / (square * norm(q))) * q

    def relative_force(self, q: Vec) -> Vec:
        """-q/|q|^2.  q : (2,)."""
        return (-1.0 / dot(q, q)) * q

    def angular_momentum(self, q: Vec, p: Vec) -> float:
        """x p_y - y p_x.  q, p : (2,)."""
        return q[0] * p[1] - q[1] * p[0]

    def runge_lenz(self, q: Vec, p: Vec) -> Vec:
        """The vector p x L/k - q/|q|: from the sun to the pericentre, as long as the eccentricity.
        q, p : (2,).
        """
        L = self.angular_momentum(q, p)
        return (L / self.attraction) * vec(p[1], -p[0]) - q / norm(q)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, angular momentum, Runge-Lenz vector."""
        q, p = states["q"], states["p"]
        kept = {
            "angular momentum": self.angular_momentum(q, p),
            "Runge-Lenz vector": self.runge_lenz(q, p),
        }
        return super().constants(states) | {name: np.asarray(value) for name, value in kept.items()}

    # ---------------------------------------------------------------- the exact motion

    def pericentre(self, eccentricity: float, axis: float = 1.0) -> CanonicalState:
        """The start of an orbit at its pericentre, on the positive x-axis, counterclockwise.
        axis : the semi-major one, in m.
        """
        if not 0.0 <= eccentricity < 1.0:
            raise InvalidInput(
                f"Kepler.pericentre: eccentricity is at least 0 and less than 1; got {eccentricity}"
            )
        if not 0.0 < axis < np.inf:
            raise InvalidInput(f"Kepler.pericentre: axis is positive; got {axis}")
        speed = np.sqrt(self.attraction / axis * (1.0 + eccentricity) / (1.0 - eccentricity))
        return self.state([axis * (1.0 - eccentricity), 0.0], [0.0, speed])

    def period(self, start: CanonicalState) -> float:
        """The time of a revolution, 2 pi (a^3/k)^(1/2), in s."""
        q, p = _single(start, "Kepler.period")
        return float(
            2.0 * np.pi * np.sqrt(self._axis(q, p, "Kepler.period") ** 3 / self.attraction)
        )

    def exact(self, start: CanonicalState, t: Any) -> CanonicalState:
        """The exact motion on an ellipse, by Kepler's equation.  t : () or (n,), in s, from the
        start.  Returns q, p : (..., 2).

            E - e sin E = M,  M = M_0 + n t,     q(t) = f q + g p,  p(t) = f' q + g' p

        Source: Danby, Fundamentals of Celestial Mechanics, 2nd ed., chapter 6 (Kepler's equation, f
        and g).
        """
        name = "Kepler.exact"
        q, p = _single(start, name)
        t, k = exact_times(t, name), self.attraction
        a, r0, sigma = self._axis(q, p, name), np.hypot(*q), q @ p / np.sqrt(k)
        n = np.sqrt(k / a**3)
        e_cos, e_sin = 1.0 - r0 / a, sigma / np.sqrt(a)  # e cos E_0, e sin E_0
        e, E0 = np.hypot(e_cos, e_sin), np.arctan2(e_sin, e_cos)
        past = np.remainder(t, 2.0 * np.pi / n)
        change = kepler_equation(e, E0 - e_sin + n * past) - E0
        c, s = np.cos(change), np.sin(change)
        r = a * (1.0 - e_cos * c + e_sin * s)
        versine = 2.0 * np.sin(0.5 * change) ** 2
        f, g = 1.0 - a / r0 * versine, past - (change - s) / n
        df, dg = -np.sqrt(k * a) / (r * r0) * s, 1.0 - a / r * versine
        return CanonicalState(
            f[..., None] * q + g[..., None] * p, df[..., None] * q + dg[..., None] * p
        )

    def _axis(self, q: np.ndarray, p: np.ndarray, name: str) -> float:
        """The semi-major axis."""
        energy = 0.5 * (p @ p) - self.attraction / np.hypot(*q)
        if not energy < 0.0:
            raise InvalidInput(
                f"{name}: the orbit is no ellipse, its energy is {energy:.3g}; integrate it"
            )
        return float(-0.5 * self.attraction / energy)


def kepler_equation(e: float, M: Any) -> np.ndarray:
    """The eccentric anomaly, E - e sin E = M, of a mean anomaly in rad, by Newton's method.

    Source: Danby, Fundamentals of Celestial Mechanics, 2nd ed., section 6.6.
    """
    M = np.asarray(M, dtype=float)
    E = M + 0.85 * e * np.sign(np.sin(M))
    for _ in range(20):
        correction = (E - e * np.sin(E) - M) / (1.0 - e * np.cos(E))
        E = E - correction
        if (np.abs(correction) <= 1e-9 * (1.0 + np.abs(E))).all():
            break
    return E


def _single(start: CanonicalState, name: str) -> tuple[np.ndarray, np.ndarray]:
    if start.bodies is not None:
        raise InvalidInput(f"{name} takes one planet at a time; loop over the ensemble")
    return np.array(start.q), np.array(start.p)
