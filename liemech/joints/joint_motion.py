"""The motion of a joint along a run: angle, rate, torque, reaction, power and work."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import Record, record, vec
from .body_forces import AtBody, ForcesOfBodies
from .joint_forces import AtJoint, seen_about


@record
class JointAngle(Record):
    """The angle of a joint less a level, or the shift, as a function of time and state: an event of a run.

    Angles are seen from half a turn below the level to half a turn above it, where they jump by a turn.
    terminal, direction : of the event.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5.
    """

    at: AtJoint
    freedom: int
    level: float
    terminal: int
    direction: float

    @property
    def jumps_by(self) -> float | None:
        """The length of its jumps that are no zeros: a whole turn, for an angle and for a rotation vector about its
        axis.
        """
        joint = self.at.joint
        return 2.0 * pi if self.freedom in (*joint.angles, *joint.rotation_vector) else None

    def __call__(self, t: float, state: Any) -> float:
        q = seen_about(self.at.angles(t, state.g), self.level, self.at.joint.angles)
        return q[self.freedom] - self.level


@dataclass(frozen=True, eq=False, repr=False)
class JointMotion:
    """A joint of a linkage along a run; what is asked for is computed then.

    All arrays are (n, ...) as the samples; of joints that leave several motions free, (n, freedoms).  Of a stepper, which
    stands at one time, they are without the axis of samples.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), chapters 3 and 4.
    """

    run: Any
    linkage: Any
    number: int
    at: AtJoint

    def __repr__(self) -> str:
        return f"JointMotion({self.linkage.label(self.number)}, {told(self.run)})"

    def only(self, force: Any) -> JointMotion:
        """This motion with the torque, power and work of one force alone, or of those of a class such
        as Motor.
        """
        forces = [f for f in self.at.forces if f == force or (isinstance(force, type) and isinstance(f, force))]
        return replace(self, at=AtJoint(self.at.joint, tuple(forces)))

    @cached_property
    def angle(self) -> np.ndarray:
        """The angle in rad, of a slider the shift in m.  Angles of hinges and Cardan joints go on
        over whole turns: from sample to sample by the turn that is nearest to what the rates say.
        """
        q, turning = self.at.angles(self._t, self.run.g), [*self.at.joint.angles]
        if turning and np.ndim(self._t):
            q, rate = np.array(q), self._rates[..., turning]
            angles = q[..., turning]
            steps = np.diff(np.broadcast_to(self._t.reshape(*self._t.shape, 1), angles.shape), axis=0)
            predicted = 0.5 * steps * (rate[1:] + rate[:-1])
            whole = np.round((predicted - np.diff(angles, axis=0)) / (2.0 * np.pi))
            q[1:, ..., turning] += 2.0 * np.pi * np.cumsum(whole, axis=0)
        return self._alone(q)

    @cached_property
    def rate(self) -> np.ndarray:
        """Its rate in rad/s or m/s; of a ball joint the angular velocity of the first body against
        the second, in the axes of the first.
        """
        return self._alone(self._rates)

    @cached_property
    def torque(self) -> np.ndarray:
        """The torque in N m, of a slider the force in N, of all forces at the joint together: on
        the first body, and the opposite one on the second.
        """
        return self._alone(self._efforts)

    @cached_property
    def power(self) -> np.ndarray:
        """Torque times rate, in W.  (n,)"""
        return np.asarray((self._efforts * self._rates).sum(axis=-1))

    @cached_property
    def work(self) -> np.ndarray:
        """The work of these forces from the first sample on, in J, by a cubic spline through the
        power: of order 4 in the time between samples, of order 1 where the torque jumps.  (n,)
        """
        return self._summed(self.power)

    @cached_property
    def drive(self) -> np.ndarray:
        """The torque in N m, of a slider the force in N, by which a joint follows its path."""
        joint: Any = self.at.joint
        if not getattr(joint, "path", ()):
            raise InvalidInput(f"{self.linkage.label(self.number)} follows no path")
        return self._alone(np.asarray(self.at.drive(self._t, self.run.g, self._multipliers)))

    @cached_property
    def given_power(self) -> np.ndarray:
        """The power that the given motion of the joint brings in, against its conditions and forces, in W.  (n,)"""
        xi = self.linkage.velocity(self.run.mu)
        return np.asarray(self.at.led(self._t, self.run.g, xi, self._multipliers))

    @cached_property
    def given_work(self) -> np.ndarray:
        """The work of the given motion from the first sample on, as `work`, in J.  (n,)"""
        return self._summed(self.given_power)

    def _summed(self, power: np.ndarray) -> np.ndarray:
        """The work of a power."""
        return work_of(self.run, power)

    @cached_property
    def reaction(self) -> np.ndarray:
        """The force of the joint's conditions on the first body, seen from space, in N.  (n, 3)"""
        return self._wrench[..., :3]

    @cached_property
    def moment(self) -> np.ndarray:
        """Their torque on the first body about its point of the joint, seen from space, in N m.
        (n, 3)
        """
        return self._wrench[..., 3:]

    # ---------------------------------------------------------------- parts

    @property
    def _t(self) -> Any:
        """The times, for each body of an ensemble."""
        t, bodies = self.run.t, self.run.bodies
        return t if bodies is None or t.ndim == 2 else t[:, None]

    @cached_property
    def _rates(self) -> np.ndarray:
        return np.asarray(self.at.rates(self._t, self.run.g, self.linkage.velocity(self.run.mu)))

    @cached_property
    def _efforts(self) -> np.ndarray:
        if not self.at.forces:
            return np.zeros_like(self._rates)
        return np.asarray(self.at.efforts(self._t, self.run.g, self._rates))

    @cached_property
    def _wrench(self) -> np.ndarray:
        return np.asarray(self.at.wrench(self._t, self.run.g, self._multipliers))

    @cached_property
    def _multipliers(self) -> np.ndarray:
        counted = self.linkage.constraint.counted
        begin = sum(len(indices) for _, indices in counted[: self.number])
        indices = counted[self.number][1]
        of_joint = np.asarray(self.run.multipliers)[..., begin : begin + len(indices)]
        whole = np.zeros((*of_joint.shape[:-1], self.at.joint.conditions))
        whole[..., list(indices)] = of_joint
        return whole

    def _alone(self, x: np.ndarray) -> np.ndarray:
        """The numbers of a joint with one freedom without their last axis."""
        if not self.at.joint.freedoms:
            raise InvalidInput(f"a {type(self.at.joint).__name__} has no coordinates: it has a reaction only")
        return x[..., 0] if self.at.joint.freedoms == 1 else x


