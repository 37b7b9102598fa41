"""Splittings of many coupled spins, whose parts turn them exactly: sublattices in the field of the
others, and bonds.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput
from ...formulas import record
from ...groups.composed.species import SpeciesGroup
from ...integrators.memory import Memory, Remembering
from ...integrators.method import alternatives
from ...integrators.orders import set_tableau
from ...systems.in_time.driven import DrivenLiePoissonSystem
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...tableaus.compositions import KAHAN_LI8
from ...tableaus.splittings import BLANES_MOAN4_GENERAL, BLANES_MOAN6_GENERAL, STRANG, SplittingTableau
from .parts_of_spins import Bonds, MotionsOfTerms, Sublattices
from .terms.sums_of_terms import DrivenTerms, MomentumTerms


@record
class TermSplitting(Remembering):
    """Splitting of an energy of many sites into parts whose motions are known; abstract.

    A step begins and ends with the same part, whose last motion joins the first one of the next
    step: what is carried on is the state before the last motion, and how long that is.
    A subclass has `_motions`, a class of `MotionsOfTerms`.

    Source: Hairer, Lubich, Wanner, II.5; McLachlan, SIAM J. Sci. Comput. 16 (1995).
    """

    order: int = 2
    tableau: SplittingTableau = None  # type: ignore[assignment]  # None: the one of this order

    choices: ClassVar[dict[int, SplittingTableau]] = {
        t.order: t for t in (STRANG, BLANES_MOAN4_GENERAL, BLANES_MOAN6_GENERAL, SplittingTableau.of(KAHAN_LI8))
    }
    _motions: ClassVar[type[MotionsOfTerms]]
    symmetric: ClassVar[bool] = True
    adds: ClassVar[bool] = False  # it turns
    joins: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        name, tableau = type(self).__name__, set_tableau(self, SplittingTableau, self.choices)
        if not tableau.symmetric:
            raise InvalidInput(f"{name}: the tableau must be symmetric; got {tableau!r}")
        if tableau.quadratic:
            raise InvalidInput(
                f"{name}: the order of {tableau.name} is that of kinetic energies, quadratic in a "
                "momentum, and spins have none; take BLANES_MOAN4_GENERAL, BLANES_MOAN6_GENERAL, or "
                "leave the tableau out"
            )

    @property
    def name(self) -> str:
        return f"{self.tableau.name} splitting ({self._motions.__name__.lower()})"

    def __repr__(self) -> str:
        is_default = self.tableau == self.choices.get(self.tableau.order)
        argument = f"order={self.order}" if is_default else f"tableau={self.tableau!r}"
        return f"{type(self).__name__}({argument})"

    def require(self, system: Any) -> None:
        """Terms of momenta on a power of a group, of which every part has a known motion."""
        if (
            not isinstance(system, (LiePoissonSystem, DrivenLiePoissonSystem))
            or not isinstance(terms_of(system), MomentumTerms)
            or isinstance(system.group, SpeciesGroup)
        ):
            raise IncompatibleSystem(
                f"{self!r} needs many coupled sites of one species, LiePoissonSystem(SO3() ** sites, "
                f"Terms(...)); got {system!r}. {alternatives(system)}"
            )
        super().require(system)
        why = self._motions(terms_of(system)).refused
        if why:
            raise IncompatibleSystem(f"{self!r} needs terms whose motions are known: {why}. {self.instead(system)}")

    def instead(self, system: Any) -> str:
        """Advice: a method for a system with other terms."""
        return "RKMK accepts every energy, CovariantVariational(Cayley()) and its kin are symplectic"

    def turns(self, motions: MotionsOfTerms) -> tuple[tuple[int, float, float], ...]:
        """The motions of a step: the number of the part, its share of the step, and the share of the step at which
        terms that change with time are taken.  Time is one more part, which moves while all sites rest.
        """
        count = motions.count
        if count + motions.timed == 1:
            return ((0, 1.0, 0.0),)
        turns, at = [], 0.0
        for number, share in self.tableau.sequence(count + motions.timed):
            part = number - motions.timed  # the last parts begin and end a step
            if part < 0:
                at = at + share
            else:
                turns.append((part, share, at))
        return tuple(turns)

    def at_node(self, system: Any, state: BodyState, h: float) -> Any:
        return state, 0.0

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """The motions of the parts in turn; the first one is joined with the last one of the step before."""
        motions = self._motions(terms_of(system))
        state, left = memory.node
        turns = [(part, share * h, t + at * h) for part, share, at in self.turns(motions)]
        (first, time, at_first), last = turns[0], turns[-1]
        if len(turns) == 1:
            state = motions.in_turn(state, turns)
            return Memory(state, (state, 0.0), ())
        state = motions.in_turn(state, [(first, left + time, at_first), *turns[1:-1]])
        return Memory(motions.in_turn(state, [last]), (state, last[1]), ())


def terms_of(system: Any) -> Any:
    """The energy of a system; of one that changes with time, its energy at time 0."""
    energy = system.hamiltonian
    return energy.at_zero if isinstance(energy, DrivenTerms) else energy


@record
class SublatticeSplitting(TermSplitting):
    """Spins by sublattices: the sites of one colour turn about the field of the others, which rest,
    exactly; then those of the next colour.

        mu_i -> Ad*_exp(h xi_i) mu_i,  g_i -> g_i exp(h xi_i),  xi_i = dH/dmu_i, for all i of a colour

    Energies are affine in the momentum of each site, as exchange of every kind and fields are; no
    term has two sites of one colour, which the library sees to.  Each turn keeps the energy, and so
    does the step, to rounding.

    order : 2 (Strang), 4, 6 (Blanes and Moan) or 8 (Kahan and Li); or give a symmetric `tableau`.
    Explicit and symmetric; the volume of the product of the orbits and the Casimirs of every site
    are kept, and the sum of all momenta is not.  It is not symplectic: in a turn the others rest,
    which the turned sites would turn as well; BondSplitting and implicit midpoints are.
    Terms of one site that are not affine, such as D (n . mu)^2, make parts of their own if the
    velocity that they give stays as it is; the energy is then kept up to errors of the order of the
    method.  Terms may change with time, in a DrivenLiePoissonSystem.

    Source: Frank, Huang and Leimkuhler, J. Comput. Phys. 133 (1997); Krech, Bunker and Landau,
    Comput. Phys. Commun. 111 (1998); Omelyan, Mryglod and Folk, Phys. Rev. Lett. 86 (2001).
    """

    symplectic: ClassVar[bool] = False
    _motions: ClassVar[type[MotionsOfTerms]] = Sublattices

    __repr__ = TermSplitting.__repr__


@record
class BondSplitting(TermSplitting):
    """Spins by bonds: the two sites of each turn about their sum, exactly; bonds that share no site
    at the same time.

        a -> Ad*_exp(h c (a + b)) a,  b -> Ad*_exp(h c (a + b)) b,  c = f'(a . b)

    Terms are functions of dot(a.mu, b.mu), such as isotropic exchange, and terms of one site whose
    own motion is known.  Each turn keeps the sum of all momenta, which is kept to rounding where
    there are no terms of one site; the energy oscillates without drift.

    order : 2 (Strang), 4, 6 (Blanes and Moan) or 8 (Kahan and Li); or give a symmetric `tableau`.
    Explicit, symmetric, symplectic on the product of the orbits; Casimirs of every site are kept to
    rounding.

    Source: Steinigeweg and Schmidt, Comput. Phys. Commun. 174 (2006); Tsai, Krech and Landau, Braz.
    J. Phys. 34 (2004).
    """

    symplectic: ClassVar[bool] = True

    _motions: ClassVar[type[MotionsOfTerms]] = Bonds

    __repr__ = TermSplitting.__repr__

    def instead(self, system: Any) -> str:
        """The advice to take SublatticeSplitting, where it accepts the system."""
        if Sublattices(terms_of(system)).refused:
            return super().instead(system)
        return f"SublatticeSplitting(order={self.order}) accepts it"
