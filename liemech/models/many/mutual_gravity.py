"""Gravity between rigid bodies: orbits and spins feel each other."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, cross, dot, real_array, record, sqrt, vec
from ...formulas.classes.of_each import each
from ...groups.composed.product import ProductGroup
from ...groups.rigid.se3 import join
from ...groups.rigid.so3 import SO3
from ...groups.vector_space import VectorSpace
from ...rooms.sites.graphs import all_pairs
from ...rooms.sites.terms.terms import PerSite, Term, Terms
from ...systems.kinetic_energy import KineticEnergy, times, trace
from ...systems.lie_poisson import LiePoissonSystem
from ...systems.many.site_state import SiteState
from ...systems.mechanical import MechanicalSystem
from ..input_checks import check_positive

NEWTON = 6.6743e-11
"""G in m^3/(kg s^2), CODATA 2018."""


@record
class MutualGravity(Term):
    """The attraction of two rigid bodies up to second order in size over distance:

        V = -G (m m'/r + (m' tr J + m tr J')/(2 r^3) - 3 d . (m' J + m J') d/(2 r^5)),

    with d from the one to the other, r = |d|, and J, J' the inertias turned into space.  A term of
    two on SE3() or ProductGroup(SO3(), VectorSpace(3)), whose element tells the centre of mass and
    the axes of a body; sites have a `mass` and an `inertia`, (3,) or (3, 3), about the centre of
    mass.

    constant : G, in the units of masses, lengths and times.

    What is left out is of fourth order in size over distance for bodies that are symmetric about
    three planes.

    Source: Maciejewski, Reduction, relative equilibria and potential in the two rigid bodies
    problem, Celest. Mech. Dyn. Astron. 63 (1995), 1; Fahnestock and Scheeres, Celest. Mech. Dyn.
    Astron. 96 (2006), 317.
    """

    constant: float = NEWTON

    def energy(self, a: Any, b: Any) -> float:
        """The potential energy of two bodies, to second order in their sizes."""
        d = _centre(b.g) - _centre(a.g)
        first, second = _turned_back(a.g, d), _turned_back(b.g, d)
        square = dot(d, d)
        along = b.mass * dot(first, times(a.inertia, first)) + a.mass * dot(second, times(b.inertia, second))
        whole = b.mass * trace(a.inertia) + a.mass * trace(b.inertia)
        shape = (0.5 / square) * (whole - 3.0 * along / square)
        return -(self.constant / sqrt(square)) * (a.mass * b.mass + shape)

    def force(self, group: Any, k: int, *sites: Any) -> Vec:
        """Torque and force on body k: the torque in its axes, the force in its axes on SE3(), else in space."""
        body, other = sites[k], sites[1 - k]
        d = _centre(other.g) - _centre(body.g)
        d_in_body, d_in_other = _turned_back(body.g, d), _turned_back(other.g, d)
        turned, pulled = times(body.inertia, d_in_body), times(other.inertia, d_in_other)
        square = dot(d, d)
        cube = self.constant / (square * sqrt(square))
        far = 3.0 * cube / square
        whole = other.mass * trace(body.inertia) + body.mass * trace(other.inertia)
        along = other.mass * dot(d_in_body, turned) + body.mass * dot(d_in_other, pulled)
        radial = cube * (body.mass * other.mass) + far * (0.5 * whole - 2.5 * along / square)
        torque = (far * other.mass) * cross(d_in_body, turned)
        beside = _turned(other.g, (far * body.mass) * pulled)
        if len(body.g) == 4:
            force = radial * d_in_body + (far * other.mass) * turned + _turned_back(body.g, beside)
        else:
            force = radial * d + _turned(body.g, (far * other.mass) * turned) + beside
        return join(torque, force)


def _rows(g: Any) -> Any:
    """The rows of the rotation of a pose, (4, 4), or of a rotation and a place in a row, (12,)."""
    if len(g) == 4:
        return g[0][:3], g[1][:3], g[2][:3]
    return g[0:3], g[3:6], g[6:9]


def _centre(g: Any) -> Vec:
    """The place of the centre of mass, (3,)."""
    return vec(g[0][3], g[1][3], g[2][3]) if len(g) == 4 else g[9:12]


def _turned(g: Any, x: Vec) -> Vec:
    """The vector R x in space."""
    return vec(*[dot(row, x) for row in _rows(g)])


def _turned_back(g: Any, x: Vec) -> Vec:
    """The vector R^T x in body axes."""
    rows = _rows(g)
    return vec(*[rows[0][k] * x[0] + rows[1][k] * x[1] + rows[2][k] * x[2] for k in range(3)])


# ------------------------------------------------------------------ ready systems

KW4 = ((2.353e12, (3.8767e17, 4.0605e17, 4.6104e17)), (0.135e12, (2.0963e15, 3.1614e15, 3.7114e15)))
"""Masses and principal moments of Alpha and Beta, kg and kg m^2: the moments are those of the two
radar shape models, filled evenly.
"""

KW4_DISTANCE, KW4_SPIN = 2548.0, 2.7645 * 3600.0
"""The semi-major axis in m; the period of Alpha's spin in s."""

SUN_EARTH_MOON = (
    (1.98841e30, (6.9e46, 6.9e46, 6.9e46), 25.38 * 86400.0),
    (5.97217e24, (8.0101e37, 8.0103e37, 8.0365e37), 86164.0905),
    (7.3458e22, (8.7295e34, 8.7315e34, 8.7367e34), 27.321661 * 86400.0),
)
"""Masses, principal moments, periods of the spins: kg, kg m^2, s."""


@record
class GravitatingBodies(MechanicalSystem):
    """Rigid bodies that attract each other, orbits and spins together: the full N-body problem up to
    second order in size over distance, `MutualGravity` of all pairs.

    masses : (N,), in kg.  inertias : principal moments about the centres of mass, (N, 3), in
    kg m^2.  gravity : G.
    Configurations are those of ProductGroup(SO3(), VectorSpace(3)) ** N.  mu, (N, 6): spins in the
    axes of each body, momenta in space.  g, (N, 12): the rotations from body to space row by row,
    and the centres of mass.  `state_of` takes places, velocities, axes and spins.

    Conserved: the energy, the total momentum and the total angular momentum, of spins and orbits
    together.

    Source: Maciejewski, Celest. Mech. Dyn. Astron. 63 (1995), 1; Fahnestock and Scheeres, Celest.
    Mech. Dyn. Astron. 96 (2006), 317.
    """

    body: LiePoissonSystem = field(init=False, repr=False)
    potential: Any = field(init=False, repr=False)
    masses: Vec
    inertias: Mat
    gravity: float = NEWTON

    def __post_init__(self) -> None:
        name = type(self).__name__
        m = real_array(self.masses, f"{name}: masses")
        J = real_array(self.inertias, f"{name}: inertias")
        if m.ndim != 1 or len(m) < 2 or J.shape != (len(m), 3):
            raise InvalidInput(
                f"{name}: masses are (N,), two at least, and inertias (N, 3); got shapes {m.shape} and {J.shape}"
            )
        for what, values in (("masses", m), ("inertias", J)):
            if not (values > 0.0).all():
                raise InvalidInput(f"{name}: {what} must be positive; got {values.min():g}")
        if (2.0 * J.max(axis=1) > (1.0 + 1e-12) * J.sum(axis=1)).any():
            i = int((2.0 * J.max(axis=1) / J.sum(axis=1)).argmax())
            raise InvalidInput(
                f"{name}: inertias[{i}] = {J[i].tolist()} are those of no body: no principal moment "
                "is larger than the sum of the two others"
            )
        kinetic: Any = PerSite(KineticEnergy(each(np.column_stack([J, m, m, m]))))
        group = ProductGroup(SO3(), VectorSpace(3)) ** len(m)
        object.__setattr__(self, "body", LiePoissonSystem(group, kinetic))
        pulls = MutualGravity(self.gravity).over(all_pairs())
        object.__setattr__(self, "potential", Terms(pulls, mass=each(m), inertia=each(J)))
        super().__post_init__()
        check_positive(self, "gravity")

    def state_of(self, places: Any, velocities: Any, axes: Any, spins: Any) -> SiteState:
        """The state of bodies whose centres of mass are at these places, (N, 3), with velocities
        (N, 3), axes from body to space, (N, 3, 3), and angular velocities in body axes, (N, 3).
        """
        name, m = f"{type(self).__name__}.state_of", np.array(self.masses)
        x, v, R, w = (
            real_array(value, f"{name}: {what}")
            for what, value in (("places", places), ("velocities", velocities), ("axes", axes), ("spins", spins))
        )
        n = len(m)
        for what, value, shape in (
            ("places", x, (n, 3)),
            ("velocities", v, (n, 3)),
            ("axes", R, (n, 3, 3)),
            ("spins", w, (n, 3)),
        ):
            if value.shape != shape:
                raise InvalidInput(f"{name}: {what} have shape {value.shape}; give {shape}")
        start: SiteState = self.state(  # type: ignore[assignment]
            mu=np.column_stack([np.array(self.inertias) * w, m[:, None] * v]), g=np.column_stack([R.reshape(n, 9), x])
        )
        return start

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, momentum, and angular momentum about the origin, of spins and orbits together."""
        n = len(self.masses)
        mu = states["mu"].reshape(len(states["mu"]), n, 6)
        g = states["g"].reshape(len(mu), n, 12)
        spin = np.einsum("...ij,...j->...i", g[..., :9].reshape(-1, n, 3, 3), mu[..., :3])
        turning = spin + np.cross(g[..., 9:], mu[..., 3:])
        return super().constants(states) | {
            "momentum": mu[..., 3:].sum(axis=1),
            "angular momentum": turning.sum(axis=1),
        }

    # ---------------------------------------------------------------- known bodies

    @classmethod
    def asteroid_1999_kw4(cls, tilt: float = 0.0, libration: float = 0.0) -> tuple[GravitatingBodies, SiteState]:
        """The binary asteroid (66391) 1999 KW4, Moshup and Squannit: Alpha spins in 2.7645 hours,
        Beta orbits it in about 17.4 hours, keeping one face to it; metres, seconds, kilograms.

        tilt : of Alpha's spin from the normal of the orbit, in rad.  libration : the angle by which
        Beta's long axis begins off the line to Alpha, in rad.

        Source: Ostro et al., Science 314 (2006), 1276 (masses, distance, spins); Fahnestock and
        Scheeres, Icarus 194 (2008), 410.  The shape models that the moments belong to: Davis and
        Scheeres, Icarus 341 (2020), 113439.
        """
        system = cls(masses=[m for m, _ in KW4], inertias=[J for _, J in KW4])
        m = np.array(system.masses)
        share = np.array([[-m[1]], [m[0]]]) / m.sum()
        along, across = np.eye(3)[:2]
        turn = SO3().exp(np.array([tilt, 0.0, 0.0])), SO3().exp(np.array([0.0, 0.0, libration]))
        places = share * (KW4_DISTANCE * along)
        at_rest = system.state_of(places, 0.0 * places, np.stack(turn), np.zeros((2, 3)))
        pull = -np.array(system.force(at_rest.g))[1, 3]  # of Alpha on Beta
        rate = np.sqrt(pull / (m[0] * m[1] / m.sum() * KW4_DISTANCE))
        spins = np.array([[0.0, 0.0, 2.0 * np.pi / KW4_SPIN], [0.0, 0.0, rate]])
        velocities = share * (rate * KW4_DISTANCE * across)
        return system, system.state_of(places, velocities, np.stack(turn), spins)

    @classmethod
    def sun_earth_moon(cls) -> tuple[GravitatingBodies, SiteState]:
        """The Sun, the Earth and the Moon with their spins and flattening, in the ecliptic: the
        Earth at perihelion, the Moon full and at perigee, with one face to the Earth; metres,
        seconds, kilograms.

        The Moon begins 356,600 km away, so fast that its sidereal month is 27.3217 days.

        Source: masses from the DE440 constants, Park et al., Astron. J. 161 (2021), 105; moments of
        the Earth from IERS Conventions 2010, table 1.1 and Chen and Shen, J. Geophys. Res. 115
        (2010), of the Moon from Williams et al., J. Geophys. Res. Planets 119 (2014), 1546; mean
        elements from Simon et al., Astron. Astrophys. 282 (1994), 663.
        """
        m = np.array([row[0] for row in SUN_EARTH_MOON])
        J = np.array([row[1] for row in SUN_EARTH_MOON])
        system = cls(masses=m, inertias=J)
        periods = np.array([row[2] for row in SUN_EARTH_MOON])
        year, month = (1.495980e11, 0.0167086), (3.863031e8, 0.0768907)  # semi-major axes, e
        tilts = np.radians([7.25, 23.4392911, -1.5424])
        inclined = np.radians(5.1566898)
        sun = _at_the_nearest(year, np.array([0.0, 0.0, 0.0]), NEWTON * m.sum())
        moon = _at_the_nearest(month, np.array([0.0, -inclined, 0.0]), NEWTON * m[1:].sum())
        share = m[2] / m[1:].sum()
        away = m[1:].sum() / m.sum()
        places, velocities = (
            np.stack([-away * y, (1.0 - away) * y - share * z, (1.0 - away) * y + (1.0 - share) * z])
            for y, z in zip(sun, moon, strict=True)
        )
        axes = np.stack([SO3().exp(np.array([0.0, -tilt, 0.0])) for tilt in tilts])
        spins = np.zeros((3, 3))
        spins[:, 2] = 2.0 * np.pi / periods
        return system, system.state_of(places, velocities, axes, spins)


def _at_the_nearest(orbit: tuple[float, float], tilt: np.ndarray, attraction: float) -> Any:
    """Place and velocity at the nearest point of an ellipse (a, e)."""
    a, e = orbit
    R = np.array(SO3().exp(tilt))
    speed = np.sqrt(attraction / a * (1.0 + e) / (1.0 - e))
    return R @ np.array([a * (1.0 - e), 0.0, 0.0]), R @ np.array([0.0, speed, 0.0])
