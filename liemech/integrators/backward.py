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

from ..errors import IncompatibleSystem
from ..formulas import Record, Vec, derivative, dot, gradient, identity_matrix, plain, record, vec
from ..formulas.derivatives import tangent
from ..formulas.pytree import exchanged, inside, with_fields
from ..systems.canonical import CanonicalState
from ..systems.driven import DrivenLiePoissonSystem
from ..systems.lie_poisson import BodyState, LiePoissonSystem
from ..systems.mechanical import MechanicalSystem
from ..systems.separable_sites import SeparableSite
from ..systems.sums_of_terms import DrivenTerms
from ..systems.terms_at_site import TermsOfSite
from .composition import Composition
from .kick_drift import FieldSplitting
from .method import Method
from .rkmk import RKMK, combination
from .separable import SeparableSplitting


@record
class Asked(Record):
    """What an energy was asked for in a step: its derivative along `along` at a place, at a time.

    place : the momentum of the site, or its element.
    """

    t: float
    place: Any
    along: Vec


@record
class Back(Record):
    """J^T w of a step, and where the Hamiltonian and the potential were asked: d/dp of the sums of
    D_along H and of D_along V is the derivative by their parameter p.
    """

    w: Any
    momenta: tuple[Asked, ...]
    elements: tuple[Asked, ...]


def refused(method: Any, system: Any) -> str:
    """Why the steps of a method have no way back here; empty if they have one."""
    if not isinstance(
        system, (LiePoissonSystem, DrivenLiePoissonSystem, MechanicalSystem, SeparableSite)
    ):
        return f"of {type(system).__name__}"
    if isinstance(system, MechanicalSystem) and (system.load is not None or system.in_space):
        return "with a load, whose forces have no symmetric derivative"
    if isinstance(method, RKMK):
        return "" if method.tableau.explicit else "with an implicit tableau"
    if isinstance(method, Composition):
        return refused(method.base, system)
    if isinstance(method, FieldSplitting):
        free: Any = method.free  # type: ignore[attr-defined]
        known = free.symplectic and free.symmetric and not free.of_momenta
        return "" if known or isinstance(free, RKMK) else f"with drifts of {free!r}"
    return "" if isinstance(method, SeparableSplitting) else f"of {method!r}"


def released(site: Any) -> Any:
    """A site form with sites that are held free to move: others feel them."""
    terms = inside(site, TermsOfSite)
    return exchanged(site, TermsOfSite, [with_fields(x, moves=None) for x in terms])


def step_back(
    method: Any, system: Any, free: Any, t: float, state: Any, w: Any, h: float
) -> Back:
    """J^T w of a step from a state.  free : the system with held sites `released`.  w : components
    at the state after the step, as a state.
    """
    if isinstance(method, RKMK):
        return _rkmk(method, system, free, t, state, w, h)
    if isinstance(method, Composition):
        return _composition(method, system, free, t, state, w, h)
    if isinstance(method, FieldSplitting):
        return _kicks(method, system, free, t, state, w, h)
    if isinstance(method, SeparableSplitting):
        return _separable(method, system, free, t, state, w, h)
    raise IncompatibleSystem(f"{method!r} has no way back")


def fresh(method: Method, system: Any, t: float, state: Any, h: float) -> Any:
    """The state after a step that knows of no step before it."""
    return method.observe(method.step(system, t, method.start(system, state, h), h))


def moving(energy: Any, along: Vec) -> Vec:
    """A direction; zero at sites that are held."""
    if isinstance(energy, DrivenTerms):
        return moving(energy.at_zero, along)
    return energy.if_it_moves(along) if isinstance(energy, TermsOfSite) else along


# ------------------------------------------------------------------ Runge-Kutta


def _rkmk(
    method: RKMK, system: Any, free: Any, t: float, state: Any, w: Any, h: float
) -> Back:
    """The stages once more, and then backwards: with k_i for w_k_i,

        k_i = h b_i w_Omega + h sum_(j > i) a_ji w_Omega_j.
    """
    tableau, start = method.tableau.bare, plain(system.essential_part(state))
    slopes: list[Vec] = []
    found: list[Any] = []
    for row, c in zip(tableau.A, tableau.c):
        omega = combination(row, slopes, h)
        place = start if omega is None else system.displaced(method.retraction, start, omega)
        xi = system.rate(t + c * h, place)
        slopes = [*slopes, xi if omega is None else method.in_chart(system, omega, xi)]
        found = [*found, (omega, place, xi)]
    omega = combination(tableau.b, slopes, h)
    w, bent = _displaced(method.retraction, system, state, omega, w)
    felt: list[Any] = [None if b == 0.0 else (b * h) * bent for b in tableau.b]
    momenta: list[Asked] = []
    elements: list[Asked] = []
    for i in range(len(found) - 1, -1, -1):
        if felt[i] is not None:
            omega, place, xi = found[i]
            along, now = felt[i], t + tableau.c[i] * h
            if omega is not None:
                along = gradient(lambda x: dot(felt[i], method.in_chart(system, omega, x)), xi)
            there, of_momenta, of_elements = _rate(system, free, now, place, along)
            momenta, elements = [*momenta, *of_momenta], [*elements, *of_elements]
            if omega is not None:
                chart = gradient(lambda x: dot(felt[i], method.in_chart(system, x, xi)), omega)
                there, more = _displaced(method.retraction, system, start, omega, there)
                felt = _combined(felt, tableau.A[i], chart + more, h)
            w = _added(w, there)
    return Back(w, tuple(momenta), tuple(elements))