@dataclass(frozen=True, eq=False, repr=False)
class LinkMotion:
    """A body of a linkage along a run, with the load on it; computed when it is asked for.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), sections 2.7 and 2.8.
    """

    run: Any
    linkage: Any
    number: int

    def __repr__(self) -> str:
        name = self.linkage.links[self.number].name
        label = f"link {self.number}" if name is None else f"link {name!r}"
        return f"LinkMotion({label}, {told(self.run)})"

    @cached_property
    def pose(self) -> np.ndarray:
        """[[R, p], [0, 1]] of the centre of mass, (n, 4, 4)."""
        return np.asarray(self.linkage.poses(self.run.g)[..., self.number, :, :])

    @cached_property
    def velocity(self) -> np.ndarray:
        """Angular velocity and velocity in the axes of the body, (n, 6)."""
        return self._own(self.linkage.velocity(self.run.mu))

    @cached_property
    def load(self) -> np.ndarray:
        """Torque and force of the load on the body, in its axes, in N m and N, (n, 6); those of forces
        at joints belong to the joints.
        """
        load, run, xi = self.linkage.load, self.run, self.velocity  # type: Any, Any, Any
        t = run.t if run.bodies is None or run.t.ndim == 2 else run.t[:, None]
        t = np.broadcast_to(t, xi.shape[:-1])
        if isinstance(load, ForcesOfBodies):
            forces = [force for body, force in zip(load.bodies, load.each) if body == self.number]
            at: Any = AtBody((), tuple(forces))
            return np.asarray(at.push(t, xi, self.pose))
        if load is None:
            return np.zeros_like(xi)
        every = np.asarray(self.linkage.velocity(run.mu))
        rows = zip(t.ravel(), every.reshape(t.size, -1), run.g.reshape(t.size, -1))
        covectors = [load.covector(float(s), vec(*v), vec(*g)) for s, v, g in rows]
        return self._own(np.array(covectors).reshape(every.shape))

    @cached_property
    def power(self) -> np.ndarray:
        """The power of the load, in W.  (n,)"""
        return np.asarray((self.load * self.velocity).sum(axis=-1))

    @cached_property
    def work(self) -> np.ndarray:
        """Its work from the first sample on, in J, as that of joints is found.  (n,)"""
        return work_of(self.run, self.power)

    def _own(self, x: Any) -> np.ndarray:
        """The part of this body."""
        return np.asarray(x)[..., 6 * self.number : 6 * self.number + 6]


