"""Steps backwards: how a function of the state after a step depends on the state before it, and on
what the energy was asked for in between.

A step F has the derivative J; a function of the state after it has there the derivative w.  As a
function of the state before it, it has J^T w.  Components are those of tangent maps: w_mu belongs to
changes of the momentum and lies in the algebra, w_g to eta with dg = g hat(eta), and lies in its dual.

Of a displacement mu_1 = Ad*_tau(omega) mu, g_1 = g tau(omega),

    (J^T w)_mu = Ad_tau w_mu,   (J^T w)_g = Ad*_(tau^-1) w_g,   (J^T w)_omega = dtau*_omega (w_g - ad*_(w_mu) mu_1).

Of the velocity xi = dH/dmu and the force <f, eta> = -dV(g eta), which ask all sites, products with
the transposed derivative are derivatives along a direction again, as second derivatives commute:

    (d xi)^T lambda = D_lambda dH/dmu,      (d f)^T lambda = D_lambda f - ad*_lambda f.

The second one is not symmetric, as left-invariant fields do not commute.  A load F(xi, g) has no
symmetric derivative: (d F)^T lambda is the derivative of the sum of <lambda, F> over all sites, edge by
edge.  What an equation has determined is the solution of the transposed equation backwards, found
as it was, by sweeps over all sites.  A parameter p of the energy
has the derivative d/dp D_lambda H, and -d/dp D_lambda V.  Of a symplectic map with the form
Omega((dmu, eta), .) = (eta, ad*_eta mu - dmu) on T*G it is  J^T = Omega J^-1 Omega^-1:  one direction
carried back by the step of length -h of a symmetric method.

Source: Sanz-Serna, SIAM Review 58 (2016), Symplectic Runge-Kutta schemes for adjoint equations;
Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2 (the reverse mode); for the form
Abraham and Marsden, Foundations of Mechanics, 2nd ed., proposition 4.4.1.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import NoConvergence, undefined
from ...formulas import (
    Mat,
    Record,
    Vec,
    cross,
    derivative,
    dot,
    gradient,
    identity_matrix,
    jacobian,
    plain,
    record,
    sqrt,
    vec,
)
from ...formulas.classes.nested import records_in, with_records
from ...formulas.classes.records import with_fields
from ...formulas.derivatives import carried, tangent
from ...groups.retractions import Cayley, Exponential
from ...groups.rigid.so3 import SO3
from ...integrators.commutator_free import CommutatorFree
from ...integrators.composition import Composition
from ...integrators.free_body.midpoint import ImplicitMidpoint
from ...integrators.kicks.kick_drift import FieldSplitting
from ...integrators.method import Method
from ...integrators.rkmk import RKMK, combination
from ...integrators.separable import SeparableSplitting
from ...solvers import fixed_point, newton
from ...systems.canonical import CanonicalState
from ...systems.in_time.driven import DrivenLiePoissonSystem
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.many.energies import moving
from ...systems.mechanical import MechanicalSystem
from ..hamilton_jacobi.lie_poisson_hj import LiePoissonHamiltonJacobi
from ..sites.parts_of_spins import turned_by
from ..sites.separable_sites import SeparableSite
from ..sites.spin_splittings import TermSplitting
from ..sites.terms.terms import at_time
from ..sites.terms.terms_at_site import SlopesOfLoad, TermsOfSite, at_this_site


@record
class StepPart(Record):
    """A part of a step, all numbers: which of the `SiteMotion`s it is, when it begins, and how long it is.

    given : is a derivative by the state before it given?  momenta, elements : of what is kept of the
    energies that were asked, the row of the first.  begin, end : the places of the sites that turn, or
    begin is the colour of bonds, last : behind the last place.  whole, length : when the step or the piece of
    one begins of which it is a part, and its length, where steps are cut.
    """

    kind: float
    t: float
    h: float
    given: float = 0.0
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

    momenta, elements : how often it asks energies, `Back`.  A subclass writes `moved` and `back`.
    joins : do two in turn make one of the sum of their lengths?

    Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2.
    """

    joins: ClassVar[bool] = True  # as kicks and turns do

    @property
    def momenta(self) -> int:
        """How often it asks energies of momenta."""
        return 0

    @property
    def elements(self) -> int:
        """How often it asks potentials."""
        return 0

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The state after it."""
        raise undefined(self, "moved")

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """J^T w.  free : the system with held sites `released`.  w : components at the state after it,
        as a state.
        """
        raise undefined(self, "back")


@record
class WholeStep(SiteMotion):
    """A step of a method in one piece; abstract.  A subclass writes `momenta` and `back`.

    in_a_field : are there potentials, which are asked as often as energies of momenta?

    Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2.
    """

    joins: ClassVar[bool] = False

    method: Any
    in_a_field: bool = False

    @property
    def elements(self) -> int:
        """As often as energies of momenta, in a field."""
        return self.momenta if self.in_a_field else 0

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The step."""
        return fresh(self.method, system, part.t, state, part.h)


