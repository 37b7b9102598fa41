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

The second one is not symmetric, as left-invariant fields do not commute.  A parameter p of the energy
has the derivative d/dp D_lambda H, and -d/dp D_lambda V.  Of a symplectic map with the form
Omega((dmu, eta), .) = (eta, ad*_eta mu - dmu) on T*G it is  J^T = Omega J^-1 Omega^-1:  one direction
carried back by the step of length -h of a symmetric method.

Source: Sanz-Serna, SIAM Review 58 (2016), Symplectic Runge-Kutta schemes for adjoint equations;
Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2 (the reverse mode); for the form
Abraham and Marsden, Foundations of Mechanics, 2nd ed., proposition 4.4.1.
"""

from __future__ import annotations

from typing import Any

from ..errors import undefined
from ..formulas import (
    Record,
    Vec,
    derivative,
    dot,
    gradient,
    identity_matrix,
    plain,
    record,
    vec,
)
from ..formulas.derivatives import tangent
from ..formulas.pytree import exchanged, inside, with_fields
from ..retractions import Exponential
from ..systems.canonical import CanonicalState
from ..systems.driven import DrivenLiePoissonSystem
from ..systems.lie_poisson import BodyState, LiePoissonSystem
from ..systems.mechanical import MechanicalSystem
from ..systems.separable_sites import SeparableSite
from ..systems.sublattices import FieldAtSite, turned
from ..systems.sums_of_terms import DrivenTerms
from ..systems.terms import at_time
from ..systems.terms_at_site import TermsOfSite
from .composition import Composition
from .kick_drift import FieldSplitting
from .method import Method
from .rkmk import RKMK, combination
from .separable import SeparableSplitting
from .sublattices import SublatticeSplitting


@record
class Part(Record):
    """A part of a step, all numbers: which of the `Motion`s it is, when it begins, and how long it is.

    given : is a derivative by the state before it given?  momenta, elements : of what is kept of the
    energies that were asked, the row of the first.  begin, end : the places of the sites that turn,
    last : behind the last place.  term : what turns them.
    """

    kind: float
    t: float
    h: float
    given: float = 0.0
    momenta: float = 0.0
    elements: float = 0.0
    begin: float = 0.0
    end: float = 0.0
    term: float = 0.0
    last: float = 0.0


@record
class Asked(Record):
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
    momenta: tuple[Asked, ...]
    elements: tuple[Asked, ...]


@record
class Motion(Record):
    """A part of a step that has a way back, of one site; abstract.

    momenta, elements : how often it asks energies, `Back`.  A subclass writes `moved` and `back`.
    joins : do two in turn make one of the sum of their lengths?

    Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2.
    """

    @property
    def momenta(self) -> int:
        """How often it asks energies of momenta."""
        return 0

    @property
    def elements(self) -> int:
        """How often it asks potentials."""
        return 0

    @property
    def joins(self) -> bool:
        """Kicks and turns do."""
        return True

    def moved(self, system: Any, part: Part, state: Any) -> Any:
        """The state after it."""
        raise undefined(self, "moved")

    def back(self, system: Any, free: Any, part: Part, before: Any, after: Any, w: Any) -> Back:
        """J^T w.  free : the system with held sites `released`.  w : components at the state after it,
        as a state.
        """
        raise undefined(self, "back")


def refused(method: Any, site: Any) -> str:
    """Why the steps of a method have no way back here; empty if they have one.  site : the form of the
    system at one site.
    """
    if not isinstance(
        site, (LiePoissonSystem, DrivenLiePoissonSystem, MechanicalSystem, SeparableSite)
    ):
        return f"of a {type(site).__name__}"
    if isinstance(site, MechanicalSystem) and (site.load is not None or site.in_space):
        return "with a load, whose forces have no symmetric derivative"
    if isinstance(method, RKMK):
        return "" if method.tableau.explicit else f"by {method!r}, whose tableau is implicit"
    if isinstance(method, Composition):
        return refused(method.base, site)
    if isinstance(method, FieldSplitting):
        free: Any = method.free  # type: ignore[attr-defined]
        known = free.symplectic and free.symmetric and not free.of_momenta
        return "" if known or isinstance(free, RKMK) else f"by drifts of {free!r}"
    if isinstance(method, SublatticeSplitting):
        return ""
    return "" if isinstance(method, SeparableSplitting) else f"by {method!r}"


def released(site: Any) -> Any:
    """A site form with sites that are held free to move: others feel them."""
    terms = inside(site, TermsOfSite)
    return exchanged(site, TermsOfSite, [with_fields(x, moves=None) for x in terms])


def parts_of(method: Any, site: Any) -> tuple[tuple[Motion, ...], list[tuple[int, float, float]]]:
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
        free: Any = Drift(given.free) if in_a_field else PointDrift()
        nodes = tableau.nodes if in_a_field else [0.0 for _ in tableau.kicks]
        rows = []
        for i, b in enumerate(tableau.kicks):
            rows += [(0, nodes[i], b)] if b != 0.0 else []
            rows += [(1, nodes[i], tableau.drifts[i])] if i < len(tableau.drifts) else []
        return (Kick() if in_a_field else PointKick(), free), rows
    return (RungeKutta(method, isinstance(site, MechanicalSystem)),), [(0, 0.0, 1.0)]


def fresh(method: Method, system: Any, t: float, state: Any, h: float) -> Any:
    """The state after a step that knows of no step before it."""
    return method.observe(method.step(system, t, method.start(system, state, h), h))


def moving(energy: Any, along: Vec) -> Vec:
    """A direction; zero at sites that are held."""
    if isinstance(energy, DrivenTerms):
        return moving(energy.at_zero, along)
    return energy.if_it_moves(along) if isinstance(energy, TermsOfSite) else along


# ------------------------------------------------------------------ Runge-Kutta


@record
class RungeKutta(Motion):
    """A step of an explicit Runge-Kutta-Munthe-Kaas method.  Backwards, with k_i for w_k_i,

        k_i = h b_i w_Omega + h sum_(j > i) a_ji w_Omega_j.

    Source: Sanz-Serna, SIAM Review 58 (2016), section 3; Hairer, Lubich, Wanner, algorithm IV.8.4.
    """

    method: RKMK
    in_a_field: bool = False

    @property
    def joins(self) -> bool:
        """Two steps are no longer one."""
        return False

    @property
    def momenta(self) -> int:
        """Once in every stage that counts."""
        return len(self.stages)

    @property
    def elements(self) -> int:
        """As often, in a field."""
        return len(self.stages) if self.in_a_field else 0

    @property
    def stages(self) -> tuple[int, ...]:
        """The stages on which the step depends, last ones first."""
        tableau, felt = self.method.tableau, []  # type: Any, list[int]
        for i in range(len(tableau.b) - 1, -1, -1):
            if tableau.b[i] != 0.0 or any(
                j < len(tableau.A) and i < len(tableau.A[j]) and tableau.A[j][i] != 0.0
                for j in felt
            ):
                felt.append(i)
        return tuple(felt)

    def moved(self, system: Any, part: Part, state: Any) -> Any:
        """The step."""
        return fresh(self.method, system, part.t, state, part.h)

    def back(self, system: Any, free: Any, part: Part, before: Any, after: Any, w: Any) -> Back:
        """The stages once more, and then backwards."""
        method, t, h = self.method, part.t, part.h
        tableau, start = method.tableau.bare, plain(system.essential_part(before))
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
        momenta: list[Asked] = []
        elements: list[Asked] = []
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

    def _in_chart(self, system: Any, omega: Vec, xi: Vec, felt: Vec) -> tuple[Vec, Vec]:
        """The derivatives by the velocity of a stage and by its Omega, of that by its slope."""
        slope = self.method.in_chart
        return (
            gradient(lambda x: dot(felt, slope(system, omega, x)), xi),
            gradient(lambda x: dot(felt, slope(system, x, xi)), omega),
        )


def _combined(felt: list[Any], row: Any, bent: Vec, h: float) -> list[Any]:
    """The derivatives by all slopes, with those of a stage that a row has made of them."""
    more = [*row, *[0.0 for _ in range(len(felt) - len(row))]]
    return [
        x if a == 0.0 else (a * h) * bent if x is None else x + (a * h) * bent
        for x, a in zip(felt, more)
    ]


def _displaced(
    retraction: Any, system: Any, state: Any, omega: Vec, w: Any
) -> tuple[BodyState, Vec]:
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
        return BodyState(mu, None), [Asked(t, place.mu, along)], []
    n = system.configurations.dim
    xi = vec(*along[:n])
    kick, asked = _force(system, free, t, place.g, vec(*along[n:]))
    mu = derivative(lambda m: system.velocity(m, t), place.mu, xi)
    return BodyState(mu, kick), [Asked(t, place.mu, xi)], [asked]


def _force(system: Any, free: Any, t: float, g: Any, along: Vec) -> tuple[Vec, Asked]:
    """That of the force: D_lambda f - ad*_lambda f."""
    group = system.configurations
    along = moving(system.potential, along)
    still = vec(*[0.0 for _ in along])
    force, slope = tangent(lambda x: free.force(group.compose_exp(g, x)), still, along)
    return slope - group.ad_star(along, force), Asked(t, g, -along)


# ------------------------------------------------------------------ kicks and drifts


@record
class Kick(Motion):
    """mu + h f(g), with g at rest.

    Source: Hairer, Lubich, Wanner, II.5.
    """

    @property
    def elements(self) -> int:
        """Once."""
        return 1

    def moved(self, system: Any, part: Part, state: Any) -> Any:
        """The kick."""
        return BodyState(state.mu + part.h * system.force(state.g), state.g)

    def back(self, system: Any, free: Any, part: Part, before: Any, after: Any, w: Any) -> Back:
        """Only w_g changes."""
        kick, asked = _force(system, free, part.t, before.g, part.h * w.mu)
        return Back(BodyState(w.mu, w.g + kick), (), (asked,))


@record
class Drift(Motion):
    """A step of the free body by a method that is symmetric and symplectic, or Runge-Kutta.

    Source: Hairer, Lubich, Wanner, II.5 and VI.4.
    """

    free: Any

    @property
    def joins(self) -> bool:
        """Two steps are no longer one."""
        return False

    @property
    def momenta(self) -> int:
        """As often as Runge-Kutta does."""
        return RungeKutta(self.free).momenta if isinstance(self.free, RKMK) else 0

    def moved(self, system: Any, part: Part, state: Any) -> Any:
        """The step."""
        return fresh(self.free, system.body, part.t, state, part.h)

    def back(self, system: Any, free: Any, part: Part, before: Any, after: Any, w: Any) -> Back:
        """J^T = Omega J^-1 Omega^-1."""
        if isinstance(self.free, RKMK):
            return RungeKutta(self.free).back(system.body, free.body, part, before, after, w)
        group, body = system.configurations, system.body
        change = group.ad_star(w.mu, after.mu) - w.g

        def returned(e: float) -> BodyState:
            there = BodyState(after.mu + e * change, group.compose_exp(after.g, e * w.mu))
            return fresh(self.free, body, part.t + part.h, there, -part.h)

        slope = derivative(returned, 0.0)
        eta = group.body_velocity(before.g, slope.g)
        return Back(BodyState(eta, group.ad_star(eta, before.mu) - slope.mu), (), ())


@record
class PointKick(Motion):
    """p + h f(q), with q at rest.

    Source: Hairer, Lubich, Wanner, I.1.4.
    """

    @property
    def elements(self) -> int:
        """Once."""
        return 1

    def moved(self, system: Any, part: Part, state: Any) -> Any:
        """The kick."""
        return CanonicalState(state.q, state.p + part.h * system.force(state.q, state.p))

    def back(self, system: Any, free: Any, part: Part, before: Any, after: Any, w: Any) -> Back:
        """Only w_q changes."""
        along = moving(system.mass.potential, part.h * w.p)
        more = derivative(lambda q: free.force(q, before.p), before.q, along)
        return Back(CanonicalState(w.q + more, w.p), (), (Asked(part.t, before.q, -along),))


@record
class PointDrift(Motion):
    """q + h v(p), with p at rest.

    Source: Hairer, Lubich, Wanner, I.1.4.
    """

    def moved(self, system: Any, part: Part, state: Any) -> Any:
        """The drift."""
        return CanonicalState(state.q + part.h * system.velocity(state.q, state.p), state.p)

    def back(self, system: Any, free: Any, part: Part, before: Any, after: Any, w: Any) -> Back:
        """Only w_p changes."""
        more = derivative(lambda p: system.velocity(before.q, p), before.p, part.h * w.q)
        return Back(CanonicalState(w.q, w.p + more), (), ())


# ------------------------------------------------------------------ turns


@record
class Turn(Motion):
    """The sites of one colour, or all of them, turned about the velocities that a term gives them, while
    the others rest.  Backwards first those that turn feel their own turn, and then others what they
    have been turned by.

    field, released : of all sites, `FieldAtSite`; with held sites free.

    Source: Frank, Huang and Leimkuhler, J. Comput. Phys. 133 (1997).
    """

    field: FieldAtSite
    released: FieldAtSite

    @property
    def momenta(self) -> int:
        """Once."""
        return 1

    def omega(self, part: Part, mu: Vec) -> Vec:
        """The displacement of a site that turns."""
        return part.h * at_time(self.field, part.t).velocity(int(part.term), mu)

    def moved(self, system: Any, part: Part, state: Any) -> Any:
        """A site that turns."""
        return BodyState(*turned(system.group, state.mu, state.g, self.omega(part, state.mu)))

    def of_turned(self, system: Any, part: Part, before: Any, w: Any) -> tuple[Any, Vec]:
        """J^T w of its own turn, and the direction along which the energy was asked."""
        omega = self.omega(part, before.mu)
        w, bent = _displaced(Exponential(), system, before, omega, w)
        return w, moving(self.field.field, part.h * bent)

    def of_others(self, part: Part, mu: Vec, along: Vec) -> Vec:
        """The derivative by the momentum of a site that others turn by.  along : its own direction."""
        field = at_time(self.released, part.t)
        return derivative(lambda m: field.velocity(int(part.term), m), mu, along)
