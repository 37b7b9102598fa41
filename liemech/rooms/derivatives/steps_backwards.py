"""Steps backwards: how a function of the state after a step depends on the state before it, and on
what the energy was asked for in between.

A step F has the derivative J; a function of the state after it has there the derivative w.  As a
function of the state before it, it has J^T w.  Components are those of tangent maps: w_mu belongs to
changes of the momentum and lies in the algebra, w_g to eta with dg = g hat(eta), and lies in its dual.

J^T w of a step follows from its formulas, `formulas/numbers/transposes`, where systems have rules for their velocities, forces
and displacements, and `solvers` for what an equation determines.  Energies of all sites ask all of them again: as
second derivatives commute, products with the transposed derivative are derivatives along a direction,

    (d xi)^T lambda = D_lambda dH/dmu,      (d f)^T lambda = D_lambda f - ad*_lambda f,

the second one not symmetric, as left-invariant fields do not commute.  A parameter p of the energy has the derivative
d/dp D_lambda H, and -d/dp D_lambda V.  Of a symplectic map with the form
Omega((dmu, eta), .) = (eta, ad*_eta mu - dmu) on T*G it is  J^T = Omega J^-1 Omega^-1:  one direction
carried back by the step of length -h of a symmetric method.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2 (the reverse mode); for the form
Abraham and Marsden, Foundations of Mechanics, 2nd ed., proposition 4.4.1.
"""

from __future__ import annotations

from typing import Any

from ...errors import undefined
from ...formulas import Record, Vec, derivative, record, vec
from ...formulas.classes.records import fields_of, records_in, with_fields, with_records
from ...formulas.derivatives import carried
from ...formulas.numbers.transposes import pulled_back
from ...formulas.sites import each_site
from ...groups.retractions import Exponential
from ...integrators.commutator_free import CommutatorFree
from ...integrators.composition import Composition
from ...integrators.free_body.midpoint import ImplicitMidpoint
from ...integrators.kicks.kick_drift import FieldSplitting
from ...integrators.method import steps_as
from ...integrators.rkmk import RKMK
from ...integrators.separable import SeparableSplitting
from ...systems.canonical import CanonicalState
from ...systems.lie_poisson import BodyState
from ...systems.many.energies import moving
from ..hamilton_jacobi.lie_poisson_hj import LiePoissonHamiltonJacobi
from ..sites.parts_of_spins import turned_by
from ..sites.spin_splittings import TermSplitting
from ..sites.terms.terms import at_time
from ..sites.terms.terms_at_site import TermsOfSite, at_this_site
from .frames import group_of


@record
class StepPart(Record):
    """A part of a step, all numbers: which of the `SiteMotion`s it is, when it begins, and how long it is.

    injected : is a derivative by the state before it added?  momenta, elements : of what is kept of the
    energies that were asked, the row of the first.  begin, end : the places of the sites that turn, or
    begin is the colour of bonds, last : behind the last place.  whole, length : when the step or the piece of
    one begins of which it is a part, and its length, where steps are cut.
    """

    kind: float
    t: float
    h: float
    injected: float = 0.0
    momenta: float = 0.0
    elements: float = 0.0
    begin: float = 0.0
    end: float = 0.0
    last: float = 0.0
    whole: float = 0.0
    length: float = 0.0


@record
class Question(Record):
    """A question to an energy in a step: its derivative along `along` at a place, at a time.

    place : the momentum of the site, or its element.
    """

    t: float
    place: Any
    along: Vec


@record
class Back(Record):
    """J^T w of a part of a step, and where the Hamiltonian and the potential were asked: d/dp of the
    sums of D_along H and of D_along V is the derivative by their parameter p.
    """

    w: Any
    momenta: tuple[Question, ...]
    elements: tuple[Question, ...]