def refused(method: Any, site: Any) -> str:
    """Why the steps of a method have no way back here; empty if they have one.  site : the form of the
    system at one site.
    """
    if not isinstance(site, (LiePoissonSystem, DrivenLiePoissonSystem, MechanicalSystem, SeparableSite)):
        return f"of a {type(site).__name__}"
    if isinstance(site, MechanicalSystem) and site.in_space:
        return "with momenta that are added up in space"
    if isinstance(method, (RKMK, CommutatorFree)):
        return ""
    if isinstance(method, ImplicitMidpoint):
        alone = isinstance(site, LiePoissonSystem) and isinstance(site.group, SO3)
        return "" if alone else f"by {method!r} but of rotations"
    if isinstance(method, Composition):
        return refused(method.base, site)
    if isinstance(method, FieldSplitting):
        free: Any = method.free
        known = free.symplectic and free.symmetric and not free.of_momenta
        return "" if known or isinstance(free, RKMK) else f"by drifts of {free!r}"
    if isinstance(method, TermSplitting):
        return ""
    if isinstance(method, LiePoissonHamiltonJacobi):
        held = [x for x in records_in(site, TermsOfSite) if x.moves is not None]
        return f"by {method!r} with sites that are held" if held else ""
    return "" if isinstance(method, SeparableSplitting) else f"by {method!r}"


def released(site: Any, slopes: Any = None) -> Any:
    """A site form with sites that are held free to move: others feel them.  slopes : in place of the
    load, what it needs backwards.
    """
    terms = records_in(site, TermsOfSite)
    found = with_records(site, TermsOfSite, [with_fields(x, moves=None) for x in terms])
    return found if slopes is None else with_fields(found, load=slopes)


def parts_of(method: Any, site: Any) -> tuple[tuple[SiteMotion, ...], list[tuple[int, float, float]]]:
    """The motions that a step is made of; of each part in turn which it is, when it begins and how long
    it is, as shares of the step.
    """
    if isinstance(method, Composition):
        motions, inner = parts_of(method.base, site)
        rows = [
            (k, node + share * begin, share * length)
            for share, node in zip(method.tableau.gamma, method.tableau.nodes)
            for k, begin, length in inner
        ]
        return motions, rows
    if isinstance(method, (FieldSplitting, SeparableSplitting)):
        given: Any = method
        tableau, in_a_field = given.tableau, isinstance(method, FieldSplitting)
        free: Any = FreeDrift(given.free) if in_a_field else PointDrift()
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
        if loaded:
            return (LoadedKick(given), free, LoadedKick(given, True)), rows
        return (Kick() if in_a_field else PointKick(), free), rows
    whole: Any = RungeKutta(method, isinstance(site, MechanicalSystem))
    if isinstance(method, CommutatorFree):
        whole = Flows(method, isinstance(site, MechanicalSystem))
    if isinstance(method, ImplicitMidpoint):
        whole = Mean(method)
    if isinstance(method, LiePoissonHamiltonJacobi):
        whole = Symplectic(method)
    return (whole,), [(0, 0.0, 1.0)]


def fresh(method: Method, system: Any, t: float, state: Any, h: float) -> Any:
    """The state after a step that knows of no step before it."""
    return method.observe(method.step(system, t, method.start(system, state, h), h))


# ------------------------------------------------------------------ Runge-Kutta


