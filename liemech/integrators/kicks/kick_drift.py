"""Bodies in fields by splitting: kicks by the field, and drifts without it by a method for the free body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, NoConvergence, require
from ...formulas import Mat, Vec, dot, identity_matrix, jacobian, plain, record, vec
from ...formulas.classes.records import with_records
from ...formulas.numbers.conversions import moving_as
from ...formulas.numbers.transposes import is_pulled
from ...formulas.numbers.ways import ANY, MOVING, AnyFunction, Number, Ways, values_of
from ...solvers import newton
from ...systems.in_time.inputs import inputs
from ...systems.in_time.tabulated import PiecewisePolynomial
from ...systems.kinetic_energy import has_inertia
from ...systems.lie_poisson import BodyState
from ...systems.many.energies import OfManySites
from ...systems.mechanical import MechanicalSystem
from ...systems.system import member
from ...tableaus.splittings import BLANES_CASAS_ESCORIHUELA8, BLANES_MOAN4, BLANES_MOAN6, STRANG, SplittingTableau
from ..free_body.exact_free_body import ExactFreeBody
from ..free_body.moser_veselov import ExactMoserVeselov
from ..memory import Memory, Remembering
from ..method import Method, alternatives
from ..orders import set_tableau
from .explicit_kicks import damping_and_slopes, refusal_by, throws_back, turns_round


@record
class FieldSplitting(Remembering):
    """Kicks and drifts in turn, by a `tableau`; the drifts are made by a `free` method; abstract.

    A subclass has both, as fields or properties.
    Source: Hairer, Lubich, Wanner, II.5; for loads Marsden and West, Acta Numerica 10 (2001),
    section 3.2.
    """

    if TYPE_CHECKING:  # fields here would be arguments of every splitting

        @property
        def free(self) -> Any: ...

        @property
        def tableau(self) -> SplittingTableau: ...

    def require(self, system: Any) -> None:
        """A body in a field, that the free motion accepts."""
        if not isinstance(system, MechanicalSystem):
            advice = alternatives(system, f"Without a field it is {self.free!r}")
            raise IncompatibleSystem(f"{self!r} needs a body in a field, a MechanicalSystem; got {system!r}. {advice}")
        body: Any = system.body
        frozen = self._frozen(system)
        self.free.require(body.at(0.0) if frozen else body)
        if frozen and self.tableau.order > 2:
            raise IncompatibleSystem(
                f"{self!r}: with an energy that changes with time drifts of {self.free!r} are of order "
                "2; Composition(KickDrift(), order=4) is of order 4"
            )

    def step_warning(self, system: Any, start: BodyState, h: float) -> str | None:
        """Whether steps of order 2 are too long; above it, whether a load that depends on the velocity takes it away."""
        order = self.tableau.order
        if self.tableau == STRANG and abs(h) > system.largest_step:
            return (
                f"{self!r}: h = {h:g} is longer than {system.largest_step:.3g}, in which the fastest wave crosses a cell: "
                "short waves will grow. Take shorter steps, or fewer cells"
            )
        if order <= 2 or system.load is None or not _feels_velocity(system, start):
            return None
        return (
            f"{self!r} is of order 2 under {system.load!r}, which depends on the velocity; "
            f"Composition(KickDrift(), order={order}) keeps its order"
        )

    def at_node(self, system: Any, state: BodyState, h: float) -> Any:
        """The force of the field; None if a step begins with a drift."""
        return system.force(state.g) if self.tableau.kicks[0] != 0.0 else None

    def beginning(self, system: Any, state: BodyState, h: float) -> tuple[Any, ...]:
        """The pasts of the drifts in the free motion: each begins with the state alone."""
        return tuple([self._begun(system, state, a * h) for a in self.tableau.drifts])

    def _begun(self, system: Any, state: BodyState, h: float) -> Any:
        return self.free.past(self.free.start(self._body(system, 0.0), state, h))

    def _body(self, system: Any, t: float) -> Any:
        """The body that drifts: one whose energy changes with time, with that of the time t, in the
        middle of the drift, if the free method knows none.

        Source: Iserles, Munthe-Kaas, Norsett and Zanna, Acta Numerica 9 (2000), section 2.4 (the
        exponential midpoint rule).
        """
        return system.body._at(t) if self._frozen(system) else system.body

    def _frozen(self, system: Any) -> bool:
        """Whether the body's energy is frozen in the middle of each drift."""
        return system.driven and not self.free.timed

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Kick, drift, kick, ...; one force for each kick, the last one carried on to the next step."""
        free, tableau, state, force = self.free, self.tableau, memory.state, memory.node
        pasts: list[Any] = []
        ends = len(tableau.drifts)
        for i in range(ends + 1):
            time = t + tableau.nodes[i] * h
            if tableau.kicks[i] != 0.0:
                force = force if i == 0 else system.force(state.g)
                state = self._kick(system, time, state, force, tableau.kicks[i] * h, i > 0, i < ends, h)
            if i < ends:
                drift = tableau.drifts[i] * h
                body = self._body(system, time + 0.5 * drift)
                past = free.resume(body, state, memory.past[i], drift)
                after = free.step(body, time, past, drift)
                state, pasts = free.observe(after), [*pasts, free.past(after)]
        return Memory(state, force if tableau.kicks[0] != 0.0 else None, tuple(pasts))

    def _kick(
        self, system: Any, t: float, state: BodyState, force: Vec, h: float, ends: bool, begins: bool, whole: float
    ) -> BodyState:
        """A kick of length h in a step `whole`, which ends a drift, begins one, or both.

        A load F joins it: in the part that ends a drift as it is at the end, an equation for mu,
        else as it is at the beginning.
        """
        if system.load is None:
            return _kicked(state, h * force)
        part = 0.5 * h if ends and begins else h
        if ends:
            state = _kicked(state, part * force)
            state = _kicked(state, self._load_at_the_end(system, t, state, part))
            self._require_gentle(system, t, state, -part, whole)
        if begins:
            self._require_gentle(system, t, state, part, whole)
            load = _load(system, t, state.mu, state.g)
            state = _kicked(_kicked(state, part * force), part * load)
        return state

    def _require_gentle(self, system: Any, t: float, state: BodyState, kick: float, h: float) -> None:
        """Refuse a step h in which a kick of this length, as it is at its start, throws back."""
        if is_pulled():
            return
        mu, g = plain(state.mu), plain(state.g)
        if system.load.coupled or system.body.hamiltonian.coupled:  # sites ask each other outside of branches
            damping, slopes = damping_and_slopes(system, t, mu, g)
            if kick > 0.0 and turns_round(damping, slopes, kick):
                raise refusal_by(self, system, damping, slopes, kick, abs(h))
        elif kick > 0.0 and throws_back(system, t, mu, g, kick):
            raise refusal_by(self, system, *damping_and_slopes(system, t, mu, g), kick, abs(h))

    def _load_at_the_end(self, system: Any, t: float, state: BodyState, h: float) -> Vec:
        """The k = h F at mu + k, by Newton's method."""
        # of a site without a load the guess is zero, and carries the derivative that those of the other sites carry
        guess = moving_as(h * _load(system, t, state.mu, state.g), state.mu[0])
        coupled = system.load.coupled or system.body.hamiltonian.coupled
        kick, residual, enough, _ = newton(lambda k: self._excess(system, t, state, h, k), guess, coupled=coupled)
        if not residual <= enough:
            raise NoConvergence(
                f"{self!r}: no momentum found that fits the load at the end of a kick; try h = {0.5 * h:g}"
            )
        return kick

    def _excess(self, system: Any, t: float, state: BodyState, h: float, kick: Vec) -> tuple[Vec, Mat, float]:
        """k - h F at mu + k and its derivative, beside |mu|^2 + |k|^2."""
        r = kick - h * _load(system, t, state.mu + kick, state.g)
        slope = jacobian(lambda m: h * _load(system, t, m, state.g), state.mu + kick)
        return r, identity_matrix(len(kick)) - slope, dot(state.mu, state.mu) + dot(kick, kick)


