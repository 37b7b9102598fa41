"""Poisson systems: a Poisson structure and an energy."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar, final

import numpy as np

from ...errors import InvalidInput, NotDefined, require
from ...formulas import Vec, gradient, record
from ...formulas.classes.derived import derived
from ...groups.poisson_structure import PoissonStructure
from ...systems.agreement import require_one_body
from ...systems.hamiltonian import Hamiltonian
from ...systems.in_time.driven_hamiltonian import DrivenHamiltonian
from ...systems.parts import OfParts, Part, SplitHamiltonian, recognised, second_degree
from ...systems.vector_field import MotionOfPoints, PoissonState, VectorField

__all__ = ["DrivenPoissonSystem", "PoissonState", "PoissonSystem", "positive"]


@record
class PoissonSystem(OfParts, VectorField):
    """Motion by a Poisson structure and an energy, y' = B(y) dH(y) in R^n.

    structure : B, such as Canonical(2), LogCanonical(c), coadjoint(group).poisson_structure, or a
    PoissonStructure of one's own.
    hamiltonian : the energy as a function of y, a Hamiltonian; a SplitHamiltonian if its parts have
    motions that are known, by which `Splitting` steps it.  A subclass may write `energy(y)`
    instead, which then counts, and not the hamiltonian of a ready system.

    The group that moves y is R^n under addition, so that RKMK is the Runge-Kutta method of its
    tableau, Taylor the Taylor method.  Conserved: the energy and the Casimirs of the structure.
    `parts` are those of the energy, with their motions where these are known; `quadratic` : are
    they two, (T, V), with {V, {V, {V, T}}} = 0, as if T were of second degree in momenta?

    Raises InvalidType, InvalidInput for a hamiltonian that does not fit the structure.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.2.
    """

    bounded: ClassVar[bool] = True
    alternatives: ClassVar[str] = "Splitting(order=4) is for parts whose motion is known, RKMK accepts every system"

    structure: PoissonStructure
    hamiltonian: Hamiltonian | None = None  # None: a subclass writes `energy`
    parts: tuple[Hamiltonian, ...] = field(init=False, repr=False, default=())
    quadratic: bool = field(init=False, repr=False, default=False)

    def __post_init__(self) -> None:
        name = type(self).__name__
        structure: Any = self.structure
        hamiltonian: Any = self.hamiltonian
        require(f"{name}: structure", structure, PoissonStructure, "a PoissonStructure, such as Canonical(2)")
        if hamiltonian is not None and type(self).energy is PoissonSystem.energy:
            require(f"{name}: hamiltonian", hamiltonian, Hamiltonian, "a Hamiltonian, a record with `energy`")
            require_one_body(name, self.group, hamiltonian, None)
            each = hamiltonian.parts if isinstance(hamiltonian, SplitHamiltonian) else (hamiltonian,)
            recognitions = [recognised(self.structure, part) for part in each]
            object.__setattr__(
                self, "parts", tuple([p if isinstance(f, str) else f for p, f in zip(each, recognitions)])
            )
            object.__setattr__(self, "quadratic", len(each) == 2 and second_degree(self.structure, *each))
        super().__post_init__()

    # ---------------------------------------------------------------- formulas

    @property
    def dim(self) -> int:
        return self.structure.dim

    def energy(self, y: Vec) -> float:
        """The energy H(y), by default of the hamiltonian.  y : (n,)."""
        if self.hamiltonian is None:
            raise NotDefined(f"{type(self).__name__} must define `energy`, or have a hamiltonian")
        return self.hamiltonian.energy(y)

    @derived
    def gradient(self, y: Vec) -> Vec:
        """dH(y), (n,).  y : (n,)."""
        if self.hamiltonian is None or type(self).energy is not PoissonSystem.energy:
            return gradient(lambda x: self.energy(x), y)
        return self.hamiltonian.gradient(y)

    @derived
    def logarithmic_gradient(self, y: Vec) -> Vec:
        """y_i dH/dy_i, the gradient by the logarithms of y, (n,).  y : (n,)."""
        return y * self.gradient(y)

    @final
    def velocity(self, y: Vec) -> Vec:
        """y' = B(y) dH(y).  y : (n,)."""
        return self.structure.sharp(y, self.gradient(y))

    @final
    def casimirs(self, y: Vec) -> Vec:
        """The Casimirs of the structure: constant whatever the energy.  y : (n,)."""
        return self.structure.casimirs(y)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, and the Casimirs of the structure."""
        y = states["y"]
        casimirs = np.asarray(self.casimirs(y))
        constants = {"energy": np.asarray(self.energy(y))}
        return constants | {f"Casimir {i + 1}": casimirs[..., i] for i in range(casimirs.shape[-1])}

    def _check_formulas(self, y: np.ndarray) -> None:
        """Without a check: the velocity B dH is no formula of the user."""

    @final
    def in_turn(self, state: PoissonState, turns: list[tuple[int, float]]) -> PoissonState:
        y = state.y
        parts: Any = self.parts
        for part, t in turns:
            y = parts[part].flow(self.structure, y, t)
        return PoissonState(y)

    @final
    def unknown_motion(self) -> str:
        """Why the motion of some part of the energy is not known; empty if all are."""
        if not self.parts:
            return "it is moved by an `energy` of its own: give a hamiltonian instead, a SplitHamiltonian of its parts"
        for part in self.parts:
            if not isinstance(part, Part):
                return str(recognised(self.structure, part))
        return ""


@record
class DrivenPoissonSystem(MotionOfPoints):
    """Motion by a Poisson structure and an energy that changes with time, y' = B(y) dH(t, y) in R^n.

    structure : B.  hamiltonian : the energy as a function of time and y, a DrivenHamiltonian.  Conserved: the Casimirs
    of the structure.

    Raises InvalidType, InvalidInput for a hamiltonian that does not fit the structure.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.2 and VI.1.2.
    """

    driven: ClassVar[bool] = True
    alternatives: ClassVar[str] = "PoissonHamiltonJacobi keeps its structure, RKMK accepts every system"

    structure: PoissonStructure
    hamiltonian: DrivenHamiltonian

    def __post_init__(self) -> None:
        name = type(self).__name__
        require(f"{name}: structure", self.structure, PoissonStructure, "a PoissonStructure, such as Canonical(2)")
        require(f"{name}: hamiltonian", self.hamiltonian, DrivenHamiltonian, "a DrivenHamiltonian, energy(self, t, mu)")
        super().__post_init__()

    @property
    def dim(self) -> int:
        return self.structure.dim

    @final
    def energy(self, t: float, y: Vec) -> float:
        """The energy H(t, y).  y : (n,)."""
        return self.hamiltonian.energy(t, y)

    @final
    def gradient(self, t: float, y: Vec) -> Vec:
        """dH/dy at time t, (n,).  y : (n,)."""
        return self.hamiltonian.gradient(t, y)

    @final
    def rate(self, t: float, state: PoissonState) -> Vec:
        """The velocity y' = B(y) dH(t, y)."""
        return self.structure.sharp(state.y, self.gradient(t, state.y))

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The Casimirs of the structure."""
        casimirs = np.asarray(self.structure.casimirs(states["y"]))
        return {f"Casimir {i + 1}": casimirs[..., i] for i in range(casimirs.shape[-1])}


POISSON_SYSTEMS = PoissonSystem, DrivenPoissonSystem
"""Systems whose points move by a Poisson structure."""


def positive(y: np.ndarray, where: str, what: str = "y") -> None:
    """Refuse coordinates that are not positive."""
    bad = np.argwhere(~(y > 0.0))
    if len(bad):
        raise InvalidInput(f"{where}: {what} must be positive; {what}{list(map(int, bad[0]))} is {y[tuple(bad[0])]:g}")