@record
class RungeKutta(WholeStep):
    """A step of a Runge-Kutta-Munthe-Kaas method.  Backwards, with k_i for w_k_i,

        k_i = h b_i w_Omega + h sum_j a_ji w_Omega_j,

    from the last one to the first, or, of an implicit tableau, by sweeps until they settle.

    Source: Sanz-Serna, SIAM Review 58 (2016), section 3; Hairer, Lubich, Wanner, algorithm IV.8.4.
    """

    method: RKMK

    @property
    def momenta(self) -> int:
        """Once in every stage that counts."""
        return len(self.stages)

    @property
    def stages(self) -> tuple[int, ...]:
        """The stages on which the step depends, last ones first."""
        tableau, felt = self.method.tableau, []  # type: Any, list[int]
        if not tableau.explicit:
            return tuple(range(len(tableau.b)))
        for i in range(len(tableau.b) - 1, -1, -1):
            if tableau.b[i] != 0.0 or any(
                j < len(tableau.A) and i < len(tableau.A[j]) and tableau.A[j][i] != 0.0 for j in felt
            ):
                felt.append(i)
        return tuple(felt)

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """The stages once more, and then backwards."""
        method, t, h = self.method, part.t, part.h
        tableau, start = method.tableau.bare, plain(system.essential_part(before))
        if not tableau.explicit:
            return self._back_by_sweeps(system, free, part, before, start, w)
        slopes: list[Vec] = []
        found: list[Any] = []
        for row, c in zip(tableau.A, tableau.c):
            omega = combination(row, slopes, h)
            place = start if omega is None else system.displaced(method.retraction, start, omega)
            xi = system.rate(t + c * h, place)
            slopes = [*slopes, xi if omega is None else method.in_chart(system, omega, xi)]
            found = [*found, (omega, place, xi)]
        omega = combination(tableau.b, slopes, h)
        w, bent = _displaced(method.retraction, system, before, omega, w)
        felt: list[Any] = [None if b == 0.0 else (b * h) * bent for b in tableau.b]
        momenta: list[Question] = []
        elements: list[Question] = []
        for i in range(len(found) - 1, -1, -1):
            if felt[i] is not None:
                omega, place, xi = found[i]
                along, now = felt[i], t + tableau.c[i] * h
                chart: Any = None
                if omega is not None:
                    along, chart = self._in_chart(system, omega, xi, along)
                there, of_momenta, of_elements = _rate(system, free, now, place, along)
                momenta, elements = [*momenta, *of_momenta], [*elements, *of_elements]
                if omega is not None:
                    there, more = _displaced(method.retraction, system, start, omega, there)
                    felt = _combined(felt, tableau.A[i], chart + more, h)
                w = BodyState(w.mu + there.mu, w.g if there.g is None else w.g + there.g)
        return Back(w, tuple(momenta), tuple(elements))

    def _back_by_sweeps(self, system: Any, free: Any, part: StepPart, before: Any, start: Any, w: Any) -> Back:
        """That of an implicit tableau."""
        method, t, h = self.method, part.t, part.h
        tableau = method.tableau.bare
        slopes = method._slopes(tableau, system, t, start, system.rate(t, start), h)
        omegas = [combination(row, slopes, h) for row in tableau.A]
        w, bent = _displaced(method.retraction, system, before, combination(tableau.b, slopes, h), w)
        found: list[Any] = []
        for omega, c in zip(omegas, tableau.c):
            place = start if omega is None else system.displaced(method.retraction, start, omega)
            found = [*found, (place, system.rate(t + c * h, place))]
        stages = range(len(found))

        def of_stage(i: int, felt: Vec) -> Any:
            omega, (place, xi) = omegas[i], found[i]
            now, along, chart = t + tableau.c[i] * h, felt, None  # type: Any, Any, Any
            if omega is not None:
                along, chart = self._in_chart(system, omega, xi, felt)
            there, momenta, elements = _rate(system, free, now, place, along)
            if omega is not None:
                there, more = _displaced(method.retraction, system, start, omega, there)
                chart = chart + more
            return there, chart, momenta, elements

        def sweep(felt: list[Vec]) -> tuple[list[Vec], float, float]:
            charts = [of_stage(i, felt[i])[1] for i in stages]
            new = [
                _sum((b * h) * bent, combination(tuple([row[i] for row in tableau.A]), charts, h))
                for i, b in enumerate(tableau.b)
            ]
            change = size = 0.0
            for x, y in zip(new, felt):
                change, size = change + dot(x - y, x - y), size + dot(x, x)
            return new, sqrt(change), sqrt(size)

        felt = fixed_point(sweep, [(b * h) * bent for b in tableau.b], method, h)
        momenta: list[Question] = []
        elements: list[Question] = []
        for i in stages:
            there, _, of_momenta, of_elements = of_stage(i, felt[i])
            momenta, elements = [*momenta, *of_momenta], [*elements, *of_elements]
            w = BodyState(w.mu + there.mu, w.g if there.g is None else w.g + there.g)
        return Back(w, tuple(momenta), tuple(elements))

    def _in_chart(self, system: Any, omega: Vec, xi: Vec, felt: Vec) -> tuple[Vec, Vec]:
        """The derivatives by the velocity of a stage and by its Omega, of that by its slope."""
        slope = self.method.in_chart
        return (
            gradient(lambda x: dot(felt, slope(system, omega, x)), xi),
            gradient(lambda x: dot(felt, slope(system, x, xi)), omega),
        )


