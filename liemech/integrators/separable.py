"""Splittings: the motions of the parts of an energy in turn; kicks and drifts for T(p) + V(q),
exact flows for Poisson systems.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from ..errors import IncompatibleSystem, InvalidInput, InvalidType
from ..formulas import plain, record
from ..systems.canonical import CanonicalState, HamiltonianSystem
from ..systems.parts import OfParts
from ..systems.separable import SeparableSystem
from ..tableaus.compositions import KAHAN_LI8
from ..tableaus.splittings import (
    BLANES_CASAS_ESCORIHUELA8,
    BLANES_MOAN4,
    BLANES_MOAN4_GENERAL,
    BLANES_MOAN6_GENERAL,
    BLANES_MOAN6_SHORT,
    RUTH3,
    STRANG,
    SYMPLECTIC_EULER,
    SplittingTableau,
)
from .memory import Memory, Remembering
from .method import Method, alternatives
from .orders import set_tableau


@record
class OfTableau(Method):
    """A splitting with a `tableau`, as a field or a property; abstract.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.5.
    """

    symplectic: ClassVar[bool] = True

    if TYPE_CHECKING:  # a field here would be an argument of every splitting

        @property
        def tableau(self) -> SplittingTableau: ...

    @property
    def order(self) -> int:
        return self.tableau.order

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        """Whether the tableau of the splitting is symmetric."""
        return self.tableau.symmetric


@record
class ChosenByOrder(OfTableau):
    """A splitting whose tableau is given, or chosen by its order; abstract."""

    title: ClassVar[str] = "{0.tableau.name} splitting"

    order: int = 2
    tableau: SplittingTableau = None  # type: ignore[assignment]  # None: the one of this order
    quadratic: bool = True

    choices: ClassVar[dict[int, SplittingTableau]] = {
        t.order: t
        for t in (SYMPLECTIC_EULER, STRANG, RUTH3, BLANES_MOAN4, BLANES_MOAN6_SHORT, BLANES_CASAS_ESCORIHUELA8)
    }
    general: ClassVar[dict[int, SplittingTableau]] = choices | {
        t.order: t for t in (BLANES_MOAN4_GENERAL, BLANES_MOAN6_GENERAL, SplittingTableau.of(KAHAN_LI8))
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if type(self.quadratic) is not bool:
            raise InvalidType(f"{type(self).__name__}: quadratic is True or False; got {self.quadratic!r}")
        tableau = set_tableau(self, SplittingTableau, self.choices if self.quadratic else self.general)
        object.__setattr__(self, "quadratic", tableau.quadratic)

    def __repr__(self) -> str:
        order = self.tableau.order
        if self.tableau == self.choices.get(order):
            return f"{type(self).__name__}(order={order})"
        if self.tableau == self.general.get(order):
            return f"{type(self).__name__}(order={order}, quadratic=False)"
        return f"{type(self).__name__}(tableau={self.tableau!r})"


@record
class SeparableSplitting(OfTableau, Remembering):
    """Kicks p += b_i h f(q) and drifts q += a_i h v(p) in turn, by a `tableau`, or the motions of
    all parts; abstract.

    A subclass has the tableau, as a field or a property.  The parts of a Poisson system are a
    composition of the step that makes the motion of each part once, last part first, and of its
    adjoint, with the coefficients of the tableau.
    """

    def require(self, system: Any) -> None:
        """A separable system, whose kinetic energy the tableau accepts, or a system of parts whose
        motions are known.
        """
        if isinstance(system, OfParts):
            self._require_parts(system)
            return
        if not isinstance(system, SeparableSystem):
            raise IncompatibleSystem(f"{self!r} needs a SeparableSystem, H = T(p) + V(q); {self._unsuitable(system)}")
        super().require(system)
        if self.tableau.quadratic and not system.quadratic:
            raise IncompatibleSystem(
                f"{self!r} is of its order for a T(p) of second degree only, and the `kinetic` of "
                f"{system!r} is not seen to be a polynomial of second degree, as dot(p, p) is and "
                "norm(p)**2 is not. "
                f"Splitting(order={self.order}, quadratic=False) is of this order for every T"
            )

    def _require_parts(self, system: OfParts) -> None:
        """Parts whose motions are known, as many as the tableau can be used for."""
        unknown = system.unknown_motion()
        if unknown:
            raise IncompatibleSystem(
                f"{self!r} needs parts that have known motions: {unknown}. RKMK accepts every system"
            )
        if self.tableau_for(system).quadratic and not system.quadratic:
            raise IncompatibleSystem(
                f"{self!r} is of its order for two parts T, V with {{V, {{V, {{V, T}}}}}} = 0 "
                f"only, and {system!r} is not such a system. Splitting(order={self.order}, "
                "quadratic=False) is of this order for all parts"
            )

    def tableau_for(self, system: Any) -> SplittingTableau:
        """The tableau with which a system is stepped."""
        return self.tableau

    def _unsuitable(self, system: Any) -> str:
        """Why a system is not separable, and what it is to be stepped with."""
        if isinstance(system, HamiltonianSystem) and not system.fictive:
            return (
                f"{system!r} gives one energy(q, p). If that is a sum T(p) + V(q), derive from "
                "SeparableSystem and write kinetic(p) and potential(q); if not, "
                "HamiltonJacobi(order=4) and RKMK(tableau=tableaus.gauss(2)) are symplectic for it"
            )
        return f"got {system!r}. {alternatives(system)}"

    def at_node(self, system: Any, state: Any, h: float) -> Any:
        """The force, if a step begins with the one at which the step before ended."""
        if isinstance(system, OfParts) or not self.tableau.carries_force:
            return None
        start = plain(state)
        return system.force(start.q, start.p)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Kick, drift, kick, ..., or the motions of the parts in turn."""
        if isinstance(system, OfParts):
            turns = self.tableau_for(system).sequence(len(system.parts))
            moved = system.in_turn(memory.state, [(part, share * h) for part, share in turns])
            return Memory(moved, None, ())
        tableau, force = self.tableau, memory.node
        q, p = memory.state.q, memory.state.p
        for i, b in enumerate(tableau.kicks):
            if b != 0.0:
                force = memory.node if i == 0 and tableau.carries_force else system.force(plain(q), plain(p))
                p = p + (b * h) * force
            if i < len(tableau.drifts):
                q = q + (tableau.drifts[i] * h) * system.velocity(plain(q), plain(p))
        return Memory(CanonicalState(q, p), force if tableau.carries_force else None, ())


