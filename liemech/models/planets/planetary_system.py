"""Planets about a heavy sun: the N-body problem in Jacobi's coordinates, Kepler motions and what
planets do to each other.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import InvalidInput, NoConvergence
from ...formulas import Vec, check_finite, dot, norm, plain, real_array, record, vec, where
from ...formulas.calls.lanes import in_lanes
from ...groups.poisson_structure import Canonical, PoissonStructure
from ...rooms.poisson.poisson import PoissonState, PoissonSystem
from ...systems.hamiltonian import Hamiltonian
from ...systems.parts import Part, SplitHamiltonian, StraightLineFlow
from ..input_checks import check_positive
from .n_body import NBody
from .universal_variables import solved


def kepler_step(q: Vec, v: Vec, k: float, t: float) -> tuple[Vec, Vec]:
    """The change of q and v in the time t under the attraction -k q/|q|^3: on ellipses, parabolas and
    hyperbolas.

    The search for s begins with its series in powers of t, for short times correct to t^4.
    q, v : (3,).  Raises NoConvergence.

    Source: Danby, Fundamentals of Celestial Mechanics, 2nd ed., section 6.9 (universal variables).
    """
    r0 = norm(q)
    over = 1.0 / r0
    b, e0 = 2.0 * k * over - dot(v, v), dot(q, v)
    z = k - b * r0
    s = first_guess(t * over, e0 * over, z * over, b)
    G1, G2, G3, ended = solved(r0, e0, k, b, t, s)
    if not ended:
        raise NoConvergence(
            "Kepler's equation was not solved: a planet meets the sun, or the step is many periods long"
        )
    pull = k / (r0 + e0 * G1 + z * G2)  # k/r
    f, g = -k * G2 * over, t - k * G3
    df, dg = -pull * G1 * over, -pull * G2
    return f * q + g * v, df * q + dg * v


def first_guess(u: float, e: float, z: float, b: float) -> float:
    """The s with  u = s + e s^2/2 + z s^3/6 - b e s^4/24 + ...,  to fourth order in u; u itself
    where that is no short time.
    """
    A, B, C = (0.5 * e) * u, (z * u) * (u * (1.0 / 6.0)), (b * u) * (u * u) * (e * (-1.0 / 24.0))
    short = abs(A) + abs(B) + abs(C) < 0.25
    return where(short, u * (1.0 - A + (2.0 * A * A - B) + (5.0 * A * (B - A * A) - C)), u)


@record
class KeplerMotions(Part):
    """Planets on Kepler's orbits in Jacobi's coordinates, sum |P_i|^2/(2 m'_i) - G m'_i M_i/|Q_i|:
    their motion is exact.

    masses : m'_i, reduced ones.  attractions : G M_i.

    Source: Wisdom and Holman, Astron. J. 102 (1991), 1528.
    """

    masses: Vec
    attractions: Vec

    def energy(self, mu: Vec) -> float:
        """The energy.  mu : (6n,), the point (Q, P)."""
        total, n = 0.0, len(self.masses)
        for i, m in enumerate(self.masses):
            Q, P = _body(mu, i), _body(mu, n + i)
            total = total + (dot(P, P) / (2.0 * m) - m * self.attractions[i] / norm(Q))
        return total

    def gradient(self, mu: Vec) -> Vec:
        """(G m'_i M_i Q_i/|Q_i|^3, P_i/m'_i).  mu : (6n,)."""
        pulls: list[Any] = []
        velocities: list[Any] = []
        for i, m in enumerate(self.masses):
            Q, P = _body(mu, i), _body(mu, len(self.masses) + i)
            pulls = [*pulls, *((m * self.attractions[i] / (dot(Q, Q) * norm(Q))) * Q)]
            velocities = [*velocities, *(P / m)]
        return vec(*pulls, *velocities)

    def flow(self, structure: PoissonStructure, y: Vec, t: float) -> Vec:
        """Every planet along its orbit.  y : (6n,)."""
        start, n = plain(y), len(self.masses)
        places = [_body(start, i) for i in range(n)]
        speeds = [_body(start, n + i) / m for i, m in enumerate(self.masses)]
        moved = in_lanes(kepler_step, places, speeds, [*self.attractions], [t for _ in range(n)])
        gains = [x for gain, _ in moved for x in gain]
        kicks = [m * x for m, (_, kick) in zip(self.masses, moved) for x in kick]
        return y + vec(*gains, *kicks)


@record
class Perturbation(Hamiltonian):
    """The rest of the energy: the attraction between planets, and that of the sun less the one of Kepler's
    orbits; a function of positions.

    masses : of all bodies, the sun first.  gravity : G.

    Source: Wisdom and Holman, Astron. J. 102 (1991), 1528; Rein and Tamayo, Mon. Not. R. Astron.
    Soc. 452 (2015), 376.
    """

    masses: Vec
    gravity: float

    def energy(self, mu: Vec) -> float:
        """The energy.  mu : (6n,), the point (Q, P)."""
        m, total, inside = self.masses, 0.0, self.masses[0]
        places = self.places(mu)
        for i in range(1, len(m)):
            total = total + self.gravity * m[i] * inside / norm(_body(mu, i - 1))
            inside = inside + m[i]
            for j in range(i):
                total = total - self.gravity * m[i] * m[j] / norm(places[i] - places[j])
        return total

    def gradient(self, mu: Vec) -> Vec:
        """(dV/dQ, 0).  mu : (6n,)."""
        m, G, n = self.masses, self.gravity, len(self.masses)
        places, inside = self.places(mu), self.masses[0]
        # the sun and the first planet are Kepler's problem
        pairs = [(i, j) for i in range(2, n) for j in range(i)]
        apart = [places[i] - places[j] for i, j in pairs]
        strengths = [G * m[i] * m[j] for i, j in pairs]
        for i in range(1, n):
            if i > 1:
                apart, strengths = ([*apart, _body(mu, i - 1)], [*strengths, -(G * m[i] * inside)])
            inside = inside + m[i]
        pulls = in_lanes(_pull, apart, strengths)
        slopes = [vec(0.0, 0.0, 0.0) for _ in m]
        for (i, j), pull in zip(pairs, pulls):
            slopes[i], slopes[j] = slopes[i] + pull, slopes[j] - pull
        gradient: list[Any] = []
        outside = vec(0.0, 0.0, 0.0)
        for i in range(n - 1, 0, -1):
            slope = slopes[i] + (m[i] / inside) * outside
            inside = inside - m[i]
            if i > 1:
                slope = slope + pulls[len(pairs) + i - 2]
            outside = outside + slopes[i]
            gradient = [*slope, *gradient]
        return vec(*gradient, *[0.0 for _ in range(3 * (n - 1))])

    def places(self, mu: Vec) -> Any:
        """Positions seen from the sun."""
        m, inside = self.masses, self.masses[0]
        centre = vec(0.0, 0.0, 0.0)
        places = [centre]
        for i in range(1, len(m)):
            Q = _body(mu, i - 1)
            places = [*places, centre + Q]
            inside = inside + m[i]
            centre = centre + (m[i] / inside) * Q
        return places


def _pull(x: Vec, strength: float) -> Vec:
    return (strength / (dot(x, x) * norm(x))) * x


def _body(y: Vec, i: int) -> Vec:
    return vec(y[3 * i], y[3 * i + 1], y[3 * i + 2])


@record
class PlanetarySystem(PoissonSystem):
    """Planets about a sun in Jacobi's coordinates y = (Q, P), Q_i the position of a planet seen
    from the centre of those inside.

    masses : the sun's, and those of the planets from the inside out, (n + 1,).  gravity : G.
    The energy is that of Kepler's orbits, whose motion is exact, and a small rest that kicks:
    `Splitting` is the method of Wisdom and Holman, with `lm.tableaus.SPLITTINGS["ABA (10, 6, 4)"]`
    one for small rests.
    The centre of mass rests.  `state_of` and `bodies` translate from and to `NBody`.

    Source: Wisdom and Holman, Astron. J. 102 (1991), 1528; Hairer, Lubich, Wanner, XIII.
    """

    structure: Canonical = field(init=False, repr=False)
    hamiltonian: SplitHamiltonian = field(init=False, repr=False)
    masses: Vec
    gravity: float = 1.0

    def __post_init__(self) -> None:
        m = np.array(real_array(self.masses, f"{type(self).__name__}: masses"))
        if m.ndim != 1 or len(m) < 2:
            raise InvalidInput(
                f"{type(self).__name__}: masses are the sun's and one planet's at least; got {self.masses!r}"
            )
        check_finite(m, f"{type(self).__name__}: masses")
        check_positive(self, "masses", "gravity")
        with np.errstate(all="ignore"):
            whole = np.cumsum(m)
            reduced, pulls = m[1:] * whole[:-1] / whole[1:], self.gravity * whole[1:]
        if not (np.isfinite(reduced).all() and np.isfinite(pulls).all()):
            raise InvalidInput(
                f"{type(self).__name__}: products of two masses, or of gravity and a mass, leave the "
                f"range of floats; take another unit of mass; got {self.masses!r}"
            )
        object.__setattr__(self, "structure", Canonical(3 * (len(m) - 1)))
        kepler = KeplerMotions(Vec.of(reduced.tolist()), Vec.of(pulls.tolist()))
        perturbation = StraightLineFlow(Perturbation(Vec.of(m.tolist()), float(self.gravity)))
        object.__setattr__(self, "hamiltonian", SplitHamiltonian((kepler, perturbation)))
        super().__post_init__()

    def state_of(self, q: Any, p: Any) -> PoissonState:
        """The state with these positions and momenta of all bodies, (3 (n + 1),) each, as in
        `NBody`.

        What the centre of mass does is left out.
        """
        m, whole = np.array(self.masses), np.cumsum(np.array(self.masses))
        Q = [real_array(x, f"{type(self).__name__}.state_of").reshape(len(m), 3) for x in (q, p)]
        x, v = Q[0], Q[1] / m[:, None]
        jacobi = []
        for values in (x, v):
            centres = np.cumsum(m[:, None] * values, axis=0) / whole[:, None]
            jacobi.append(values[1:] - centres[:-1])
        reduced = m[1:] * whole[:-1] / whole[1:]
        return self.state(np.concatenate([jacobi[0].ravel(), (reduced[:, None] * jacobi[1]).ravel()]))

    def bodies(self, y: Any) -> tuple[np.ndarray, np.ndarray]:
        """Positions and momenta of all bodies, seen from the centre of mass.  y : (..., 6n),
        returns (..., 3 (n + 1)) each.
        """
        y, m = np.asarray(y, dtype=float), np.array(self.masses)
        whole, n = np.cumsum(m), len(m) - 1
        reduced = m[1:] * whole[:-1] / whole[1:]
        halves = y.reshape(*y.shape[:-1], 2, n, 3)
        of_bodies = []
        for values in (halves[..., 0, :, :], halves[..., 1, :, :] / reduced[:, None]):
            centre, places = np.zeros_like(values[..., 0, :]), [np.zeros_like(values[..., 0, :])]
            for i in range(n):
                places.append(centre + values[..., i, :])
                centre = centre + m[i + 1] / whole[i + 1] * values[..., i, :]
            of_bodies.append(np.stack(places, axis=-2) - centre[..., None, :])
        q, p = of_bodies[0], of_bodies[1] * m[:, None]
        return q.reshape(*y.shape[:-1], -1), p.reshape(*y.shape[:-1], -1)

    @classmethod
    def outer_solar_system(cls) -> tuple[PlanetarySystem, PoissonState]:
        """The Sun (with the inner planets), Jupiter, Saturn, Uranus, Neptune and Pluto on 5
        September 1994; AU, days, Suns.

        Source: Hairer, Lubich, Wanner, I.2.4, table 2.2.
        """
        bodies, start = NBody.outer_solar_system()
        make: Any = cls
        system = make(bodies.masses, bodies.gravity)
        return system, system.state_of(np.array(start.q), np.array(start.p))