def _sum(x: Vec, more: Any) -> Vec:
    """x, and more if there is any."""
    return x if more is None else x + more


def _combined(felt: list[Any], row: Any, bent: Vec, h: float) -> list[Any]:
    """The derivatives by all slopes, with those of a stage that a row has made of them."""
    more = [*row, *[0.0 for _ in range(len(felt) - len(row))]]
    return [x if a == 0.0 else (a * h) * bent if x is None else x + (a * h) * bent for x, a in zip(felt, more)]


def _displaced(retraction: Any, system: Any, state: Any, omega: Vec, w: Any) -> tuple[BodyState, Vec]:
    """J^T w of a displacement, by the state and by omega."""
    if not isinstance(system, MechanicalSystem):
        group = system.group
        h, mu = retraction.tau(group, omega), retraction.tau_Ad_star(group, omega, state.mu)
        bent = -group.ad_star(w.mu, mu) if w.g is None else w.g - group.ad_star(w.mu, mu)
        there = BodyState(group.Ad(h, w.mu), None if w.g is None else group.K(h, w.g))
        return there, retraction.dtau_dual(group, omega, bent)
    group, new = system.configurations, system.displaced(retraction, state, omega)
    h = group.compose(group.inverse(state.g), new.g)
    changes = [
        derivative(lambda x: system.displaced(retraction, state, x), omega, unit)
        for unit in identity_matrix(len(omega))
    ]
    bent = vec(*[dot(w.mu, x.mu) + dot(w.g, group.body_velocity(new.g, x.g)) for x in changes])
    return BodyState(group.Ad(h, w.mu), group.K(h, w.g)), bent


def _rate(system: Any, free: Any, t: float, place: Any, along: Vec) -> Any:
    """The transposed derivative of the velocity of a system, and where energies were asked."""
    if not isinstance(system, MechanicalSystem):
        along = moving(system.hamiltonian, along)
        mu = derivative(lambda m: free.rate(t, BodyState(m, None)), place.mu, along)
        return BodyState(mu, None), [Question(t, place.mu, along)], []
    n = system.configurations.dim
    xi, turned = vec(*along[:n]), vec(*along[n:])
    kick, asked = _force(system, free, t, place.g, turned)
    if system.load is not None:
        by_xi, more = _load(system, free, t, place, turned)
        xi, kick = xi + by_xi, kick + more
    mu = derivative(lambda m: system.velocity(m, t), place.mu, xi)
    return BodyState(mu, kick), [Question(t, place.mu, xi)], [asked]


def _load(system: Any, free: Any, t: float, place: Any, along: Vec) -> tuple[Vec, Vec]:
    """The derivatives of the sum over all sites of <lambda, F> by the velocity and the element of this
    one.
    """
    group, xi, slopes = system.configurations, system.velocity(place.mu, t), free.load
    along = moving(system.load, along)
    if isinstance(slopes, SlopesOfLoad):
        return slopes.slopes(group, t, xi, place.g, along)
    still = vec(*[0.0 for _ in along])
    return (
        gradient(lambda x: dot(along, slopes.covector(t, x, place.g)), xi),
        gradient(lambda x: dot(along, slopes.covector(t, xi, group.compose_exp(place.g, x))), still),
    )