def _kicked(state: BodyState, kick: Vec) -> BodyState:
    return BodyState(state.mu + kick, state.g)


def _load(system: Any, t: float, mu: Vec, g: Any) -> Vec:
    return system._loaded(t, system.velocity(mu, t), g)


def _feels_velocity(system: Any, start: BodyState) -> bool:
    """Whether the load depends on the velocity, at some time, where the body starts; of an ensemble where its first
    member does.
    """
    if isinstance(system.load, OfManySites):
        return bool(system.load.feels_velocity)
    g, ways, rng = member(start, 0).g, Ways(True), np.random.default_rng(3)
    try:
        for _ in ways.each():
            xi = vec(*[Number(x, ways, MOVING) for x in rng.normal(size=(system.body.group.dim, 2))])
            tables = [AnyFunction(x.size, lambda: Number(rng.normal(size=2), ways, ANY)) for x in inputs(system.load)]
            load = with_records(system.load, PiecewisePolynomial, tables)
            components = [
                np.broadcast_to(values_of(x), 2) for x in load.covector(Number(np.full(2, 0.3), ways, ANY), xi, g)
            ]
            if any(still != moving for still, moving in components):
                return True
    except Exception:  # of a formula that asks for more it is not known
        return True
    return False


@record
class KickDrift(FieldSplitting):
    """Splitting of H = T + V: the field kicks, mu' = f(g) with g at rest, and the body drifts
    without it; both flows exactly.

    free : the motion without the field, a method for the free body; for orders above 2 one of at
    least that order.
    order : 2 (Strang, kick-drift-kick), 4, 6 or 8 (Runge-Kutta-Nystroem splittings of 6, 14 and 19
    kicks; for quadratic T); or give a `tableau`, such as BLANES_MOAN6_SHORT of
    `liemech.tableaus.splittings`.

    Symmetric, symplectic and of the order of the tableau if the free motion is; a momentum that
    belongs to a symmetry of the potential is kept to rounding, the energy oscillates without
    drift.  The largest drift is `tableau.reach` times h.  A load F, by the principle of Lagrange
    and d'Alembert, joins each kick; where it depends on the velocity by the trapezoidal rule, of
    order 2.

    Source: Blanes and Moan, J. Comput. Appl. Math. 142 (2002); Hairer, Lubich, Wanner, II.5; for
    exact free bodies Celledoni, Fasso, Safstrom and Zanna, SIAM J. Sci. Comput. 30 (2008).
    """

    title: ClassVar[str] = "{0.tableau.name} splitting ({0.free.name})"

    free: Method = ExactFreeBody()
    order: int = 2
    tableau: SplittingTableau = None  # type: ignore[assignment]  # None: the one of this order

    choices: ClassVar[dict[int, SplittingTableau]] = {
        t.order: t for t in (STRANG, BLANES_MOAN4, BLANES_MOAN6, BLANES_CASAS_ESCORIHUELA8)
    }

    def __post_init__(self) -> None:
        free: Any = self.free
        require("KickDrift: free", free, Method, "a method for the free body such as ExactFreeBody()")
        if isinstance(free, ExactMoserVeselov):
            raise InvalidInput(
                "KickDrift: ExactMoserVeselov is fitted to one orbit, and a kick moves the body to "
                "another; take ExactFreeBody()"
            )
        tableau = set_tableau(self, SplittingTableau, self.choices)
        if not tableau.symmetric:
            raise InvalidInput(f"KickDrift: the tableau must be symmetric; got {tableau!r}")
        order = free.order
        if order < tableau.order:
            raise InvalidInput(
                f"KickDrift: {tableau.name} needs drifts of order {tableau.order}, such as "
                f"ExactFreeBody(); {free!r} is of order {order}. Composition(KickDrift({free!r}), "
                f"order={tableau.order}) is of order {tableau.order} with symmetric ones"
            )

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        """Whether the method for the free motion is symmetric."""
        return self.free.symmetric

    @property
    def symplectic(self) -> bool:  # type: ignore[override]
        """Whether the method for the free motion is symplectic, with the elements."""
        return self.free.symplectic and not self.free.of_momenta

    def require(self, system: Any) -> None:
        """A body in a field that the free motion accepts, with an energy that the tableau accepts."""
        super().require(system)
        body = self._body(system, 0.0)
        body = body.site_form or body
        energies = body.hamiltonian.of_species
        if self.tableau.quadratic and not all(map(has_inertia, energies)):
            raise IncompatibleSystem(
                f"{self!r} is for energies quadratic in the momentum; {system.body!r} has another "
                f"one. Composition(KickDrift({self.free!r}), "
                f"order={self.tableau.order}) is of its order with every energy"
            )

    def __repr__(self) -> str:
        is_default = self.tableau == self.choices.get(self.tableau.order)
        return (
            f"KickDrift({self.free!r}, {f'order={self.tableau.order}' if is_default else f'tableau={self.tableau!r}'})"
        )
