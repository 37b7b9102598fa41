"""Mechanics of a tree of joints in the rates of its joints: the mass matrix, the bias, torques for accelerations and back.

Source: Featherstone, Rigid Body Dynamics Algorithms (2008), sections 3.3, 5.3 and 6.2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import Mat, Record, Vec, cross, derivative, dot, inverse, mat, real_array, record, solve, vec
from ..groups.rigid.se3 import SE3, join
from ..systems.kinetic_energy import times
from .in_memory.multipliers import moved_along
from .joint_forces import body
from .joints import both
from .link import number_of
from .mounting import hangs, joints_by_body
from .points_and_axes import REST6, pose, turned


@record
class JointSpace(Record):
    """The mechanics of a tree of joints in the rates u of its joints; `linkage.joint_space` is that of a linkage.

        xi = S(g) u,   M u' + b = tau,   M = S^T J S,   b = S^T (J S' u - ad*_xi mu - f)

    u : what `linkage.rates_of(mu, g)` tells, (n,), of all joints in their order, of a ball joint the angular velocity of
    the first body in its axes.  g, (16 N,), are the poses and mu, (6 N,), the momenta of all bodies, as states have them;
    J is their inertia, f every force that acts on them: weight, `forces`, potential and load.  tau, (n,), are the torques
    that joints are given beside these, in N m, along sliders forces in N.  Everything takes one state or arrays of them.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), sections 3.3, 5.3 and 6.2.
    """

    linkage: Any
    hung: tuple[tuple[int, int, int], ...]  # outwards: a joint, the body that hangs by it, from which (-1: ground)
    moved_by: tuple[tuple[int, ...], ...]  # of each body the rates of the joints between it and the ground

    def mass_matrix(self, g: Vec) -> Mat:
        """The mass matrix M = S^T J S, with the rotors of motors, symmetric and positive, (n, n), in kg m^2: the kinetic
        energy is u . M u / 2.
        """
        n = self.freedoms
        entries = [0.0] * (n * n)
        for i, armature in enumerate(self._armatures):
            entries[n * i + i] = armature
        for b, velocities in enumerate(self._velocities(self._matrices(g))):
            for i, xi in zip(self.moved_by[b], velocities):
                momentum = self._momentum(b, xi)
                for k, eta in zip(self.moved_by[b], velocities):
                    if k <= i:
                        entries[n * i + k] = entries[n * i + k] + dot(eta, momentum)
        return mat(*[vec(*[entries[n * max(i, k) + min(i, k)] for k in range(n)]) for i in range(n)])

    def inverse_dynamics(self, mu: Vec, g: Vec, accelerations: Vec, t: float = 0.0) -> Vec:
        """The torques M u' + b with which the joints have these accelerations u', (n,), in N m, along sliders in N."""
        xi = self.linkage.velocity(mu)
        force, matrices = self.linkage.body.applied(t, xi, g), self._matrices(g)
        against = [
            self._momentum(b, rate) - SE3().ad_star(body(xi, b), body(mu, b)) - body(force, b)
            for b, rate in enumerate(self._accelerations(matrices, xi, g, accelerations))
        ]
        rotors = [armature * rate for armature, rate in zip(self._armatures, accelerations)]
        return self._along_joints(self._velocities(matrices), against) + vec(*rotors)

    def bias(self, mu: Vec, g: Vec, t: float = 0.0) -> Vec:
        """The torques b at which no joint accelerates, against inertia, weight and all other forces, (n,)."""
        return self.inverse_dynamics(mu, g, vec(*[0.0 for _ in range(self.freedoms)]), t)

    def forward_dynamics(self, mu: Vec, g: Vec, torques: Vec, t: float = 0.0) -> Vec:
        """The accelerations u' = M^-1 (tau - b) of the joints under these torques, (n,), in rad/s^2 and m/s^2."""
        return solve(self.mass_matrix(g), torques - self.bias(mu, g, t))

    def gravity_torque(self, g: Vec) -> Vec:
        """The torques that hold the mechanism at rest against its weight, springs and potential, -S^T f(g), (n,)."""
        force, velocities = self.linkage.body.force(g), self._velocities(self._matrices(g))
        return self._along_joints(velocities, [-body(force, b) for b in range(len(self.moved_by))])

    def jacobian(self, g: Any, link: str | int, point: Any = (0.0, 0.0, 0.0)) -> Any:
        """The angular velocity of a link and the velocity of a point of it, seen from space, by the rates u, (..., 6, n).

        point : in the axes of the link, from its centre of mass, (3,), in m.  Raises InvalidInput for an unknown link.
        """
        return self.jacobian_at(
            g, real_array(point, "JointSpace.jacobian: point"), number_of(self.linkage.links, link, "link")
        )

    def jacobian_at(self, g: Vec, point: Vec, number: Any) -> Mat:
        """The velocities of a point of a body, seen from space, by the rates u, (6, n).  number : of the body."""
        frame, columns = pose(g, number), [REST6] * self.freedoms
        for i, xi in zip(self.moved_by[number], self._velocities(self._matrices(g))[number]):
            w, v = xi[:3], xi[3:]
            columns[i] = join(turned(frame, w), turned(frame, v + cross(w, point)))
        return mat(*columns).T

    @property
    def freedoms(self) -> int:
        """The number n of rates."""
        return sum([joint.freedoms for joint in self.linkage.joints])

    # ---------------------------------------------------------------- along the tree

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        sizes = {"g": 16 * len(self.moved_by), "mu": 6 * len(self.moved_by), "point": 3}
        return (sizes.get(argument, self.freedoms),)

    @property
    def _armatures(self) -> Any:
        """The inertia of the rotor that turns with each rate."""
        each = [[joint.armature] if joint.geared else [0.0] * joint.freedoms for joint in self.linkage.joints]
        return [armature for of_joint in each for armature in of_joint]

    def _matrices(self, g: Vec) -> Any:
        """For each joint A and B of xi = A r + B xi_support, r the rates of its conditions, zero, and its motions."""
        matrices = []
        for number, hanging, _ in self.hung:
            joint = self.linkage.joints[number]
            by_hanging, by_support = rows_of(joint, joint.first == hanging, *both(joint, g))
            A = inverse(by_hanging)
            matrices.append((A, -1.0 * (A @ by_support)))
        return matrices

    def _velocities(self, matrices: Any) -> Any:
        """S: of each body the velocities by unit rates, those in `moved_by`."""
        velocities: list[Any] = [[]] * len(self.moved_by)
        for (A, B), (number, hanging, support) in zip(matrices, self.hung):
            joint = self.linkage.joints[number]
            carried = [B @ xi for xi in velocities[support]] if support >= 0 else []
            axes = [vec(*[row[joint.conditions + i] for row in A]) for i in range(joint.freedoms)]
            velocities[hanging] = [*carried, *axes]
        return velocities

    def _accelerations(self, matrices: Any, xi: Vec, g: Vec, rates: Vec) -> Any:
        """The accelerations xi' = S u' + S' u of all bodies."""
        accelerations = [REST6] * len(self.moved_by)
        for (A, B), (number, hanging, support) in zip(matrices, self.hung):
            joint = self.linkage.joints[number]
            moved_by = self.moved_by[hanging]
            along_joint = [rates[i] for i in moved_by[len(moved_by) - joint.freedoms :]]
            still = [0.0] * joint.conditions
            acceleration = A @ (vec(*still, *along_joint) - self._curvature(joint, xi, g))
            accelerations[hanging] = acceleration + B @ accelerations[support] if support >= 0 else acceleration
        return accelerations

    def _curvature(self, joint: Any, xi: Vec, g: Vec) -> Vec:
        """The rates that conditions and motions of a joint gain as its bodies move on evenly, (6,)."""
        first, second = both(joint, g)
        by_first, by_second = body(xi, joint.first), REST6 if joint.second is None else body(xi, joint.second)

        def rates(s: float) -> Vec:
            poses = moved_along(first, by_first, s), moved_along(second, by_second, s)
            rows_by_first, rows_by_second = rows_of(joint, True, *poses)
            return rows_by_first @ by_first + rows_by_second @ by_second

        return derivative(rates, 0.0)

    def _momentum(self, number: int, xi: Vec) -> Vec:
        """J xi of one body."""
        link = self.linkage.links[number]
        return join(times(link.inertia, xi[:3]), link.mass * xi[3:])

    def _along_joints(self, velocities: Any, wrenches: Any) -> Vec:
        """S^T of wrenches on all bodies, (n,)."""
        torques = [0.0] * self.freedoms
        for b, wrench in enumerate(wrenches):
            for i, xi in zip(self.moved_by[b], velocities[b]):
                torques[i] = torques[i] + dot(xi, wrench)
        return vec(*torques)