def _combined(felt: list[Any], row: Any, bent: Vec, h: float) -> list[Any]:
    """What slopes are told by a stage that a row has made of them."""
    more = [*row, *[0.0 for _ in range(len(felt) - len(row))]]
    return [
        x if a == 0.0 else (a * h) * bent if x is None else x + (a * h) * bent
        for x, a in zip(felt, more)
    ]


def _added(w: BodyState, more: BodyState) -> BodyState:
    return BodyState(w.mu + more.mu, w.g if more.g is None else w.g + more.g)


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
    bent = vec(
        *[dot(w.mu, x.mu) + dot(w.g, group.body_velocity(new.g, x.g)) for x in changes]
    )
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


# ------------------------------------------------------------------ splittings


def _composition(
    method: Composition, system: Any, free: Any, t: float, state: Any, w: Any, h: float
) -> Back:
    """The substeps once more, and then backwards."""
    base, tableau = method.base, method.tableau
    found: list[Any] = []
    for share, node in zip(tableau.gamma, tableau.nodes):
        found = [*found, (share * h, t + node * h, state)]
        state = fresh(base, system, t + node * h, state, share * h)
    momenta: list[Asked] = []
    elements: list[Asked] = []
    for part, time, before in found[::-1]:
        back = step_back(base, system, free, time, before, w, part)
        w = back.w
        momenta, elements = [*momenta, *back.momenta], [*elements, *back.elements]
    return Back(w, tuple(momenta), tuple(elements))


def _kicks(
    method: Any, system: Any, free: Any, t: float, state: BodyState, w: BodyState, h: float
) -> Back:
    """Kicks and drifts once more, and then backwards.  A kick feels w_g only: mu + c f(g)."""
    tableau, drifts = method.tableau, method.free
    ends = len(tableau.drifts)
    found: list[Any] = []
    for i in range(ends):
        time, drift = t + tableau.nodes[i] * h, tableau.drifts[i] * h
        if tableau.kicks[i] != 0.0:
            state = BodyState(state.mu + (tableau.kicks[i] * h) * system.force(state.g), state.g)
        after = fresh(drifts, system.body, time, state, drift)
        found = [*found, (time, drift, state, after)]
        state = after
    momenta: list[Asked] = []
    elements: list[Asked] = []
    for i in range(ends, -1, -1):
        place = found[i - 1][3].g if i else found[0][2].g
        if i < ends:
            time, drift, before, after = found[i]
            w, more = _drift(drifts, system.body, free.body, time, before, after, w, drift)
            momenta = [*momenta, *more]
        if tableau.kicks[i] != 0.0:
            share = (tableau.kicks[i] * h) * w.mu
            kick, asked = _force(system, free, t + tableau.nodes[i] * h, place, share)
            w, elements = BodyState(w.mu, w.g + kick), [*elements, asked]
    return Back(w, tuple(momenta), tuple(elements))


def _drift(
    drifts: Any, body: Any, free: Any, t: float, before: Any, after: Any, w: Any, h: float
) -> tuple[BodyState, tuple[Asked, ...]]:
    """J^T = Omega J^-1 Omega^-1 of a symmetric, symplectic step of the free body."""
    if isinstance(drifts, RKMK):
        back = _rkmk(drifts, body, free, t, before, w, h)
        return back.w, back.momenta
    group = body.group
    change = group.ad_star(w.mu, after.mu) - w.g

    def returned(e: float) -> BodyState:
        moved = BodyState(after.mu + e * change, group.compose_exp(after.g, e * w.mu))
        return fresh(drifts, body, t + h, moved, -h)

    slope = derivative(returned, 0.0)
    eta = group.body_velocity(before.g, slope.g)
    return BodyState(eta, group.ad_star(eta, before.mu) - slope.mu), ()


def _separable(
    method: Any, system: Any, free: Any, t: float, state: CanonicalState, w: Any, h: float
) -> Back:
    """p + b h f(q) and q + a h v(p) once more, and then backwards."""
    tableau = method.tableau
    q, p = state.q, state.p
    found: list[Any] = []
    for i, b in enumerate(tableau.kicks):
        found = [*found, q]
        if b != 0.0:
            p = p + (b * h) * system.force(q, p)
        found = [*found, p]
        if i < len(tableau.drifts):
            q = q + (tableau.drifts[i] * h) * system.velocity(q, p)
    elements: list[Asked] = []
    of_q, of_p, potential = w.q, w.p, system.mass.potential
    for i in range(len(tableau.kicks) - 1, -1, -1):
        q, p = found[2 * i], found[2 * i + 1]
        if i < len(tableau.drifts):
            along = (tableau.drifts[i] * h) * of_q
            of_p = of_p + derivative(lambda x: system.velocity(q, x), p, along)
        if tableau.kicks[i] != 0.0:
            along = moving(potential, (tableau.kicks[i] * h) * of_p)
            of_q = of_q + derivative(lambda x: free.force(x, p), q, along)
            elements = [*elements, Asked(t, q, -along)]
    return Back(CanonicalState(of_q, of_p), (), tuple(elements))
