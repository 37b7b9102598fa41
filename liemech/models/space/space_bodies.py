"""Rigid bodies that fall or orbit, their centre of mass moving with their attitude."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, record
from ...groups.composed.product import ProductGroup
from ...groups.rigid.so3 import SO3
from ...groups.vector_space import VectorSpace
from ...systems.input_checks import members_of, points
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ..bodies.gravity import CentralGravity, UniformGravity
from ..bodies.kirchhoff import KirchhoffBody
from ..bodies.rigid_body import RigidBody
from ..input_checks import alone, exact_times, positive_number


@record
class FallingBody(MechanicalSystem):
    """A rigid body that is thrown: it turns freely about its centre of mass, which falls on a
    parabola.

    inertia : about the centre of mass, the principal moments, (3,), or the matrix J, (3, 3), in kg
    m^2.
    mass : in kg.  gravity : in m/s^2, downwards along e3.
    mu = (Pi, P), angular and linear momentum in body axes, in kg m^2/s and kg m/s; g = [[R, p],
    [0, 1]], p the centre of mass in m.

    Source: Goldstein, Classical Mechanics, 3rd ed., section 5.1 (Chasles' theorem).
    """

    body: KirchhoffBody = field(init=False, repr=False)
    potential: UniformGravity = field(init=False, repr=False)
    inertia: Vec | Mat
    mass: float
    gravity: float = 9.80665

    def __post_init__(self) -> None:
        turning = RigidBody(self.inertia)
        mass = positive_number(f"{type(self).__name__}: mass", self.mass)
        object.__setattr__(self, "inertia", turning.inertia)
        object.__setattr__(self, "body", KirchhoffBody(with_mass(turning.inertia, mass)))
        object.__setattr__(self, "potential", UniformGravity(mass * self.gravity))
        super().__post_init__()

    def exact(self, start: BodyState, t: Any) -> BodyState:
        """The exact motion: a free rigid body and a parabola.  t : (n,) or (), in s.  Returns
        mu : (..., 6), g : (..., 4, 4).
        """
        alone(start, "FallingBody.exact")
        if start.g is None:
            raise InvalidInput(
                "FallingBody.exact: start has no pose g, without which down is not known; take "
                "start = body.state(mu, g)"
            )
        mu, g, t = np.array(start.mu), np.array(start.g), exact_times(t, "FallingBody.exact")
        turning = RigidBody(self.inertia)
        turned = turning.exact(turning.state(mu[:3], g[:3, :3]), t)
        start_velocity = g[:3, :3] @ mu[3:] / self.mass
        v = start_velocity - self.gravity * t[..., None] * np.array([0.0, 0.0, 1.0])
        with np.errstate(over="ignore"):
            fallen = 0.5 * (start_velocity + v) * t[..., None]
        if not np.isfinite(fallen).all():
            raise InvalidInput(
                f"FallingBody.exact: t = {np.abs(t).max():.3g} is too late: the fall has no finite length"
            )
        motion = np.zeros((*t.shape, 4, 4))
        motion[..., :3, :3], motion[..., :3, 3], motion[..., 3, 3] = (turned.g, g[:3, 3] + fallen, 1.0)
        return BodyState(
            np.concatenate([turned.mu, self.mass * np.einsum("...ij,...i->...j", turned.g, v)], axis=-1), motion
        )


@record
class OrbitingBody(MechanicalSystem):
    """A rigid body attracted by a point mass in the origin, seen from an inertial frame: orbit and
    attitude feel each other.

    The gravity gradient torque is 3 k/r^3 u x J u, u = R^T x/r; the orbit feels its reaction.  Kept
    are the energy and the total angular momentum.  Configurations are ProductGroup(SO3(),
    VectorSpace(3)): next to the size of an orbit, SE(3), where angular momenta are taken about the
    origin, would lose the digits of the spin.

    inertia : about the centre of mass, the principal moments, (3,), or the matrix J, (3, 3), in kg
    m^2.
    mass : in kg.  attraction : k = G M of the point mass, in m^3/s^2 (of the Earth
    3.986004418e14).  mu = (Pi, p): the spin in body axes, in kg m^2/s, and the linear momentum in
    space, in kg m/s.  g, (12,), is the rotation R from body to space row by row, and the centre of
    mass x in m.

    Source: Lee, Leok, McClamroch, Lie group variational integrators for the full body problem,
    Comput. Methods Appl. Mech. Eng. 196 (2007); Hughes, Spacecraft Attitude Dynamics, section 8.1.
    """

    body: LiePoissonSystem = field(init=False, repr=False)
    potential: CentralGravity = field(init=False, repr=False)
    inertia: Vec | Mat
    mass: float
    attraction: float

    def __post_init__(self) -> None:
        turning = RigidBody(self.inertia)
        mass = positive_number(f"{type(self).__name__}: mass", self.mass)
        object.__setattr__(self, "inertia", turning.inertia)
        attraction = positive_number(f"{type(self).__name__}: attraction", self.attraction)
        kinetic = KineticEnergy(with_mass(turning.inertia, mass))
        object.__setattr__(self, "body", LiePoissonSystem(ProductGroup(SO3(), VectorSpace(3)), kinetic))
        object.__setattr__(self, "potential", CentralGravity(attraction, mass, turning.inertia))
        super().__post_init__()

    def circular_orbit(self, radius: float, g: Any = None, spin: Any = None) -> BodyState:
        """A start on the circular orbit of a point mass about e3, at radius e1, in m.

        g : the attitude, (3, 3), from body to space, default the unit matrix.  spin : the angular
        velocity in body axes, (3,), in rad/s; default that of the orbit, so that the body keeps the
        same face to the centre if its axes are those of the orbit.
        """
        name = "OrbitingBody.circular_orbit"
        radius, R = (
            positive_number(f"{name}: radius", radius),
            np.eye(3) if g is None else members_of(SO3(), g, f"{name}: g"),
        )
        if R.shape != (3, 3):
            raise InvalidInput(f"{name}: g is one attitude, (3, 3); got shape {R.shape}")
        if not 1e-100 < radius < 1e100:
            raise InvalidInput(f"{name}: radius = {radius:.3g} is beyond what floats can cube; choose other units")
        n = np.sqrt(self.attraction / radius**3)
        w = (
            R.T @ np.array([0.0, 0.0, n])
            if spin is None
            else points(spin, f"{name}: spin", (3,), "an angular velocity")
        )
        momentum = KineticEnergy(self.inertia).momentum(w)
        return self.state(np.r_[momentum, 0.0, self.mass * n * radius, 0.0], np.r_[R.ravel(), radius, 0.0, 0.0])


def with_mass(inertia: Vec | Mat, mass: float) -> Vec | Mat:
    """The inertia of rotation and translation together."""
    J = np.array(inertia)
    if J.ndim == 1:
        return Vec.of([*J, mass, mass, mass])
    return Mat.of(np.block([[J, np.zeros((3, 3))], [np.zeros((3, 3)), mass * np.eye(3)]]))
