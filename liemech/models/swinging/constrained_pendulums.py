"""Pendulums as masses at the ends of rods, in positions: the spherical pendulum, chains of many
links, the four-bar linkage.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, dot, mat, record, sqrt, sum, vec
from ...formulas.classes.derived import closed_form_of
from ...groups.rigid.rotation_coefficients import exp_coefficients
from ...joints.in_memory.links import LinkedBodies
from ...joints.joints import RigidRod
from ...joints.link import Link
from ...joints.linkage import Linkage
from ...joints.linked_joints import LinkedForm
from ...rooms.constraints.constrained import SeparableConstrainedSystem
from ..input_checks import check_positive


def excess(r: Vec, l: float) -> float:
    """|r|^2 - l^2, what a rod of length l is too long: the last square less l^2, and the others.

    The sum of all squares would come near l^2, and its rounding, to larger steps above a power of
    two than below, has a mean that is not zero: lengths would be held on one side.
    """
    last = len(r) - 1
    return (r[last] * r[last] - l * l) + sum([r[i] * r[i] for i in range(last)])


@record
class SphericalPendulum(SeparableConstrainedSystem):
    """A mass on a rod that swings about the origin, H(q, p) = |p|^2/(2 m) + m g q_3 with |q| = l.

    mass : m, in kg.  length : l, in m.  gravity : g, in m/s^2, along -q_3.
    q : the position, (3,), in m.  p : the momentum m q', in kg m/s.
    The constraint is (|q|^2 - l^2)/(2 l), in m, so that its multiplier is the tension of the rod,
    in N.  Conserved: the energy and the angular momentum about the vertical.

    Source: Hairer, Lubich, Wanner, VII.1, example 1.1 (its equations with multiplier); Whittaker,
    Analytical Dynamics, 4th ed., 55.
    """

    degrees: ClassVar[int] = 3
    linear_velocity: ClassVar[bool] = True

    mass: float = 1.0
    length: float = 1.0
    gravity: float = 9.80665

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "mass", "length")

    def kinetic(self, p: Vec) -> float:
        """|p|^2/(2 m), in J.  p : (3,)."""
        return dot(p, p) / (2.0 * self.mass)

    def potential(self, q: Vec) -> float:
        """m g q_3, in J.  q : (3,)."""
        return self.mass * self.gravity * q[2]

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """p/m.  q, p : (3,)."""
        return (1.0 / self.mass) * p

    def force(self, q: Vec, p: Vec) -> Vec:
        """The weight.  q, p : (3,)."""
        return vec(0.0, 0.0, -self.mass * self.gravity)

    def constraint(self, q: Vec) -> Vec:
        """(|q|^2 - l^2)/(2 l), (1,), in m.  q : (3,)."""
        return vec((0.5 / self.length) * excess(q, self.length))

    def constraint_jacobian(self, q: Vec) -> Mat:
        """q/l as a row, (1, 3).  q : (3,)."""
        return mat((1.0 / self.length) * q)

    @closed_form_of("kinetic", "constraint")
    def geodesic(self, q: Vec, p: Vec, t: float) -> tuple[Vec, Vec]:
        """The motion without gravity, along a great circle: positions and momenta after the time t.  q, p : (3,)."""
        shift = t / self.mass
        turning = (shift / (self.length * self.length)) * dot(p, p)
        x = shift * turning  # the square of the angle
        sinc, versine = exp_coefficients(x)
        return q + ((sinc * shift) * p - (x * versine) * q), p - ((sinc * turning) * q + (x * versine) * p)

    def vertical_momentum(self, q: Vec, p: Vec) -> float:
        """The angular momentum about the vertical, q_1 p_2 - q_2 p_1, in kg m^2/s.  q, p : (3,)."""
        return q[0] * p[1] - q[1] * p[0]

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, the constraints, and the angular momentum about the vertical."""
        return super().constants(states) | {
            "vertical momentum": np.asarray(self.vertical_momentum(states["q"], states["p"]))
        }