def _force(system: Any, free: Any, t: float, g: Any, along: Vec) -> tuple[Vec, Question]:
    """That of the force: D_lambda f - ad*_lambda f."""
    group = system.configurations
    along = moving(system.potential, along)
    still = vec(*[0.0 for _ in along])
    force, slope = tangent(lambda x: free.force(group.compose_exp(g, x)), still, along)
    return slope - group.ad_star(along, force), Question(t, g, -along)


# ------------------------------------------------------------------ flows, and midpoints


@record
class Flows(WholeStep):
    """A step of a commutator-free method: from stage to stage by flows with frozen velocities, and
    backwards through the flows to each stage, the last one first, each of which is a displacement.

    Source: Celledoni, Marthinsen, Owren, Future Gener. Comput. Syst. 19 (2003); Griewank and Walther,
    section 3.2.
    """

    method: CommutatorFree

    @property
    def momenta(self) -> int:
        """Once in every stage."""
        return self.method.tableau.stages

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """The flows once more, and then backwards."""
        data, t, h, exponential = self.method.tableau, part.t, part.h, Exponential()
        place, places, slopes, flows = before, [], [], []  # type: Any, list[Any], list[Any], list[Any]
        stages = zip(data.c, data.flows[1:], data.origins[1:], data.main[1:])
        for c, rows, origin, main in stages:
            places = [*places, place]
            slopes = [*slopes, system.rate(t + c * h, system.essential_part(place))]
            place = places[origin] if main else system.essential_part(places[origin])
            gone: list[Any] = []
            for row in rows:
                omega = combination(row, slopes, h)
                gone = [*gone, (row, place, omega)]
                place = system.displaced(exponential, place, omega)
            flows = [*flows, gone]
        felt: list[Any] = [None for _ in slopes]
        at: list[Any] = [*[None for _ in slopes], w]
        momenta: list[Question] = []
        elements: list[Question] = []
        for i in range(len(flows) - 1, -1, -1):
            there = at[i + 1]
            for row, begin, omega in flows[i][::-1]:
                there, bent = _displaced(exponential, system, begin, omega, there)
                felt = _combined(felt, row, bent, h)
            at = _put(at, data.origins[i + 1], there)
            start = system.essential_part(places[i])
            there, of_momenta, of_elements = _rate(system, free, t + data.c[i] * h, start, felt[i])
            at = _put(at, i, there)
            momenta, elements = [*momenta, *of_momenta], [*elements, *of_elements]
        return Back(at[0], tuple(momenta), tuple(elements))


def _put(at: list[Any], k: int, more: Any) -> list[Any]:
    """Derivatives by the states of stages, with more by that of stage k."""
    old = at[k]
    new = more if old is None else BodyState(old.mu + more.mu, _both(old.g, more.g))
    return [new if i == k else x for i, x in enumerate(at)]


def _both(x: Any, y: Any) -> Any:
    return y if x is None else x if y is None else x + y


@record
class Mean(WholeStep):
    """A step of a midpoint rule of rotations, mu_1 = Ad*_cay(x) mu by x = x(m, mu), where m is the mean
    of both.  Backwards, with w_x of the displacement and lambda = w_x - nu x m/2,

        nu = (x x nu)/2 - (dx/dm)^T lambda,   (J^T w)_mu = Ad_cay w_mu + (dx/dmu)^T lambda - nu.

    Source: McLachlan, Modin, Verdier, Phys. Rev. E 89 (2014).
    """

    method: ImplicitMidpoint
    momenta = 1

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """By sweeps over all sites."""
        mu, h, method = before.mu, part.h, self.method
        m = 0.5 * (mu + after.mu)
        place = method.asked(m, mu)
        xi = system.velocity(place)

        def by_both(along: Vec) -> tuple[Vec, Vec]:
            bent = moving(system.hamiltonian, method.stretch(m, mu) * along)
            slope = h * derivative(lambda p: free.velocity(p), place, bent)

            def sensed(m: Vec, mu: Vec) -> float:
                there = method.asked(m, mu)
                return (h * method.stretch(m, mu)) * dot(along, xi) + dot(slope, there)

            return gradient(lambda x: sensed(x, mu), m), gradient(lambda x: sensed(m, x), mu)

        x = method.turn(system, h, m, mu)
        w, bent = _displaced(Cayley(), system, before, x, w)

        def sweep(nu: Vec) -> tuple[Vec, float, float]:
            new = 0.5 * cross(x, nu) - by_both(bent - 0.5 * cross(nu, m))[0]
            return new, sqrt(dot(new - nu, new - nu)), sqrt(dot(new, new) + dot(w.mu, w.mu))

        nu = fixed_point(sweep, 0.0 * mu, method, h)
        along = bent - 0.5 * cross(nu, m)
        more = by_both(along)[1] - nu
        asked = moving(system.hamiltonian, (h * method.stretch(m, mu)) * along)
        return Back(BodyState(w.mu + more, w.g), (Question(part.t, place, asked),), ())