@record
class Splitting(ChosenByOrder, SeparableSplitting):
    """Splitting of an energy into parts whose motions are known, each made exactly and in turn.

    Of H = T(p) + V(q), a SeparableSystem: V kicks, p' = -dV/dq with q at rest, T drifts, q' = dT/dp
    with p at rest.  Of a PoissonSystem with a SplitHamiltonian: any number of parts; a step is a
    Poisson map, and keeps Casimirs to rounding.

    order : 1 (symplectic Euler), 2 (Stormer-Verlet), 3 (Ruth), 4, 6 or 8 (6, 11 and 19 forces a
    step); or give a `tableau`, of `liemech.tableaus.splittings` or `SplittingTableau.of` a
    composition.
    quadratic : is T of second degree in p?  If so, orders 4, 6 and 8 are Runge-Kutta-Nystroem
    splittings, which need it; if not, the order is reached for every T, with larger errors.  Of a
    Poisson system that is looked for, {V, {V, {V, T}}} = 0 for the parts (T, V); the other tableau
    of the same order steps it where this does not hold.

    Explicit and symplectic; symmetric but for orders 1 and 3.  Linear and quadratic constants p . A
    q such as angular momenta are kept to rounding, the energy oscillates without drift.  On a step
    that is too large it grows.

    Source: Hairer, Lubich, Wanner, II.5 and V.3; Ruth, IEEE Trans. Nucl. Sci. 30 (1983); Blanes and
    Moan, J. Comput. Appl. Math.  142 (2002); Blanes, Casas and Escorihuela-Tomas, Appl. Numer.
    Math. 182 (2022).
    """

    def tableau_for(self, system: Any) -> SplittingTableau:
        """The one of this order that every energy allows, for a Poisson system that the one for
        quadratic T does not serve.
        """
        return self._of_any_parts if isinstance(system, OfParts) and not system.quadratic else self.tableau

    @cached_property
    def _of_any_parts(self) -> SplittingTableau:
        """The general tableau of the order instead of one that was chosen for it; kept, for a table of tableaus that a
        step looks up would be compared with what it was in every run.
        """
        return self.general[self.order] if self.tableau == self.choices.get(self.order) else self.tableau

    __repr__ = ChosenByOrder.__repr__


@record
class OneForce(SeparableSplitting):
    """One force a step, kick first or drift first; abstract.

    A subclass has the splitting that kicks first, and what the method is called.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., I.1.4.
    """

    kick_first: ClassVar[SplittingTableau]
    called: ClassVar[str]

    first: str = "kick"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.first not in ("kick", "drift"):
            raise InvalidInput(f'{type(self).__name__}: first is "kick" or "drift"; got {self.first!r}')

    @cached_property
    def tableau(self) -> SplittingTableau:
        """The splitting, or with kicks and drifts exchanged."""
        return self.kick_first if self.first == "kick" else self.kick_first.exchanged

    @property
    def name(self) -> str:
        return f"{self.called}{', drift first' if self.first == 'drift' else ''}"


@record
class StormerVerlet(OneForce):
    """The method of Stormer and Verlet, the leapfrog, for H = T(p) + V(q):

        p = p_n + (h/2) f(q_n),   q_n+1 = q_n + h v(p),   p_n+1 = p + (h/2) f(q_n+1)        first="kick"
        q = q_n + (h/2) v(p_n),   p_n+1 = p_n + h f(q),   q_n+1 = q + (h/2) v(p_n+1)        first="drift"

    Order 2, explicit, symmetric, symplectic; one force a step.  Stable on an oscillator of
    frequency w while |h w| < 2.

    Source: Hairer, Lubich, Wanner, Geometric numerical integration illustrated by the
    Stormer-Verlet method, Acta Numerica 12 (2003), equation (1.5).
    """

    kick_first: ClassVar[SplittingTableau] = STRANG
    called: ClassVar[str] = "Stormer-Verlet"


@record
class SymplecticEuler(OneForce):
    """The symplectic Euler method for H = T(p) + V(q):

        p_n+1 = p_n + h f(q_n),   q_n+1 = q_n + h v(p_n+1)        first="kick"
        q_n+1 = q_n + h v(p_n),   p_n+1 = p_n + h f(q_n+1)        first="drift", its adjoint

    Order 1, explicit, symplectic; one force a step.  HamiltonJacobi(order=1, adjoint=True) and
    HamiltonJacobi(order=1) are the same for energies that are not separable.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.3, theorem 3.3.
    """

    kick_first: ClassVar[SplittingTableau] = SYMPLECTIC_EULER
    called: ClassVar[str] = "Symplectic Euler"
