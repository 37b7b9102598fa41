"""Poisson systems: a Poisson structure and an energy."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar, final

import numpy as np

from ..errors import InvalidInput, InvalidType, NotDefined
from ..formulas import Vec, gradient, record, vec
from ..formulas.derived import derived
from ..formulas.remembered import common
from ..groups.poisson_structure import PoissonStructure
from ..groups.vector_space import VectorSpace
from ..retractions import Retraction
from .agreement import require_one_body
from .hamiltonian import Hamiltonian
from .parts import Part, SplitHamiltonian, recognised, second_degree
from .system import State, System, frozen, points


@record
class PoissonState(State):
    """Where a Poisson system is: a point `y`, (n,) or, for an ensemble, (members, n)."""

    y: Any


@record
class PoissonSystem(System):
    """Motion by a Poisson structure and an energy, y' = B(y) dH(y) in R^n.

    structure : B, such as Canonical(2), LogCanonical(c), coadjoint(group).poisson_structure, or a
    PoissonStructure of one's own.
    hamiltonian : the energy as a function of y, a Hamiltonian; a SplitHamiltonian if its parts have
    motions that are known, by which `Splitting` steps it.  A subclass may write `energy(y)`
    instead.

    The group that moves y is R^n under addition, so that RKMK is the Runge-Kutta method of its
    tableau, Taylor the Taylor method.  Conserved: the energy and the Casimirs of the structure.
    `parts` are those of the energy, with their motions where these are known; `quadratic` : are
    they two, (T, V), with {V, {V, {V, T}}} = 0, as if T were of second degree in momenta?

    Raises InvalidType, InvalidInput for a hamiltonian that does not fit the structure.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.2.
    """

    coordinates: ClassVar[tuple[str, ...]] = ("y",)
    bounded: ClassVar[bool] = True
    alternatives: ClassVar[str] = (
        "Splitting(order=4) is for parts whose motion is known, RKMK accepts every system"
    )

    structure: PoissonStructure
    hamiltonian: Hamiltonian | None = None  # None: a subclass writes `energy`
    parts: tuple[Hamiltonian, ...] = field(init=False, repr=False, default=())
    quadratic: bool = field(init=False, repr=False, default=False)

    def __post_init__(self) -> None:
        name = type(self).__name__
        structure, given = self.structure, self.hamiltonian  # type: Any, Any
        if not isinstance(structure, PoissonStructure):
            raise InvalidType(
                f"{name}: structure must be a PoissonStructure, such "
                f"as Canonical(2); got {structure!r}"
            )
        if given is not None:
            if not isinstance(given, Hamiltonian):
                raise InvalidType(
                    f"{name}: hamiltonian must be a Hamiltonian, a "
                    f"record with `energy`; got {given!r}"
                )
            require_one_body(name, self.group, given, None)
            each = given.parts if isinstance(given, SplitHamiltonian) else (given,)
            found = [recognised(self.structure, part) for part in each]
            object.__setattr__(
                self, "parts", tuple([p if isinstance(f, str) else f for p, f in zip(each, found)])
            )
            object.__setattr__(
                self, "quadratic", len(each) == 2 and second_degree(self.structure, *each)
            )
        super().__post_init__()

    # ---------------------------------------------------------------- formulas

    def energy(self, y: Vec) -> float:
        """H(y).  y : (n,)."""
        if self.hamiltonian is None:
            raise NotDefined(f"{type(self).__name__} must define `energy`, or have a hamiltonian")
        return self.hamiltonian.energy(y)

    @derived
    def gradient(self, y: Vec) -> Vec:
        """dH(y), (n,).  y : (n,)."""
        if self.hamiltonian is None:
            return gradient(lambda x: self.energy(x), y)
        return self.hamiltonian.gradient(y)

    @final
    def velocity(self, y: Vec) -> Vec:
        """y' = B(y) dH(y).  y : (n,)."""
        return self.structure.sharp(y, self.gradient(y))

    @final
    def casimirs(self, y: Vec) -> Vec:
        """The Casimirs of the structure: constant whatever the energy.  y : (n,)."""
        return self.structure.casimirs(y)

    # ---------------------------------------------------------------- how it moves

    @property  # type: ignore[misc]
    def group(self) -> VectorSpace:
        """R^n under addition."""
        return self._space

    @common
    def _space(self) -> VectorSpace:
        return VectorSpace(self.structure.dim)

    @final
    def rate(self, t: float, state: PoissonState) -> Vec:
        """y'."""
        return self.velocity(state.y)

    @final
    def displaced(self, retraction: Retraction, state: PoissonState, omega: Vec) -> PoissonState:
        """y + omega."""
        return PoissonState(retraction.compose_tau(self.group, state.y, omega))

    @final
    def variation(self, state: PoissonState, omega: Vec) -> tuple[Vec, Vec]:
        """The displacement, beside |y|."""
        return omega, vec(*[abs(x) for x in state.y])

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, and the Casimirs of the structure."""
        y = states["y"]
        casimirs = np.asarray(self.casimirs(y))
        kept = {"energy": np.asarray(self.energy(y))}
        return kept | {f"Casimir {i + 1}": casimirs[..., i] for i in range(casimirs.shape[-1])}

    @final
    def unknown_motion(self) -> str:
        """Why the motion of some part of the energy is not known; empty if all are."""
        if not self.parts:
            return "it has no hamiltonian: give one, a SplitHamiltonian of its parts"
        for part in self.parts:
            if not isinstance(part, Part):
                return str(recognised(self.structure, part))
        return ""

    # ---------------------------------------------------------------- checked input

    @final
    def state(self, y: Any) -> PoissonState:
        """A start for `integrate`: a point y, (n,), or (members, n) for an ensemble.

        Raises InvalidInput for wrong shapes, entries that are not finite, and points at which the
        energy has no value.
        """
        where, shape = f"{type(self).__name__}.state", (self.structure.dim,)
        array = points(y, f"{where}: y", shape, f"a point of {self!r}")
        self._require(array, where)
        return self.vouched(
            PoissonState(frozen(array, shape, None if array.shape == shape else len(array)))
        )

    def _require(self, y: np.ndarray, where: str) -> None:
        """Raise InvalidInput for points outside of where the system is defined; a subclass knows."""

    @final
    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.structure.dim,) if kind == "Vec" else None


def positive(y: np.ndarray, where: str, what: str = "y") -> None:
    """Refuse coordinates that are not positive."""
    bad = np.argwhere(~(y > 0.0))
    if len(bad):
        raise InvalidInput(
            f"{where}: {what} must be positive; "
            f"{what}{list(map(int, bad[0]))} is {y[tuple(bad[0])]:g}"
        )