@record
class Symplectic(WholeStep):
    """A step of a method that is symmetric, and symplectic on T*G:  J^T = Omega J^-1 Omega^-1, with the step of
    length -h.

    Source: Hairer, Lubich, Wanner, VI.4; Abraham and Marsden, Foundations of Mechanics, 2nd ed.,
    proposition 4.4.1.
    """

    momenta: ClassVar[int] = 0

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """By the step backwards, of all sites."""
        back = lambda there: fresh(self.method, system, part.t + part.h, there, -part.h)  # noqa: E731
        return Back(carried_back(system.group, back, before, after, w), (), ())


# ------------------------------------------------------------------ kicks and drifts


@record
class Kick(SiteMotion):
    """mu + h f(g), with g at rest.

    Source: Hairer, Lubich, Wanner, II.5.
    """

    elements = 1

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The kick."""
        return BodyState(state.mu + part.h * system.force(state.g), state.g)

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """Only w_g changes."""
        kick, asked = _force(system, free, part.t, before.g, part.h * w.mu)
        return Back(BodyState(w.mu, w.g + kick), (), (asked,))


@record
class LoadedKick(SiteMotion):
    """mu + h (f + F) with g at rest: the load F as it is before the kick, or, of one that ends a
    drift, as it is after it.  There mu_1 = mu + h (f + F(mu_1)) has the transposed equation

        nu = w_mu + h (dF/dmu)^T nu,   (J^T w)_mu = nu,   (J^T w)_g = w_g + h (df + dF)^T nu.

    Source: Marsden and West, Acta Numerica 10 (2001), section 3.2.
    """

    joins: ClassVar[bool] = False

    method: FieldSplitting
    ends: bool = False
    momenta = 1  # for the velocity that the load feels
    elements = 1

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The kick."""
        force, ends = system.force(state.g), self.ends
        return self.method._kick(system, part.t, state, force, part.h, ends, not ends, part.h)

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """Where it is an equation, of one site by Newton's method, else by sweeps."""
        place = after if self.ends else before
        nu = self._solved(system, free, part, place, w.mu) if self.ends else w.mu
        kick, asked = _force(system, free, part.t, place.g, part.h * nu)
        by_xi, more = _load(system, free, part.t, place, part.h * nu)
        bent = derivative(lambda m: system.velocity(m, part.t), place.mu, by_xi)
        mu = nu if self.ends else nu + bent
        return Back(BodyState(mu, w.g + kick + more), (Question(part.t, place.mu, by_xi),), (asked,))

    def _solved(self, system: Any, free: Any, part: StepPart, place: Any, w: Vec) -> Vec:
        """nu, of all sites."""

        def bent(nu: Vec) -> Vec:
            by_xi, _ = _load(system, free, part.t, place, part.h * nu)
            return derivative(lambda m: system.velocity(m, part.t), place.mu, by_xi)

        def equation(nu: Vec) -> tuple[Vec, Mat, float]:
            return (nu - w - bent(nu), identity_matrix(len(w)) - jacobian(bent, nu), dot(nu, nu) + dot(w, w))

        def sweep(nu: Vec) -> tuple[Vec, float, float]:
            new = w + bent(nu)
            return new, sqrt(dot(new - nu, new - nu)), sqrt(dot(new, new))

        if system.load.coupled or system.body.hamiltonian.coupled:
            return fixed_point(sweep, w, self.method, part.h)
        nu, rest, enough, _ = newton(equation, w)
        if not rest <= enough:
            raise NoConvergence(
                f"{self.method!r}: the way back through the load at the end of a kick was not found; "
                f"try shorter steps than {part.h:g}"
            )
        return nu


