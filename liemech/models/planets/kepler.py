"""Kepler's problem: a planet about a sun, and its exact motion."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Vec, dot, norm, record, vec
from ...formulas.classes.derived import closed_form_of
from ...systems.canonical import CanonicalState
from ...systems.separable import SeparableSystem
from ..input_checks import alone, check_positive, exact_times


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
    time_unit: ClassVar[str] = ""

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
        """The force over the depth of the potential, f/(-V) = -q/|q|^2.  q : (2,)."""
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
        constants = {"angular momentum": self.angular_momentum(q, p), "Runge-Lenz vector": self.runge_lenz(q, p)}
        return super().constants(states) | {name: np.asarray(value) for name, value in constants.items()}

    # ---------------------------------------------------------------- the exact motion

    def pericentre(self, eccentricity: float, axis: float = 1.0) -> CanonicalState:
        """The start of an orbit at its pericentre, on the positive x-axis, counterclockwise.
        axis : the semi-major one, in m.
        """
        if not 0.0 <= eccentricity < 1.0:
            raise InvalidInput(f"Kepler.pericentre: eccentricity is at least 0 and less than 1; got {eccentricity}")
        if not 0.0 < axis < np.inf:
            raise InvalidInput(f"Kepler.pericentre: axis is positive; got {axis}")
        speed = np.sqrt(self.attraction / axis * (1.0 + eccentricity) / (1.0 - eccentricity))
        return self.state([axis * (1.0 - eccentricity), 0.0], [0.0, speed])

    @closed_form_of("kinetic", "potential")
    def period(self, start: CanonicalState) -> float:
        """The time of a revolution, 2 pi (a^3/k)^(1/2), in s."""
        alone(start, "Kepler.period", "planet")
        energy = float(self.energy(start.q, start.p))
        if not energy < 0.0:
            raise InvalidInput(f"Kepler.period: the orbit is no ellipse, its energy is {energy:.3g}")
        axis = -0.5 * self.attraction / energy
        return float(2.0 * np.pi * np.sqrt(axis**3 / self.attraction))

    @closed_form_of("kinetic", "potential")
    def exact(self, start: CanonicalState, t: Any) -> CanonicalState:
        """The exact motion on an ellipse, a parabola or a hyperbola, by Kepler's equation in
        universal variables.  t : () or (n,), in s, from the start.  Returns q, p : (..., 2).

            t - t_0 = p s c_1 + k s^3 c_3,  c_n Stumpff's functions of b s^2,  r = p + k e s^2 c_2

        p is the distance of the pericentre, b = -2 H, e the eccentricity.  A planet without angular
        momentum comes back from the sun.

        Source: Danby, Fundamentals of Celestial Mechanics, 2nd ed., section 6.9.
        """
        from .exact_kepler import exact_kepler

        name = "Kepler.exact"
        alone(start, name, "planet")
        times = exact_times(t, name)
        rows = exact_kepler(start.q, start.p, self.attraction, times.reshape(-1))
        if not np.isfinite(rows).all():
            met = times.reshape(-1)[~np.isfinite(rows).all(axis=1)][0]
            raise InvalidInput(
                f"{name}: at t = {met:.6g} the planet meets the sun, or numbers leave the range of floats"
            )
        return CanonicalState(rows[:, :2].reshape(*times.shape, 2), rows[:, 2:].reshape(*times.shape, 2))