def rows_of(joint: Any, by_first: bool, g: Any, k: Any) -> Any:
    """The rows of a joint's conditions and motions, (6, 6) by the velocity of one of its bodies, the first or the second, and
    by that of the other one.
    """
    rows = [*joint.rows(g, k), *joint.motions(g, k)] if joint.freedoms > 0 else joint.rows(g, k)
    by_g, by_k = mat(*[row[0] for row in rows]), mat(*[row[1] for row in rows])
    return (by_g, by_k) if by_first else (by_k, by_g)


def joint_space_of(linkage: Any) -> JointSpace:
    """The joint space of a linkage.  Raises InvalidInput where the rates of joints depend on each other."""
    obstacles = {
        "a given motion": linkage.rheonomic,
        "a Mimic": bool(linkage.mimics),
        "loops, or bodies that hang from nothing": not hangs(linkage),
    }
    for what, stands_in_the_way in obstacles.items():
        if stands_in_the_way:
            raise InvalidInput(
                f"Linkage.joint_space: it has {what}; it is for bodies that hang from the ground by joints without loops, "
                "a body that moves freely by a FloatingJoint"
            )
    at, hung = joints_by_body(linkage), []
    todo: list[int | None] = [None]
    moved_by: dict[int | None, tuple[int, ...]] = {None: ()}
    ends = np.cumsum([joint.freedoms for joint in linkage.joints]).tolist()
    while todo:
        support = todo.pop(0)
        for number in at[support]:
            joint = linkage.joints[number]
            hanging = joint.first if joint.second == support else joint.second
            if hanging not in moved_by:
                moved_by[hanging] = (*moved_by[support], *range(ends[number] - joint.freedoms, ends[number]))
                hung.append((number, hanging, -1 if support is None else support))
                todo.append(hanging)
    return JointSpace(linkage, tuple(hung), tuple([moved_by[b] for b in range(len(linkage.links))]))