@record
class FreeDrift(SiteMotion):
    """A step of the free body by a method that is symmetric and symplectic, or Runge-Kutta.

    Source: Hairer, Lubich, Wanner, II.5 and VI.4.
    """

    joins: ClassVar[bool] = False

    free: Any

    @property
    def momenta(self) -> int:
        """As often as Runge-Kutta does."""
        return RungeKutta(self.free).momenta if isinstance(self.free, RKMK) else 0

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The step."""
        return fresh(self.free, system.body, part.t, state, part.h)

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """J^T = Omega J^-1 Omega^-1."""
        if isinstance(self.free, RKMK):
            return RungeKutta(self.free).back(system.body, free.body, part, before, after, w)
        group, body = system.configurations, system.body
        back = lambda there: fresh(self.free, body, part.t + part.h, there, -part.h)  # noqa: E731
        return Back(carried_back(group, back, before, after, w), (), ())


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
class PointKick(SiteMotion):
    """p + h f(q), with q at rest.

    Source: Hairer, Lubich, Wanner, I.1.4.
    """

    elements = 1

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The kick."""
        return CanonicalState(state.q, state.p + part.h * system.force(state.q, state.p))

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """Only w_q changes."""
        along = moving(system.mass.potential, part.h * w.p)
        more = derivative(lambda q: free.force(q, before.p), before.q, along)
        return Back(CanonicalState(w.q + more, w.p), (), (Question(part.t, before.q, -along),))


@record
class PointDrift(SiteMotion):
    """q + h v(p), with p at rest.

    Source: Hairer, Lubich, Wanner, I.1.4.
    """

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The drift."""
        return CanonicalState(state.q + part.h * system.velocity(state.q, state.p), state.p)

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """Only w_p changes."""
        more = derivative(lambda p: system.velocity(before.q, p), before.p, part.h * w.q)
        return Back(CanonicalState(w.q, w.p + more), (), ())


# ------------------------------------------------------------------ turns


@record
class BondTurn(SiteMotion):
    """The two sites of every bond of one colour turned about their sum, or all sites by a term of one: the
    exact motion of its energy, whose inverse is that of the time -h.

    energy : of a site, `BondsOfSite` or terms of single sites.  The colour is `begin` of the part.

    Source: Steinigeweg and Schmidt, Comput. Phys. Commun. 174 (2006).
    """

    energy: Any

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """The turn."""
        return turned_by(self.energy, system.group, int(part.begin), part.t, part.h, state)

    def back(self, system: Any, free: Any, part: StepPart, before: Any, after: Any, w: Any) -> Back:
        """J^T = Omega J^-1 Omega^-1, where elements are known or not: nothing depends on them."""
        group, colour = system.group, int(part.begin)
        back = lambda there: turned_by(self.energy, group, colour, part.t, -part.h, there)  # noqa: E731
        return Back(carried_back(group, back, before, after, w), (), ())


@record
class FieldTurn(SiteMotion):
    """The sites of one colour, or all of them, turned about the velocities that an energy gives them, while
    the others rest.  Backwards first those that turn feel their own turn, and then others what they
    have been turned by.

    energy, released : of a site; with held sites free.

    Source: Frank, Huang and Leimkuhler, J. Comput. Phys. 133 (1997).
    """

    energy: Any
    released: Any
    momenta = 1

    def omega(self, part: StepPart, mu: Vec) -> Vec:
        """The displacement of a site that turns."""
        return part.h * at_this_site(at_time(self.energy, part.t)).gradient(mu)

    def moved(self, system: Any, part: StepPart, state: Any) -> Any:
        """A site that turns."""
        return turned_by(self.energy, system.group, 0, part.t, part.h, state)

    def of_turned(self, system: Any, part: StepPart, before: Any, w: Any) -> tuple[Any, Vec]:
        """J^T w of its own turn, and the direction along which the energy was asked."""
        omega = self.omega(part, before.mu)
        w, bent = _displaced(Exponential(), system, before, omega, w)
        return w, moving(self.energy, part.h * bent)

    def of_others(self, part: StepPart, mu: Vec, along: Vec) -> Vec:
        """The derivative by the momentum of a site that others turn by.  along : its own direction."""
        energy = at_this_site(at_time(self.released, part.t))
        return derivative(lambda m: energy.gradient(m), mu, along)