@record
class SiteMotion(Record):
    """A part of a step that has a way back, of one site; abstract.

    A subclass writes `moved`; where that is not all that J^T w needs, it writes `back` too.
    joins : do two in turn make one of the sum of their lengths?  together : is it one of all bodies of a linkage, which has
    methods `move` and `go_back`?

    Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2.
    """

    joins = False
    together = False

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The state after the part of the step, from the one before."""
        raise undefined(self, "moved")

    def back(self, system: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """J^T w.  w : components at the state after it, as a state."""
        w, notes = pulled_back(self.moved, group_of(system), (system, part), before, w)
        momenta = [Question(*rest) for kind, *rest in notes if kind == "momenta"]
        return Back(w, tuple(momenta), tuple([Question(*rest) for kind, *rest in notes if kind == "elements"]))


def questions(motion: SiteMotion, system: Any, state: Any, h: float) -> tuple[int, int]:
    """How often a part of a step asks energies of momenta, and potentials: those that a site without neighbours asks.

    state : of one site.  Raises IncompatibleSystem where there is no way back.
    """
    if isinstance(motion, (FieldTurn, BondTurn)):  # turns of a colour; bonds make theirs without a velocity
        return (1, 0) if isinstance(motion, FieldTurn) else (0, 0)
    answers: list[Back] = []

    def one_asks() -> None:
        alone = at_this_site(system)
        alone = with_records(alone, TermsOfSite, [_without_neighbours(x) for x in records_in(alone, TermsOfSite)])
        parts = {name: part for name, part in fields_of(state).items() if part is not None}
        still = vec(*[0.0 for _ in range(group_of(system).dim)])
        w = with_fields(state, **{name: still if name == "g" else 0.0 * part for name, part in parts.items()})
        answers.append(motion.back(alone, StepPart(0.0, 0.0, h), state, state, w))

    each_site(1, one_asks)
    return len(answers[0].momenta), len(answers[0].elements)


def _without_neighbours(terms: Any) -> Any:
    """The terms of a site that are of this site alone."""
    lone = with_fields(terms, roles=tuple([role for role in terms.roles if role.alone]))
    backwards = getattr(terms, "backwards", None)  # of a load, with the terms of the others
    return lone if backwards is None else with_fields(lone, backwards=_without_neighbours(backwards))


@record
class WholeStep(SiteMotion):
    """A step of a method in one piece, of the system or, `drifts`, of the body without its field."""

    method: Any
    drifts: bool = False

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The step, which knows of no step before it."""
        method, system = self.method, system.body if self.drifts else system
        return method.observe(method.step(system, part.t, method.start(system, state, part.h), part.h))


