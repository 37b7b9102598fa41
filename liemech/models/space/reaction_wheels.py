"""Reaction wheels, and the kinetic energy of a body with them."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Record, Vec, dot, record, tanh, vec, vectors, where
from ...systems.kinetic_energy import KineticEnergy, times
from .space_forces import require_directions


@record
class ReactionWheels(Record):
    """n reaction wheels, balanced, each on an axis that is fixed in the body:

        h_i = I_i (W_i + a_i . w),   h_i' = u_i - viscous_i W_i - coulomb_i tanh(W_i/creep).

    w is the angular velocity of the body, W_i the speed of the wheel beside it.  The motor turns
    the body by -u_i a_i: their total momentum feels nothing of it.

    axes : a, (n, 3), unit vectors in body axes.  inertias : I about the axes, (n,), in kg m^2.
    torques : u of the motors, (n,), in N m, zero by default; a law of control is a subclass with its
    own `command`.
    torque_limits : |u| goes no further, (n,), in N m.  speed_limits : (n,), in rad/s: at this speed
    a motor only brakes.  viscous : in N m s.  coulomb : in N m.  creep : the speed in rad/s below
    which dry friction fades to zero.

    Source: Schaub and Junkins, Analytical Mechanics of Space Systems, 4th ed., section 4.5;
    Alcorn, Allard and Schaub, Fully coupled reaction wheel static and dynamic imbalance, J.
    Spacecraft and Rockets 55 (2018).
    """

    axes: Mat
    inertias: Vec
    torques: Vec | None = None
    torque_limits: Vec | None = None
    speed_limits: Vec | None = None
    viscous: Vec | None = None
    coulomb: Vec | None = None
    creep: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        require_directions("ReactionWheels: axes", [[*a] for a in self.axes])
        n = len(self.axes)
        least = {"inertias": 0.0, "torques": None}
        for name in ("inertias", "torques", *PER_WHEEL):
            value = getattr(self, name)
            if value is None:
                continue
            if not isinstance(value, vectors.Vec) or len(value) != n:
                raise InvalidInput(f"ReactionWheels: {name} are {n} numbers, one for each axis; got {value!r}")
            low = least.get(name, 0.0)
            if low is not None and not all(x > low or (x == low and name != "inertias") for x in value):
                raise InvalidInput(
                    f"ReactionWheels: {name} must not be negative"
                    f"{', nor zero' if name == 'inertias' else ''}; got {[*value]}"
                )
        if not self.creep > 0.0:
            raise InvalidInput(f"ReactionWheels: creep must be positive; got {self.creep}")

    def command(self, here: Any) -> Vec:
        """The torques asked of the motors, (n,), in N m.  here : the flight, whose `speeds` are
        those of the wheels beside the body.
        """
        return vec(*[0.0 for _ in self.inertias]) if self.torques is None else self.torques

    def motors(self, here: Any) -> Vec:
        """The torques that the motors give, within their limits, (n,), in N m.  here : the flight."""
        u = self.command(here)
        if self.torque_limits is not None:
            u = vec(*[max(-most, min(most, x)) for x, most in zip(u, self.torque_limits)])
        if self.speed_limits is not None:
            speeds = zip(u, here.speeds, self.speed_limits)
            u = vec(*[where(abs(w) < most, x, where(x * w > 0.0, 0.0, x)) for x, w, most in speeds])
        return u

    def torque(self, here: Any) -> Vec:
        """u less friction, (n,), in N m.  here : the flight."""
        total = self.motors(here)
        if self.viscous is not None:
            total = total - self.viscous * here.speeds
        if self.coulomb is not None:
            creeping = vec(*[tanh(w / self.creep) for w in here.speeds])
            total = total - self.coulomb * creeping
        return total

    @property
    def passive(self) -> bool:
        """Whether neither motors nor friction change the momenta of the wheels."""
        written = any(getattr(type(self), name) is not getattr(ReactionWheels, name) for name in TORQUES)
        return not written and self.torques is None and self.viscous is None and self.coulomb is None


PER_WHEEL = "torque_limits", "speed_limits", "viscous", "coulomb"
TORQUES = "command", "motors", "torque"


@record
class GyrostatEnergy(KineticEnergy):
    """The kinetic energy of a body that moves in space, with n wheels:

        l = w . J w/2 + m |v|^2/2 + sum_i I_i (W_i^2/2 + W_i a_i . w),
        w = K (Pi - sum_i h_i a_i),   K = (J - sum_i I_i a_i a_i^T)^-1,   v = p/m,   W_i = h_i/I_i - a_i . w.

    body : J of the whole, wheels among it, (3, 3).  mass : m.  axes : (n, 3).  wheels : I, (n,).
    Velocities are (w, v, W), momenta (Pi, p, h); `inertia` is the matrix of the form.

    Source: Hughes, Spacecraft Attitude Dynamics, section 3.5 (gyrostats).
    """

    inertia: Mat = field(init=False, repr=False)
    body: Mat
    mass: float
    axes: Mat
    wheels: Vec
    without: Mat = field(init=False, repr=False)

    def __post_init__(self) -> None:
        J, A, wheels = np.array(self.body), np.array(self.axes), np.array(self.wheels)
        n = len(A)
        whole = np.zeros((6 + n, 6 + n))
        whole[:3, :3], whole[3:6, 3:6] = J, self.mass * np.eye(3)
        whole[:3, 6:], whole[6:, :3], whole[6:, 6:] = (A.T * wheels, (A.T * wheels).T, np.diag(wheels))
        hub = J - (A.T * wheels) @ A
        if not (np.linalg.eigvalsh(hub) > 0.0).all():
            raise InvalidInput(
                "Spacecraft: inertia is that of the whole, wheels among it; less the wheels it is "
                f"{hub.tolist()}, of no body"
            )
        object.__setattr__(self, "inertia", Mat.of(whole.tolist()))
        object.__setattr__(self, "without", Mat.of(np.linalg.inv(hub).tolist()))
        super().__post_init__()

    def _velocity(self, mu: Vec) -> Vec:
        """The velocity (w, v, W) of a momentum (Pi, p, h)."""
        h = mu[6:]
        w = self.without @ (mu[0:3] - h @ self.axes)
        spins = [h[i] / self.wheels[i] - dot(self.axes[i], w) for i in range(len(self.wheels))]
        return vec(*w, *(mu[3:6] / self.mass), *spins)

    def _momentum(self, xi: Vec) -> Vec:
        """The momentum (Pi, p, h) of a velocity (w, v, W)."""
        w, spins = xi[0:3], xi[6:]
        about = self.wheels * spins
        h = [about[i] + self.wheels[i] * dot(self.axes[i], w) for i in range(len(self.wheels))]
        return vec(*(times(self.body, w) + about @ self.axes), *(self.mass * xi[3:6]), *h)
