"""The free rigid body, as a Lie-Poisson system of rotations."""

from __future__ import annotations

import sys
from dataclasses import field
from typing import Any, ClassVar

from ...errors import InertiaWarning, InvalidInput, require, warn
from ...formulas import Mat, Vec, record
from ...formulas.classes.fields import frozen_array
from ...formulas.classes.records import fill
from ...groups.rigid.so3 import SO3
from ...groups.rigid.unit_quaternions import UnitQuaternions
from ...systems.inertia import checked_inertia
from ...systems.kinetic_energy import MAX, KineticEnergy, kinetic_energy
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ..input_checks import alone, exact_times


@record
class RigidBody(LiePoissonSystem):
    """A rigid body that turns freely about its centre of mass: Euler's equation mu' = mu x J^-1 mu,
    and g' = g hat(J^-1 mu).

    inertia : the principal moments, shape (3,), or the symmetric positive matrix J, shape (3, 3),
    in kg m^2.  mu is the angular momentum in the body, in kg m^2/s; g the rotation from body to
    space.
    group : SO3() for rotation matrices, or UnitQuaternions(), by which momenta move alike.

    Raises InvalidType for another group, InvalidInput if J is not symmetric and positive.  Warns
    (InertiaWarning) if J breaks the triangle inequality J_1 + J_2 >= J_3: the equations are as
    good, but no distribution of mass has such moments.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., chapter 15.
    """

    called: ClassVar[str] = "body"

    group: SO3 | UnitQuaternions = field(default=SO3(), kw_only=True)
    hamiltonian: KineticEnergy = field(init=False, repr=False)
    lagrangian: KineticEnergy = field(init=False, repr=False)
    inertia: Vec | Mat

    def __repr__(self) -> str:
        attitude = "" if isinstance(self.group, SO3) else f", group={self.group!r}"
        return f"{type(self).__name__}(inertia={self.inertia!r}{attitude})"

    def __post_init__(self) -> None:
        require("RigidBody: group", self.group, (SO3, UnitQuaternions), "SO3() or UnitQuaternions()")
        inertia = _inertia(self.inertia)
        object.__setattr__(self, "inertia", inertia)
        kinetic = kinetic_energy(inertia)
        object.__setattr__(self, "hamiltonian", kinetic)
        object.__setattr__(self, "lagrangian", kinetic)

    def exact(self, start: BodyState, t: Any) -> BodyState:
        """The exact motion, by elliptic functions: no integration, any time, error about 1e-13
        (1 + |omega| t).

        t : () or (n,), in s, from the start.  Returns mu : (..., 3) and, if the start has a g,
        g : (..., 3, 3), or unit quaternions (..., 4) with a scalar part that is not negative.
        """
        from .exact_rigid_body import exact_rigid_body

        alone(start, "RigidBody.exact")
        times = exact_times(t, "RigidBody.exact")
        group, g = self.group, start.g
        if isinstance(group, UnitQuaternions) and g is not None:
            g = group.matrix(g)
        mu, g = exact_rigid_body(self.inertia, start.mu, g, times)
        if isinstance(group, UnitQuaternions) and g is not None:
            g = group.from_matrix(g)
        return fill(BodyState, {"mu": frozen_array(mu, "mu"), "g": None if g is None else frozen_array(g, "g")})

    def period(self, start: BodyState) -> float:
        """The time after which the body momentum returns; infinite on the separatrix."""
        from .exact_rigid_body import momentum_period

        alone(start, "RigidBody.period")
        return momentum_period(self.inertia, start.mu)


def _inertia(value: Any) -> Vec | Mat:
    """The checked inertia: principal moments, (3,), or a matrix, (3, 3)."""
    inertia, moments = checked_inertia(value, "RigidBody: inertia", 3)
    a, b, c = sorted([float(x) for x in moments])
    if not (a >= 1.0 / MAX and b <= MAX and c <= MAX):
        shown = [float(x) for x in moments]
        raise InvalidInput(
            f"RigidBody: inertia has the principal moments {shown}; they and their inverses must not overflow"
        )
    if a < c - b - 4 * sys.float_info.epsilon * c:
        warn(
            f"the principal moments {a:g}, {b:g}, {c:g} break the triangle inequality ({a:g} + "
            f"{b:g} < {c:g}): the motion is computed all the same, but "
            "no body made of positive masses has them",
            InertiaWarning,
        )
    return inertia