def told(run: Any) -> str:
    """The number of samples of a run, or the time at which a stepper stands."""
    return f"{len(run.t)} samples" if np.ndim(run.t) else f"t = {run.t}"


@dataclass(frozen=True, eq=False, repr=False)
class OfMembers:
    """A joint or a body along a run whose bodies have linkages of their own; all arrays are (n, bodies, ...).

    members : the JointMotion or the LinkMotion of each.
    """

    members: tuple[Any, ...]

    @classmethod
    def along(cls, run: Any, method: str, name: Any) -> OfMembers:
        """The motions of each body, by a method of its linkage."""
        return cls(tuple([getattr(own, method)(_of_body(run, i), name) for i, own in enumerate(run.system)]))

    def __repr__(self) -> str:
        return f"{self.members[0]!r} of each of {len(self.members)} bodies"

    def only(self, force: Any) -> OfMembers:
        """These motions with the torque, power and work of one force alone, or of those of a class."""
        return OfMembers(tuple([member.only(force) for member in self.members]))

    def __getattr__(self, name: str) -> np.ndarray:
        """The arrays of this name of all members beside one another."""
        if name.startswith("_"):
            raise AttributeError(name)
        return np.stack([getattr(member, name) for member in self.members], axis=np.ndim(self.members[0].run.t))


def _of_body(run: Any, i: int) -> Any:
    """The run, or the state of a stepper, of one body of an ensemble."""
    if not np.ndim(run.t):
        return run.of_body(i)
    states = {name: x[:, i] for name, x in run.states.items()}
    t = run.t if run.t.ndim == 1 else run.t[:, i]
    return replace(run, system=run.system[i], bodies=None, t=t, states=states)


def work_of(run: Any, power: np.ndarray) -> np.ndarray:
    """The work of a power from the first sample on; in an ensemble whose bodies have times of their own, of each by these."""
    if not np.ndim(run.t):
        raise InvalidInput(
            "work: at one time there is a power and no work; `plan.run(...)` keeps the samples that it needs"
        )
    if run.t.ndim == 2:
        return np.stack([_integral(t, p) for t, p in zip(run.t.T, power.T)], axis=-1)
    return _integral(run.t, power)


def _integral(t: np.ndarray, power: np.ndarray) -> np.ndarray:
    """The integral of a power from the first time on, by a cubic spline from jump to jump, where times repeat."""
    from scipy.interpolate import CubicSpline

    work, jumps = np.zeros_like(power), np.flatnonzero(np.diff(t) == 0.0) + 1
    for begin, end in zip([0, *jumps], [*jumps, len(t)]):
        if begin > 0:
            work[begin:end] = work[begin - 1]
        if end - begin > 1:
            sign = 1 if t[end - 1] > t[begin] else -1
            integral = CubicSpline(t[begin:end][::sign], power[begin:end][::sign]).antiderivative()
            work[begin:end] += integral(t[begin:end]) - integral(t[begin])
    return work
