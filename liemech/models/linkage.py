"""Rigid bodies held together by joints: chains, linkages, mechanisms."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from ..formulas import Element, Mat, Record, Vec, real_array, record, vec
from ..groups.lie_group import LieGroup
from ..groups.product import ProductGroup
from ..groups.se3 import SE3
from ..systems.constrained_body import ConstrainedBody
from ..systems.kinetic_energy import KineticEnergy
from ..systems.lie_poisson import BodyState, LiePoissonSystem
from ..systems.mechanical import MechanicalSystem
from ..systems.potential import Potential
from .inertia import checked_inertia
from .joints import BallJoint, Joint, Joints, RevoluteJoint

SURVIVES = 1e-9
"""A motion of space that changes conditions and energy by no more than this part of what others do
is a symmetry.
"""


@record
class Link(Record):
    """A rigid body of a linkage; its frame sits in the centre of mass.

    mass : in kg.  inertia : about the centre of mass, the principal moments, (3,), or the matrix,
    (3, 3), in kg m^2; with principal moments a linkage is cheaper.

    Source: Goldstein, Classical Mechanics, 3rd ed., chapter 5.
    """

    mass: float
    inertia: Vec | Mat

    def __post_init__(self) -> None:
        mass = real_array(self.mass, "Link: mass")
        if mass.ndim or not 0.0 < mass < np.inf:
            raise InvalidInput(f"Link: mass must be a positive number; got {self.mass!r}")
        object.__setattr__(self, "inertia", checked_inertia(self.inertia, "Link: inertia", 3)[0])
        super().__post_init__()

    @classmethod
    def rod(cls, mass: float, length: float, radius: float) -> Link:
        """A straight cylinder of even density along e3.  mass : in kg, length, radius : in m."""
        across = mass * (3.0 * radius * radius + length * length) / 12.0
        return cls(mass, [across, across, 0.5 * mass * radius * radius])


@record
class Weights(Potential):
    """The weight of several bodies, V = sum w_b e3 . p_b, on a product of SE(3)s.

    weights : w_b = m_b g, (N,), in N.
    Source: Goldstein, Classical Mechanics, 3rd ed., section 1.3.
    """

    weights: Vec

    def energy(self, g: Vec) -> float:
        """The heights, weighed."""
        total = self.weights[0] * g[11]
        for b in range(1, len(self.weights)):
            total = total + self.weights[b] * g[16 * b + 11]
        return total

    def force(self, group: LieGroup, g: Element) -> Vec:
        """(0, -w R^T e3) of each body."""
        return vec(
            *[
                x
                for b, w in enumerate(self.weights)
                for x in (0.0, 0.0, 0.0, *[-(w * g[16 * b + 8 + j]) for j in range(3)])
            ]
        )


@record
class Linkage(ConstrainedBody):
    """Rigid bodies held together by joints, under gravity; they may form closed loops.

    links : the bodies, numbered from 0 on.  joints : such as BallJoint(0, 1, at_first, at_second);
    None is the ground.
    gravity : in m/s^2, downwards along e3.
    g, (16 N,), are the poses [[R, p], [0, 1]] of the centres of mass, row by row; `assembled` makes
    a start of poses, and `poses` poses of g.  mu, (6 N,), are the angular and linear momenta of
    each body in its own axes.

    Each motion of space that leaves joints and gravity as they are keeps its momentum: `constants`
    finds them.
    Raises InvalidInput for joints of bodies that are not there.

    Source: Leyendecker, Ober-Bloebaum, Marsden and Ortiz, Optim. Control Appl. Methods 31 (2010);
    Lee, Leok and McClamroch, Global Formulations of Lagrangian and Hamiltonian Dynamics on
    Manifolds (2018), chapter 9.
    """

    body: Any = field(init=False, repr=False)
    constraint: Joints = field(init=False, repr=False)
    links: tuple[Any, ...]
    joints: tuple[Any, ...]
    gravity: float = 9.80665

    def __post_init__(self) -> None:
        given: Any = self
        for name, items, kind in (("links", given.links, Link), ("joints", given.joints, Joint)):
            if (
                not isinstance(items, (list, tuple))
                or not items
                or not all(isinstance(x, kind) for x in items)
            ):
                raise InvalidType(
                    f"Linkage: {name} is a list of one or more {kind.__name__}s; got {items!r}"
                )
        links, joints = tuple(self.links), tuple(self.joints)
        for joint in joints:
            for number in (joint.first, joint.second):
                if number is not None and number >= len(links):
                    raise InvalidInput(
                        f"Linkage: {joint!r} holds body {number}; there "
                        f"are {len(links)}, numbered from 0"
                    )
        object.__setattr__(self, "links", links)
        object.__setattr__(self, "joints", joints)
        group = ProductGroup(*[SE3()] * len(links))
        free = LiePoissonSystem(group, KineticEnergy(_inertia(links)))
        weights = Weights([link.mass * self.gravity for link in links])
        object.__setattr__(self, "body", MechanicalSystem(free, weights))
        object.__setattr__(self, "constraint", Joints(joints))
        super().__post_init__()

    # ---------------------------------------------------------------- poses

    def assembled(self, poses: Any, velocities: Any = None) -> BodyState:
        """The consistent start nearest to the poses and velocities of the bodies.

        poses : (N, 4, 4).  velocities : body velocities (w, v), (N, 6), in rad/s and m/s; at rest
        if left out.
        """
        count = len(self.links)
        g = real_array(poses, "Linkage.assembled: poses")
        xi = (
            np.zeros((count, 6))
            if velocities is None
            else real_array(velocities, "Linkage.assembled: velocities")
        )
        for name, array, shape in (("poses", g, (count, 4, 4)), ("velocities", xi, (count, 6))):
            if array.shape != shape:
                raise InvalidInput(
                    f"Linkage.assembled: {name} has shape "
                    f"{array.shape}; {count} bodies have {shape}"
                )
        mu = np.array(self.body.body.lagrangian.momentum(xi.reshape(6 * count)))
        return self.consistent(mu, g.reshape(16 * count))

    def poses(self, g: Any) -> np.ndarray:
        """The poses of the bodies.  g : (..., 16 N);  returns (..., N, 4, 4)."""
        array = real_array(g, "Linkage.poses: g")
        return array.reshape(*array.shape[:-1], len(self.links), 4, 4)

    def total_momentum(self, mu: Any, g: Any) -> np.ndarray:
        """Angular momentum about the origin and linear momentum of all bodies together, seen from
        space, (..., 6).
        """
        m = np.asarray(self.spatial_momentum(mu, g))
        return m.reshape(*m.shape[:-1], len(self.links), 6).sum(axis=-2)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, and the momenta of the motions of space that are symmetries of joints and
        gravity.
        """
        kept = super().constants(states)
        directions = self._symmetries(states["g"])
        if len(directions):
            kept["spatial momentum"] = self.total_momentum(states["mu"], states["g"]) @ directions.T
        return kept

    def _symmetries(self, g: np.ndarray) -> np.ndarray:
        """The velocities of space, (k, 6), that change no condition and no energy, at the first, a
        middle and the last sample.
        """
        changes, flat = [], g.reshape(-1, g.shape[-1])
        for one in flat[[0, len(flat) // 2, -1]]:
            turns = np.concatenate(
                [np.array(SE3().Ad(SE3().inverse(pose), np.eye(6))).T for pose in self.poses(one)]
            )
            for rows in self._matrix(self.rows(one)), np.array(self.force(one))[None]:
                sizes = (abs(rows) @ np.abs(turns)).max(axis=1, keepdims=True)
                changes.append(rows @ turns / np.where(sizes > 0.0, sizes, 1.0))
        _, sizes, directions = np.linalg.svd(np.concatenate(changes))
        return directions[np.r_[sizes, np.zeros(6)][:6] <= SURVIVES]


def _inertia(links: tuple[Link, ...]) -> np.ndarray:
    """The inertia of all bodies, diagonal if it can be."""
    if all(np.ndim(np.array(link.inertia)) == 1 for link in links):
        return np.concatenate([[*link.inertia, *[link.mass] * 3] for link in links])
    whole = np.zeros((6 * len(links),) * 2)
    for b, link in enumerate(links):
        J = np.array(link.inertia)
        whole[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = J if J.ndim == 2 else np.diag(J)
        whole[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = link.mass * np.eye(3)
    return whole


def chain(
    count: int,
    mass: float = 1.0,
    length: float = 1.0,
    radius: float = 0.05,
    axis: Any = None,
    gravity: float = 9.80665,
) -> Linkage:
    """Equal rods that hang one from another, the first from the origin, by ball joints or, given an
    axis, by hinges.

    mass : of a rod, in kg.  length, radius : in m.  axis : of all hinges, across e3, (3,).  Frames
    have e3 along the rod, upwards.
    Source: Lee, Leok and McClamroch, Global Formulations of Lagrangian and Hamiltonian Dynamics on
    Manifolds (2018), section 9.4.
    """
    if type(count) is not int or count < 1:
        raise InvalidInput(f"chain: count is a whole number of rods, at least 1; got {count!r}")
    top, bottom = vec(0.0, 0.0, 0.5 * length), vec(0.0, 0.0, -0.5 * length)
    ends = [
        (b, None, top, vec(0.0, 0.0, 0.0)) if b == 0 else (b, b - 1, top, bottom)
        for b in range(count)
    ]
    linkage, hinge = Linkage, RevoluteJoint  # type: Any, Any
    joints: list[Any] = [BallJoint(*end) for end in ends]
    if axis is not None:
        joints = [hinge(*end, axis, axis) for end in ends]
    return linkage([Link.rod(mass, length, radius)] * count, joints, gravity)
