"""Fields and loads on single bodies of a linkage."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..errors import InvalidInput, InvalidType
from ..formulas import Mat, Record, Vec, record, vec, vectors
from ..groups.lie_group import LieGroup
from ..groups.rigid.se3 import SE3
from ..systems.potential import Force, Potential
from .points_and_axes import REST6, pose


@record
class PotentialsOfBodies(Potential):
    """The energies of single bodies of a linkage, V = sum V_b(g_b).

    Source: Goldstein, Classical Mechanics, 3rd ed., section 1.3.
    """

    bodies: tuple[int, ...]  # their numbers
    each: tuple[Any, ...]  # by body, a Potential on SE(3)

    def energy(self, g: Vec) -> float:
        return vectors.sum([potential.energy(pose(g, b)) for b, potential in zip(self.bodies, self.each)])

    def force(self, group: LieGroup, g: Any) -> Vec:
        parts = [REST6 for _ in range(group.dim // 6)]
        for b, potential in zip(self.bodies, self.each):
            parts[b] = parts[b] + potential.force(SE3(), pose(g, b))
        return vec(*[x for part in parts for x in part])


@record
class ForcesOfBodies(Force):
    """Loads on single bodies of a linkage.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 2.7.
    """

    bodies: tuple[int, ...]  # their numbers
    each: tuple[Any, ...]  # by body, a Force on SE(3)

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        parts = [REST6 for _ in range(len(g) // 16)]
        for b, load in zip(self.bodies, self.each):
            parts[b] = parts[b] + load.covector(t, xi[6 * b : 6 * b + 6], pose(g, b))
        return vec(*[x for part in parts for x in part])

    def resistance(self, t: float, xi: Vec, g: Any, along: Vec) -> Vec:
        parts = [REST6 for _ in range(len(g) // 16)]
        for b, load in zip(self.bodies, self.each):
            end = 6 * b + 6
            parts[b] = parts[b] + load.resistance(t, xi[6 * b : end], pose(g, b), along[6 * b : end])
        return vec(*[x for part in parts for x in part])


@record
class AtBody(Record):
    """Field and load on one body, beside joints and weight: a Potential and a Force on SE(3), if any."""

    potentials: tuple[Any, ...]
    loads: tuple[Any, ...]

    def pull(self, g: Mat) -> Vec:
        """The force of the potential."""
        return vectors.sum([REST6, *[potential.force(SE3(), g) for potential in self.potentials]])

    def push(self, t: float, xi: Vec, g: Mat) -> Vec:
        """The load at this velocity."""
        return vectors.sum([REST6, *[load.covector(t, xi, g) for load in self.loads]])

    def resistance(self, t: float, xi: Vec, g: Mat, along: Vec) -> Vec:
        """The damping of the load along a velocity."""
        return vectors.sum([REST6, *[load.resistance(t, xi, g, along) for load in self.loads]])


@record
class OnAll(Record):
    """A field and a load on all bodies by one formula, as loops over memory need them: a Potential and a Force on the
    product of their groups, or None.
    """

    group: Any
    count: int  # the number of bodies
    potential: Any
    load: Any
    derived: bool  # does the force of the potential follow from its energy?


def of_bodies(name: str, acting: Any, number: Callable[[Any], int]) -> Any:
    """potential or load of a linkage: one of all bodies as it is, or those of single bodies, by
    their names or numbers.  Raises InvalidType, InvalidInput.
    """
    kind, of_several, words = {  # type: Any, Any, str
        "potential": (Potential, PotentialsOfBodies, "an `energy(g)`"),
        "load": (Force, ForcesOfBodies, "a `covector(t, xi, g)`"),
    }[name]
    if isinstance(acting, of_several):
        for body in acting.bodies:
            number(body)
        if len(acting.bodies) != len(acting.each):
            raise InvalidInput(f"Linkage: {name} names {len(acting.bodies)} bodies for {len(acting.each)} of it")
    if acting is None or isinstance(acting, kind):
        return acting
    if not isinstance(acting, Mapping):
        raise InvalidType(
            f"Linkage: {name} must be a {kind.__name__}, a subclass with {words}, or such of single "
            f'bodies, {{"hand": ...}}; got {acting!r}'
        )
    by_body: dict[int, Any] = {}
    for body, act in acting.items():
        if not isinstance(act, kind):
            raise InvalidType(
                f"Linkage: {name}[{body!r}] must be a {kind.__name__}, a subclass with {words}; got {act!r}"
            )
        if number(body) in by_body:
            raise InvalidInput(f"Linkage: {name} names body {number(body)} twice")
        by_body[number(body)] = act
    return of_several(tuple(by_body), tuple(by_body.values())) if by_body else None
