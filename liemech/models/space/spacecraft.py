"""A spacecraft: a body with reaction wheels in orbit, and what acts on it."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput, InvalidType
from ...formulas import Element, Mat, Vec, mat, real_array, record, sum, vec
from ...groups.composed.product import ProductGroup
from ...groups.lie_group import LieGroup
from ...groups.rigid.so3 import SO3
from ...groups.vector_space import VectorSpace
from ...systems.input_checks import points
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.potential import Force, NoPotential, Potential
from ..bodies.rigid_body import RigidBody
from ..input_checks import check_positive
from .effectors import ConservativeEffector, Effector, Flight, PoseInSpace
from .reaction_wheels import GyrostatEnergy, ReactionWheels
from .space_bodies import with_mass


@record
class EffectorFields(Potential):
    """The energy of several effectors together.

    effectors : with energies.  mass, inertia : of the spacecraft.  wheels : how many there are.
    """

    effectors: tuple[Any, ...]
    mass: float
    inertia: Vec | Mat
    wheels: int

    def energy(self, g: Vec) -> float:
        place = self._at(g)
        return sum([effector.energy(place) for effector in self.effectors])

    def force(self, group: LieGroup, g: Element) -> Vec:
        """The sums of torques and forces; none on the wheels."""
        place, torque, force = self._at(g), vec(0.0, 0.0, 0.0), vec(0.0, 0.0, 0.0)
        for effector in self.effectors:
            torque, force = torque + effector.torque(place), force + effector.force(place)
        return vec(*torque, *force, *[0.0 for _ in range(self.wheels)])

    def _at(self, g: Vec) -> PoseInSpace:
        x, R = vec(g[9], g[10], g[11]), mat(g[0:3], g[3:6], g[6:9])
        return PoseInSpace(x, R, self.mass, self.inertia)

    def _shape(self, argument: str, kind: str) -> tuple[int, ...]:
        return (12 + self.wheels,)

    def symmetry(self, group: LieGroup, mu: Any, g: Any) -> dict[str, Any]:
        """The angular momentum of spin and orbit together, R Pi + x x p, or its part along e3."""
        if all(e.is_kept("central") for e in self.effectors):
            return {"angular momentum": angular_momentum(mu, g)}
        if all(e.is_kept("axial") for e in self.effectors):
            return {"angular momentum along e3": angular_momentum(mu, g)[..., 2]}
        return {}


@record
class EffectorLoads(Force):
    """The forces of several effectors, and the torques on the wheels."""

    effectors: tuple[Any, ...]
    wheels: ReactionWheels | None
    mass: float
    inertia: Vec | Mat

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        x, R = vec(g[9], g[10], g[11]), mat(g[0:3], g[3:6], g[6:9])
        speeds = None if self.wheels is None else xi[6:]
        flight = Flight(t, x, xi[3:6], R, xi[0:3], speeds, self.mass, self.inertia)
        torque, force = vec(0.0, 0.0, 0.0), vec(0.0, 0.0, 0.0)
        for effector in self.effectors:
            torque, force = torque + effector.torque(flight), force + effector.force(flight)
        if self.wheels is None:
            return vec(*torque, *force)
        return vec(*torque, *force, *self.wheels.torque(flight))


@record
class Spacecraft(MechanicalSystem):
    """A rigid body with reaction wheels in orbit about the origin, seen from an inertial frame;
    orbit, attitude and wheels move together.

    inertia : of the whole, wheels among it, about the centre of mass, the principal moments, (3,),
    or the matrix J, (3, 3), in kg m^2.
    mass : of the whole, in kg.
    effectors : what acts on it, a list of records, each a formula of force and torque: `PointGravity`,
    `GravityGradient`, `Oblateness`, `Drag`, `SolarPressure`, `MagneticTorquers`, or a subclass of
    `Effector` or `ConservativeEffector` of your own.
    wheels : ReactionWheels, if there are some.

    mu = (Pi, p, h): the angular momentum of body and wheels together about the centre of mass in
    body axes, in kg m^2/s; the momentum in space, in kg m/s; the momenta of the n wheels about
    their axes, in kg m^2/s.  g, (12 + n,), is the rotation R from body to space row by row, the
    centre of mass x in m, and the angles of the wheels in rad.  `state_of` takes positions,
    velocities, attitudes, rates and speeds; `velocity(mu)` is (w, v, speeds of the wheels).

        Pi' = Pi x w + M,  p' = F,  h' = u - friction,   w = K (Pi - sum_i h_i a_i)

    Motors and friction of wheels change h and leave R Pi alone.  A system without load keeps its
    energy, one whose effectors are central R Pi + x x p.

    Source: Hughes, Spacecraft Attitude Dynamics, sections 3.5, 8.1; Schaub and Junkins, Analytical
    Mechanics of Space Systems, 4th ed., chapter 4.
    """

    in_space: ClassVar[bool] = True

    body: LiePoissonSystem = field(init=False, repr=False)
    potential: Any = field(init=False, repr=False)
    load: Force | None = field(init=False, repr=False)
    inertia: Vec | Mat
    mass: float
    effectors: tuple[Any, ...] = ()
    wheels: ReactionWheels | None = None

    def __post_init__(self) -> None:
        name, turning = type(self).__name__, RigidBody(self.inertia)
        object.__setattr__(self, "inertia", turning.inertia)
        check_positive(self, "mass")
        effectors: Any = self.effectors
        object.__setattr__(self, "effectors", tuple(effectors if isinstance(effectors, (list, tuple)) else [effectors]))
        for effector in self.effectors:
            if not isinstance(effector, (Effector, ConservativeEffector)):
                raise InvalidType(
                    f"{name}: effectors are records such as PointGravity(3.986004418e14), or of a "
                    f"subclass of Effector; got {effector!r}"
                )
        if self.wheels is not None and not isinstance(self.wheels, ReactionWheels):
            raise InvalidType(f"{name}: wheels must be ReactionWheels(axes, inertias); got {self.wheels!r}")
        n, inertias = self._wheels, (self.mass, self.inertia)
        group = ProductGroup(SO3(), VectorSpace(3), *[VectorSpace(n) for _ in range(n > 0)])
        kinetic = KineticEnergy(with_mass(self.inertia, self.mass))
        if self.wheels is not None:
            J = np.array(self.inertia)
            J = np.diag(J) if J.ndim == 1 else J
            kinetic = GyrostatEnergy(Mat.of(J.tolist()), self.mass, self.wheels.axes, self.wheels.inertias)
        fields = tuple([e for e in self.effectors if isinstance(e, ConservativeEffector)])
        loads = tuple([e for e in self.effectors if isinstance(e, Effector)])
        free = not loads and (self.wheels is None or self.wheels.passive)
        object.__setattr__(self, "body", LiePoissonSystem(group, kinetic))
        object.__setattr__(self, "potential", EffectorFields(fields, *inertias, n) if fields else NoPotential())
        object.__setattr__(self, "load", None if free else EffectorLoads(loads, self.wheels, *inertias))
        super().__post_init__()

    @property
    def _wheels(self) -> int:
        """The number of reaction wheels."""
        return 0 if self.wheels is None else len(self.wheels.inertias)

    def state_of(
        self, position: Any, velocity: Any, attitude: Any = None, rate: Any = None, speeds: Any = None
    ) -> BodyState:
        """A start for `integrate`.

        position, velocity : of the centre of mass in space, (3,), in m and m/s.  attitude : from
        body to space, (3, 3) or a scipy Rotation, default the unit matrix.  rate : the angular
        velocity in body axes, (3,), in rad/s, default 0.  speeds : of the wheels beside the body,
        (n,), in rad/s, default 0.  Leading axes (bodies,) make an ensemble.
        Raises InvalidInput for wrong shapes, numbers that are not finite, an attitude that is no
        rotation, and speeds of wheels that are not there.
        """
        name, n = f"{type(self).__name__}.state_of", self._wheels
        if speeds is not None and not n:
            raise InvalidInput(f"{name}: this spacecraft has no wheels, and so no speeds; got {speeds!r}")
        R = np.eye(3) if attitude is None else real_array(attitude, f"{name}: attitude")
        parts = [position, velocity, np.zeros(3) if rate is None else rate]
        x, v, w = (
            points(part, f"{name}: {what}", (3,), "a vector in space")
            for part, what in zip(parts, ("position", "velocity", "rate"), strict=True)
        )
        wheels = (
            points(np.zeros(n) if speeds is None else speeds, f"{name}: speeds", (n,), "a speed of each wheel")
            if n
            else np.zeros(0)
        )
        group: Any = self.configurations
        lead = np.broadcast_shapes(R.shape[:-2], *[a.shape[:-1] for a in (x, v, w, wheels)])
        xi = np.concatenate([np.broadcast_to(a, (*lead, a.shape[-1])) for a in (w, v, wheels)], axis=-1)
        return self.state(xi=xi, g=group.join(R, x, *[np.zeros((*lead, n))][: n > 0]))

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy without a load; the angular momentum of spin and orbit together where all effectors
        are central, along e3 where they are axial, whatever the wheels do; of a spacecraft that
        nothing acts on the spin in space and the momentum.
        """
        mu, g = states["mu"], states["g"]
        constants = {} if self.load is not None else {"energy": np.asarray(self.energy(mu, g))}
        if any(isinstance(e, Effector) for e in self.effectors):
            return constants
        if not self.effectors:
            return constants | {"spin in space": spin_in_space(mu, g), "momentum": mu[..., 3:6]}
        return constants | self.potential.symmetry(self.configurations, mu, g)


def spin_in_space(mu: Any, g: Any) -> np.ndarray:
    """R Pi.  mu : (..., 6 + n), g : (..., 12 + n)."""
    R = g[..., :9].reshape(*g.shape[:-1], 3, 3)
    return np.einsum("...ij,...j->...i", R, mu[..., :3])


def angular_momentum(mu: Any, g: Any) -> np.ndarray:
    """R Pi + x x p.  mu : (..., 6 + n), g : (..., 12 + n)."""
    return spin_in_space(mu, g) + np.cross(g[..., 9:12], mu[..., 3:6])