@record
class ChainPendulum(SeparableConstrainedSystem):
    """A chain of masses on rods that hangs from the origin, in space or in a plane; chaotic from
    two links on.

    masses : (N,), in kg.  lengths : of the rods, (N,), in m.  gravity : in m/s^2, along the last
    axis.  dimension : 3, or 2.
    q : the positions of the masses one after the other, (N dimension,), in m.  p : their momenta.
    The constraints are (|q_i - q_i-1|^2 - l_i^2)/(2 l_i), in m, so that the multipliers are the
    tensions of the rods, in N.  Conserved: the energy and, in space, the angular momentum about the
    vertical.  RATTLE and its compositions step more than `small` numbers by loops over masses and
    rods, as a Linkage of RigidRods between points.

    Source: Hairer, Lubich, Wanner, VII.1 (the N-fold pendulum); Landau and Lifshitz, Mechanics, 3rd
    ed., section 5.
    """

    linear_velocity: ClassVar[bool] = True
    small: ClassVar[int] = 12  # of positions: longer chains step by loops over masses and rods

    masses: Vec = vec(1.0, 1.0)
    lengths: Vec = vec(1.0, 1.0)
    gravity: float = 9.80665
    dimension: int = 3

    def __post_init__(self) -> None:
        if self.dimension not in (2, 3):
            raise InvalidInput(f"ChainPendulum: dimension is 2 or 3; got {self.dimension!r}")
        for name, value in (("masses", self.masses), ("lengths", self.lengths)):
            if np.ndim(value) != 1:
                raise InvalidInput(
                    f"ChainPendulum: {name} must be a list, a number for each link, such as [1.0]; got {value!r}"
                )
        if len(self.masses) != len(self.lengths) or not len(self.masses):
            raise InvalidInput(
                f"ChainPendulum: {len(self.masses)} masses and {len(self.lengths)} lengths; each mass has its rod"
            )
        super().__post_init__()
        check_positive(self, "masses", "lengths")

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The number of coordinates, masses times dimension."""
        return len(self.masses) * self.dimension

    # ---------------------------------------------------------------- many masses

    @cached_property
    def linked(self) -> LinkedForm:
        """The masses as bodies that nothing turns, whose rods end in their centres."""
        bodies, rods, makes = Link, RigidRod, Linkage  # type: Any, Any, Any
        links = [bodies(m, [m * l * l] * 3) for m, l in zip(self.masses, self.lengths)]
        joints = [rods(k, k - 1 if k else None, length=l, name=f"rod {k}") for k, l in enumerate(self.lengths)]
        return makes(links, joints, self.gravity).linked

    def label(self, joint: int) -> str:
        """The name of a rod in messages."""
        return f"rod {joint}"

    @property
    @closed_form_of("kinetic", "potential", "constraint")
    def site_form(self) -> LinkedBodies | None:
        """The site form of a long chain, None of a short one."""
        return self.linked.links if self.degrees > self.small else None

    @property
    def _axes(self) -> list[int]:
        """The axes of space along which positions are free."""
        return [0, 1, 2] if self.dimension == 3 else [0, 2]

    def by_site(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """Positions and momenta as poses and momenta of bodies, with an axis of places."""
        if self.site_form is None or "q" not in arrays:
            return arrays
        count, lead = len(self.masses), np.shape(arrays["q"])[:-1]
        mu = np.zeros((*lead, self.linked.places, 6))
        g = np.zeros((*lead, self.linked.places, 4, 4))
        g[:] = np.eye(4)
        points = (*lead, count, self.dimension)
        for k, axis in enumerate(self._axes):
            mu[..., :count, 3 + axis] = np.reshape(arrays["p"], points)[..., k]
            g[..., :count, axis, 3] = np.reshape(arrays["q"], points)[..., k]
        return {"mu": mu, "g": g}

    def as_users_see(self, arrays: dict[str, Any]) -> dict[str, Any]:
        if "g" not in arrays:
            return arrays
        mu, g, count = arrays["mu"], arrays["g"], len(self.masses)
        axes, flat = self._axes, (*g.shape[:-3], self.degrees)
        q = g[..., :count, axes, 3].reshape(flat)
        return {"q": q, "p": mu[..., :count, [3 + k for k in axes]].reshape(flat)}

    # ---------------------------------------------------------------- formulas

    def _links(self, q: Vec) -> list[Vec]:
        """The vectors along the rods."""
        d = self.dimension
        ends = [vec(*[q[d * i + k] for k in range(d)]) for i in range(len(self.masses))]
        return [end if i == 0 else end - ends[i - 1] for i, end in enumerate(ends)]

    def _over_masses(self, p: Vec) -> Vec:
        """The velocities p_i/m_i of all coordinates."""
        inverse = [1.0 / m for m in self.masses]
        return vec(*[inverse[i // self.dimension] * x for i, x in enumerate(p)])

    def kinetic(self, p: Vec) -> float:
        """sum |p_i|^2/(2 m_i), in J.  p : (n,)."""
        return 0.5 * dot(p, self._over_masses(p))

    def potential(self, q: Vec) -> float:
        """sum m_i g times the height, in J.  q : (n,)."""
        d = self.dimension
        return self.gravity * sum([m * q[d * i + d - 1] for i, m in enumerate(self.masses)])

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """p_i/m_i.  q, p : (n,)."""
        return self._over_masses(p)

    def force(self, q: Vec, p: Vec) -> Vec:
        """The weights.  q, p : (n,)."""
        up = self.dimension - 1
        return vec(*[-self.gravity * m if k == up else 0.0 for m in self.masses for k in range(self.dimension)])

    def constraint(self, q: Vec) -> Vec:
        """(|q_i - q_i-1|^2 - l_i^2)/(2 l_i), (N,), in m.  q : (n,)."""
        return vec(*[(0.5 / l) * excess(r, l) for r, l in zip(self._links(q), self.lengths)])

    def constraint_jacobian(self, q: Vec) -> Mat:
        """The directions of the rods, (N, n): (q_i - q_i-1)/l_i where mass i is, and minus that
        where mass i - 1 is.  q : (n,).
        """
        rows: list[Vec] = []
        n = len(self.masses)
        for i, (link, l) in enumerate(zip(self._links(q), self.lengths)):
            unit = (1.0 / l) * link
            parts = [unit if j == i else -unit if j == i - 1 else 0.0 * unit for j in range(n)]
            rows = [*rows, vec(*[x for part in parts for x in part])]
        return mat(*rows)

    def hidden_constraint(self, q: Vec, p: Vec) -> Vec:
        """(q_i - q_i-1).(v_i - v_i-1)/l_i, (N,), in m/s.  q, p : (n,)."""
        speeds = self._links(self._over_masses(p))
        return vec(*[dot(r, v) / l for r, v, l in zip(self._links(q), speeds, self.lengths)])

    def _terms(self, q: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The scales of both constraints: those of the base class, whose rows are mostly zeros."""
        d, v, sizes, speeds = self.dimension, self._over_masses(p), [], []  # type: Any, Any, Any, Any
        for i, (r, l) in enumerate(zip(self._links(q), self.lengths)):
            moving = [(i, k) for k in range(d)] + [(i - 1, k) for k in range(d) if i > 0]
            s = sum([abs(r[k] / l) * abs(q[d * j + k]) for j, k in moving])
            falls = self.gravity * abs(r[d - 1] / l) * (2.0 if i > 0 else 1.0)
            sizes = [*sizes, s]
            speeds = [*speeds, sum([abs(r[k] / l) * abs(v[d * j + k]) for j, k in moving]) + sqrt(s * abs(falls))]
        return vec(*sizes), vec(*speeds)

    def _check_rank(self, where: str, q: np.ndarray, p: np.ndarray, one: bool) -> None:
        """Rods of a chain are independent as long as none is a point."""
        if (
            self.degrees <= self.small
            or not np.diff(q.reshape(len(q), -1, self.dimension), axis=1, prepend=0.0).any(axis=2).all()
        ):
            super()._check_rank(where, q, p, one)

    def hanging(self, directions: Vec) -> Vec:
        """The positions of a chain whose rods point where it is said, unit vectors one after the other, (n,)."""
        d, at = self.dimension, [0.0 for _ in range(self.dimension)]
        positions: list[float] = []
        for i, l in enumerate(self.lengths):
            at = [at[k] + l * directions[d * i + k] for k in range(d)]
            positions = [*positions, *at]
        return vec(*positions)

    def vertical_momentum(self, q: Vec, p: Vec) -> float:
        """The angular momentum about the vertical, in kg m^2/s; in space only.  q, p : (n,)."""
        if self.dimension != 3:
            raise InvalidInput("ChainPendulum.vertical_momentum: a chain in a plane does not turn about the vertical")
        return sum([q[3 * i] * p[3 * i + 1] - q[3 * i + 1] * p[3 * i] for i in range(len(self.masses))])

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, the constraints and, in space, the angular momentum about the vertical."""
        constants = super().constants(states)
        if self.dimension == 3:
            constants |= {"vertical momentum": np.asarray(self.vertical_momentum(states["q"], states["p"]))}
        return constants


@record
class FourBarLinkage(SeparableConstrainedSystem):
    """Parallelograms of equal slender rods side by side: loops + 1 cranks on supports, their ends
    joined; one degree of freedom.

    loops : N.  mass : of each rod, in kg.  length : in m; the supports are as far apart.
    gravity : in m/s^2, along -y.
    q : the positions of the joints B_0, ..., B_N, (2 N + 2,), in m.  p : the momenta M q'.
    A rod whose ends have the velocities a and b has the energy m (|a|^2 + a.b + |b|^2)/6.
    Where all rods are in one line the constraints become dependent, and the motion is not
    determined.

    Source: Gonzalez, Dopico, Lugris, Cuadrado, Multibody Syst. Dyn. 16 (2006) (benchmark problem
    A02 of the IFToMM library).
    """

    linear_velocity: ClassVar[bool] = True

    loops: int = 1
    mass: float = 1.0
    length: float = 1.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        if type(self.loops) is not int or self.loops < 1:
            raise InvalidInput(f"FourBarLinkage: loops is a whole number, at least 1; got {self.loops!r}")
        super().__post_init__()
        check_positive(self, "mass", "length")

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The number of coordinates, 2 (loops + 1)."""
        return 2 * self.loops + 2

    @cached_property
    def _masses(self) -> tuple[Mat, Mat]:
        """The mass matrix of rods of unit mass, for one direction, and its inverse."""
        n = self.loops + 1
        m = np.eye(n) / 3.0
        for j in range(self.loops):
            m[j : j + 2, j : j + 2] += [[1.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 3.0]]
        inverse = np.linalg.inv(m)
        return mat(*[vec(*row) for row in m.tolist()]), mat(*[vec(*row) for row in inverse.tolist()])

    def _of_both(self, m: Mat, x: Vec) -> Vec:
        """A matrix for one direction on the first and on the second coordinates of the joints."""
        n = self.loops + 1
        both = [m @ vec(*[x[2 * j + k] for j in range(n)]) for k in range(2)]
        return vec(*[both[k][j] for j in range(n) for k in range(2)])

    def kinetic(self, p: Vec) -> float:
        """p . M^-1 p/2, in J.  p : (n,)."""
        return 0.5 * dot(p, self._of_both(self._masses[1], p)) / self.mass

    def potential(self, q: Vec) -> float:
        """The weight of the cranks acts half-way up, that of the rods between two joints at half of
        both, in J.  q : (n,).
        """
        return self.mass * self.gravity * sum([share * q[2 * j + 1] for j, share in enumerate(self._shares())])

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """M^-1 p.  q, p : (n,)."""
        return self._of_both(self._masses[1], p) / self.mass

    def force(self, q: Vec, p: Vec) -> Vec:
        """The weight of half of the rods that end at each joint.  q, p : (n,)."""
        return -self.mass * self.gravity * vec(*[x for share in self._shares() for x in (0.0, share)])

    def _shares(self) -> list[float]:
        """The number of rods whose mass each joint carries: half of its crank, and half of each rod beside it."""
        n = self.loops + 1
        return [0.5 + (0.5 if j in (0, n - 1) else 1.0) for j in range(n)]

    def momentum(self, q: Vec, v: Vec) -> Vec:
        """The momenta that belong to velocities of the joints, M v.  q, v : (n,)."""
        return self.mass * self._of_both(self._masses[0], v)

    def constraint(self, q: Vec) -> Vec:
        """The rods have their length: (|r|^2 - l^2)/(2 l), (2 N + 1,), in m: first the cranks.
        q : (n,).
        """
        n, l = self.loops + 1, self.length
        joints = [vec(q[2 * j], q[2 * j + 1]) for j in range(n)]
        cranks = [joints[j] - vec(j * l, 0.0) for j in range(n)]
        rods = [*cranks, *[joints[j + 1] - joints[j] for j in range(self.loops)]]
        return vec(*[excess(r, l) / (2.0 * l) for r in rods])