@record
class Symplectic(WholeStep):
    """A step of a method that is symmetric, and symplectic on T*G:  J^T = Omega J^-1 Omega^-1, with the step of
    length -h.

    Source: Hairer, Lubich, Wanner, VI.4; Abraham and Marsden, Foundations of Mechanics, 2nd ed.,
    proposition 4.4.1.
    """

    def inverse(self, part: StepPart) -> StepPart:
        """The part of length -h that leads back."""
        return with_fields(part, t=part.t + part.h, h=-part.h)

    def back(self, system: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """J^T w = Omega J^-1 Omega^-1 w, by the step of length -h of all sites: no energy is asked at an element."""
        inverse = self.inverse(part)
        return Back(carried_back(group_of(system), lambda x: self.moved(system, inverse, x), before, after, w), (), ())


def parts_of(method: Any, site: Any) -> tuple[tuple[SiteMotion, ...], list[tuple[int, float, float]]]:
    """The motions that a step is made of; of each part in turn which it is, when it begins and how long
    it is, as shares of the step.
    """
    if steps_as(method, Composition):
        motions, inner = parts_of(method.base, site)
        rows = [
            (k, node + share * begin, share * length)
            for share, node in zip(method.tableau.gamma, method.tableau.nodes)
            for k, begin, length in inner
        ]
        return motions, rows
    if steps_as(method, FieldSplitting, SeparableSplitting):
        splitting: Any = method
        tableau, in_a_field = splitting.tableau, isinstance(method, FieldSplitting)
        drift = Symplectic if in_a_field and is_symplectic(splitting.free) else WholeStep
        free: Any = drift(splitting.free, True) if in_a_field else PointFlow(True)
        nodes = tableau.nodes if in_a_field else [0.0 for _ in tableau.kicks]
        loaded = in_a_field and site.load is not None
        last, rows = len(tableau.drifts), []
        for i, b in enumerate(tableau.kicks):
            if b != 0.0 and loaded:
                part = 0.5 * b if 0 < i < last else b
                rows += [(2, nodes[i], part)] if i > 0 else []
                rows += [(0, nodes[i], part)] if i < last else []
            elif b != 0.0:
                rows += [(0, nodes[i], b)]
            rows += [(1, nodes[i], tableau.drifts[i])] if i < last else []
        if not in_a_field:
            return (PointFlow(), free), rows
        return (Kick(splitting, not loaded), free, *([Kick(splitting, False, True)] if loaded else [])), rows
    held = [x for x in records_in(site, TermsOfSite) if x.moves is not None]
    kind = Symplectic if steps_as(method, LiePoissonHamiltonJacobi) and not held else WholeStep
    return (kind(method),), [(0, 0.0, 1.0)]


def asks_whole_energies(method: Any) -> bool:
    """Whether steps depend on the energies by the velocity, the force and the load of the system alone."""
    if steps_as(method, FieldSplitting):
        return is_symplectic(method.free) or asks_whole_energies(method.free)
    known = RKMK, CommutatorFree, ImplicitMidpoint, SeparableSplitting, TermSplitting
    return asks_whole_energies(method.base) if steps_as(method, Composition) else steps_as(method, *known)


def is_symplectic(free: Any) -> bool:
    """Whether a drift goes back by its own step of length -h: one on T*G that is not found direction by direction."""
    return free.symplectic and free.symmetric and not free.of_momenta


# ------------------------------------------------------------------ kicks and drifts


@record
class Kick(SiteMotion):
    """mu + h (f + F) with g at rest: a load F as it is before the kick, or, of one that ends a
    drift, as it is after it.

    Source: Marsden and West, Acta Numerica 10 (2001), section 3.2.
    """

    method: FieldSplitting
    joins: bool
    ends: bool = False

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The state after the kick, mu + h (f + F)."""
        force, ends = system.force(state.g), self.ends
        return self.method._kick(system, part.t, state, force, part.h, ends, not ends, part.h)


def carried_back(group: Any, inverse: Any, before: Any, after: Any, w: Any) -> BodyState:
    """J^T w = Omega J^-1 Omega^-1 w of a symplectic map of T*G, whose inverse is known and takes elements
    k g as it takes g: they begin at the identity, whether or not they are known.
    """
    change = group.ad_star(w.mu, after.mu)
    change = change if w.g is None else change - w.g
    still = group.exp(0.0 * after.mu)

    def returned(e: float) -> BodyState:
        return inverse(BodyState(after.mu + e * change, group.compose_exp(still, e * w.mu)))

    begun, slope = carried(returned, 0.0)
    eta = group.body_velocity(begun.g, slope.g)
    return BodyState(eta, None if w.g is None else group.ad_star(eta, before.mu) - slope.mu)


@record
class PointFlow(SiteMotion):
    """The flow of the potential of a point, p + h f(q), or, `drifts`, of its kinetic energy, q + h v(p).

    Source: Hairer, Lubich, Wanner, I.1.4.
    """

    joins = True

    drifts: bool = False

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The point after the flow, (q, p + h f) or (q + h v, p)."""
        q, p = state.q, state.p
        if self.drifts:
            return CanonicalState(q + part.h * system.velocity(q, p), p)
        return CanonicalState(q, p + part.h * system.force(q, p))


# ------------------------------------------------------------------ turns


@record
class BondTurn(Symplectic):
    """The two sites of every bond of one colour turned about their sum, or all sites by a term of one: the
    exact motion of its energy, whose inverse is that of the time -h.

    method : the energy of a site, `BondsOfSite` or terms of single sites.  The colour is `begin` of the part.

    Source: Steinigeweg and Schmidt, Comput. Phys. Commun. 174 (2006).
    """

    joins = True

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        return turned_by(self.method, system.group, int(part.begin), part.t, part.h, state)

    def inverse(self, part: StepPart) -> StepPart:
        return with_fields(part, h=-part.h)


@record
class FieldTurn(SiteMotion):
    """The sites of one colour, or all of them, turned about the velocities that an energy gives them, while
    the others rest.  Backwards first those that turn feel their own turn, and then others what they
    have been turned by.

    energy : of a site.

    Source: Frank, Huang and Leimkuhler, J. Comput. Phys. 133 (1997).
    """

    joins = True

    energy: Any

    def omega(self, part: StepPart, mu: Vec) -> Vec:
        """The displacement of a site that turns."""
        return part.h * at_this_site(at_time(self.energy, part.t)).gradient(mu)

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The state of a site after its turn by h dH/dmu."""
        return turned_by(self.energy, system.group, 0, part.t, part.h, state)

    def of_turned(self, system: Any, part: StepPart, before: Any, w: Any) -> tuple[Any, Vec]:
        """J^T w of its own turn, and the direction along which the energy was asked."""
        (w, bent), _ = system._displaced_back(Exponential(), before, self.omega(part, before.mu), w)
        return w, moving(self.energy, part.h * bent)

    def of_others(self, part: StepPart, mu: Vec, along: Vec) -> Vec:
        """The derivative by the momentum of a site that others turn by.  along : its own direction."""
        energy = at_this_site(at_time(self.energy, part.t))
        return derivative(lambda m: energy._free(m), mu, along)
