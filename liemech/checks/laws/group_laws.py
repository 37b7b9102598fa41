"""The laws of a Lie group: its product, its exponential, its adjoint and coadjoint actions, its
arrays, its native code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.linalg import inv, norm, solve

from ...compiler import kernel
from ...formulas import Vec
from ...groups.lie_group import LieGroup
from ...integrators.rkmk import RKMK
from ...simulation.integrate import integrate
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import LiePoissonSystem
from ..points.sample_points import STEP, At, exponential, flat, of_rows, size, slope
from .casimir_laws import INDEPENDENCE, independence
from .law import Law, Same, axiom, cases, factors, shaped, vanishes

GROUP: list[Law] = []

# ---------------------------------------------------------------- product


@axiom(GROUP, "elements", "e and exp(xi) are arrays of numbers, of one shape")
def elements(G: LieGroup, at: At) -> Iterator[Same]:
    e, g = np.asarray(G.identity()), np.asarray(at.g)
    yield from shaped(g, e.shape)


@axiom(GROUP, "associativity", "(g h) k = g (h k)")
def associativity(G: LieGroup, at: At) -> Iterator[Same]:
    g, h, k = at.g, at.h, at.k
    yield Same(G.compose(G.compose(g, h), k), G.compose(g, G.compose(h, k)), at.elements(g, h, k))


@axiom(GROUP, "neutral element", "g e = e g = g")
def neutral_element(G: LieGroup, at: At) -> Iterator[Same]:
    yield Same(G.compose(at.g, G.identity()), at.g, at.elements(at.g))
    yield Same(G.compose(G.identity(), at.g), at.g, at.elements(at.g))


@axiom(GROUP, "inverse", "g g^-1 = g^-1 g = e")
def inverse(G: LieGroup, at: At) -> Iterator[Same]:
    for g in (at.g, G.compose(at.g, at.h)):
        back = G.inverse(g)
        yield Same(G.compose(g, back), G.identity(), at.elements(g, back))
        yield Same(G.compose(back, g), G.identity(), at.elements(g, back))


@axiom(GROUP, "matrix product", "g h is the product of the matrices", "compose")
def matrix_product(G: LieGroup, at: At) -> Iterator[Same]:
    if at.units.are_matrices:
        g, h = np.asarray(at.g), np.asarray(at.h)
        swapped = {"the factors are swapped, it is h g": h @ g}
        yield Same(G.compose(at.g, at.h), g @ h, at.elements(g, h), lambda: swapped)


# ---------------------------------------------------------------- exponential


@axiom(GROUP, "one-parameter subgroup", "exp(0) = e, exp(s xi) exp(t xi) = exp((s + t) xi), exp(-xi) = exp(xi)^-1")
def one_parameter_subgroup(G: LieGroup, at: At) -> Iterator[Same]:
    scale = at.elements(at.g, at.back) * (1.0 + at.length)
    yield Same(G.exp(0.0 * at.xi), G.identity(), at.units.weight)
    yield Same(G.compose(G.exp(0.25 * at.xi), G.exp(0.75 * at.xi)), at.g, scale)
    yield Same(G.exp(-at.xi), at.back, scale)


@axiom(GROUP, "exponential", "exp(xi) is that of the matrix hat(xi), and d/ds exp(s xi) = hat(xi) at s = 0")
def exponential_of_matrices(G: LieGroup, at: At) -> Iterator[Same]:
    if at.units.are_matrices:
        x, y = np.asarray(G.algebra.hat(at.xi)), np.asarray(G.algebra.hat(at.eta))
        scale = at.elements(at.g) * (1.0 + size(x))
        yield Same(at.g, exponential(x), scale, partial(cases, exponential, factors(x)))
        yield Same(slope(lambda s: G.exp(s * at.eta)), flat(y), at.units.weight / STEP)


# ---------------------------------------------------------------- adjoint action


@axiom(GROUP, "left action of Ad", "Ad_gh = Ad_g Ad_h")
def left_action(G: LieGroup, at: At) -> Iterator[Same]:
    gh, scale = (G.compose(at.g, at.h), at.condition * at.share(at.h, G.inverse(at.h)) * size(at.zeta))
    backwards = "it is a right action, or `compose` swaps its factors"
    yield Same(
        G.Ad(gh, at.zeta), G.Ad(at.g, G.Ad(at.h, at.zeta)), scale, lambda: {backwards: G.Ad(at.h, G.Ad(at.g, at.zeta))}
    )


@axiom(GROUP, "conjugation", "g exp(eta) g^-1 = exp(Ad_g eta), and hat(Ad_g eta) = g hat(eta) g^-1")
def conjugation(G: LieGroup, at: At) -> Iterator[Same]:
    moved = G.Ad(at.g, at.eta)
    scale = at.elements(at.g, at.h, at.back) * (1.0 + size(moved) / size(at.eta)) * at.condition
    backwards = {"it is Ad of the inverse": G.compose(G.compose(at.back, at.h), at.g)}
    yield Same(G.exp(moved), G.compose(G.compose(at.g, at.h), at.back), scale, lambda: backwards)
    if at.units.are_matrices:
        g, y = np.asarray(at.g), np.asarray(G.algebra.hat(at.eta))
        yield Same(G.algebra.hat(moved), g @ y @ inv(g), size(y) * at.condition)


@axiom(GROUP, "automorphism", "Ad_g [eta, zeta] = [Ad_g eta, Ad_g zeta]")
def automorphism(G: LieGroup, at: At) -> Iterator[Same]:
    moved = G.Ad(at.g, at.eta), G.Ad(at.g, at.zeta)
    scale = max(at.units.bracket_size(*moved), at.units.bracket_size(at.eta, at.zeta)) * at.condition
    yield Same(G.Ad(at.g, G.ad(at.eta, at.zeta)), G.ad(*moved), scale)


@axiom(GROUP, "exp of ad", "Ad_exp(xi) = exp(ad_xi)")
def exp_of_ad(G: LieGroup, at: At) -> Iterator[Same]:
    yield Same(at.Ad, exponential(at.ad), at.condition * (1.0 + at.length), partial(cases, exponential, factors(at.ad)))


# ---------------------------------------------------------------- coadjoint action


@axiom(GROUP, "dual of Ad", "<Ad*_g mu, xi> = <mu, Ad_g xi>", "Ad_star")
def dual_of_Ad(G: LieGroup, at: At) -> Iterator[Same]:
    mu, Ad = flat(at.mu), at.Ad
    slips = {"it is Ad_g, not its dual": Ad @ mu, "it is the left action K_g = Ad*_(g^-1)": solve(Ad.T, mu)}
    yield Same(G.Ad_star(at.g, at.mu), Ad.T @ mu, size(mu) * at.condition, lambda: slips)


@axiom(GROUP, "right action of Ad*", "Ad*_gh = Ad*_h Ad*_g")
def right_action(G: LieGroup, at: At) -> Iterator[Same]:
    gh, scale = G.compose(at.g, at.h), at.condition * at.share(at.h, G.inverse(at.h)) * size(at.mu)
    yield Same(G.Ad_star(gh, at.mu), G.Ad_star(at.h, G.Ad_star(at.g, at.mu)), scale)


@axiom(GROUP, "slope of Ad*", "d/ds Ad*_exp(s xi) mu = ad*_xi mu at s = 0")
def slope_of_Ad_star(G: LieGroup, at: At) -> Iterator[Same]:
    yield Same(slope(lambda s: G.Ad_star(G.exp(s * at.eta), at.mu)), G.ad_star(at.eta, at.mu), size(at.mu) / STEP)


# ---------------------------------------------------------------- momenta and arrays

PLACE: list[Law] = []


def gradients(casimirs: Callable[[Any], Any], mu: Vec) -> np.ndarray:
    """The derivatives of the Casimirs by all components of a momentum, in steps of a component's
    size: they are polynomials of high degree on large groups.  (dim, number)
    """
    dim = len(mu)
    length = size(mu) / math.sqrt(dim)

    def along(s: float) -> np.ndarray:
        return of_rows(casimirs, flat(mu) + s * length * np.eye(dim))

    return slope(along).reshape(dim, -1) / length


@axiom(PLACE, "Casimirs", "casimirs(Ad*_g mu) = casimirs(mu), and their gradients C' have B(mu) C' = 0", "casimirs")
def casimirs(G: LieGroup, at: At) -> Iterator[Same]:
    moved = G.Ad_star(at.g, at.mu)
    slopes, moved_slopes = (gradients(G.casimirs, mu) for mu in (at.mu, moved))
    b = of_rows(lambda a: G.ad_star(a, at.mu), np.eye(at.dim)).T
    change = float((norm(slopes, axis=0) + norm(moved_slopes, axis=0)).max(initial=0.0))
    yield Same(G.casimirs(moved), G.casimirs(at.mu), change * (size(at.mu) + size(moved)) * at.condition)
    yield vanishes(b @ slopes, float(norm(b, 2)) * change * math.sqrt(at.dim) / STEP)


@axiom(PLACE, *INDEPENDENCE, "casimirs", once=True)
def independent_casimirs(G: LieGroup, at: At) -> Iterator[Same]:
    yield independence(G.casimirs, lambda mu: gradients(G.casimirs, mu).T, (at.mu, at.nu, at.mu + at.nu))


@axiom(PLACE, "further invariants", "further_invariants(Ad*_g mu) = further_invariants(mu)", "further_invariants")
def further_invariants(G: LieGroup, at: At) -> Iterator[Same]:
    moved = G.Ad_star(at.g, at.mu)
    numbers, after = (np.array(G.further_invariants(np.array(mu)) or ()) for mu in (at.mu, moved))
    yield Same(after, numbers, (size(numbers) + size(at.mu) + size(moved)) * at.condition)


@axiom(PLACE, "units", "unit_blocks add up to dim, scale(g) has dim positive numbers", "unit_blocks", "scale")
def units(G: LieGroup, at: At) -> Iterator[Same]:
    scale = np.asarray(G.scale(at.g), dtype=float)
    yield from shaped(scale, (G.dim,))
    yield Same(np.abs(scale), scale)
    yield Same(float(sum(G.unit_blocks)), float(G.dim))


@axiom(PLACE, "membership", "defect(g h) = 0; what is off the group by a thousandth is refused", "defect")
def membership(G: LieGroup, at: At) -> Iterator[Same]:
    product = G.compose(at.g, at.h)
    yield Same(G.defect(product), 0.0, at.share(at.g, at.h, at.back, G.inverse(at.h)) * (1.0 + at.length))
    yield Same(bool(G.contains(np.asarray(product))), True)
    if flat(product).size > G.dim:  # else every array near an element is one
        yield Same(bool(G.contains(np.asarray(at.disturbed(product)))), False)


@axiom(
    PLACE, "nearest", "nearest(g) = g, and the element nearest to a disturbed one is an element", "nearest", slack=64.0
)
def nearest(G: LieGroup, at: At) -> Iterator[Same]:
    yield Same(G.nearest(at.g), at.g, at.elements(at.g, at.back))
    element = G.nearest(at.disturbed(at.g))
    yield Same(G.defect(element), 0.0, at.share(element, G.inverse(element)))


@axiom(PLACE, "random", "random elements are elements, and as many as asked for", "random", once=True)
def random_elements(G: LieGroup, at: At) -> Iterator[Same]:
    elements = np.asarray(G.random(1, (2, 3)))
    yield Same(np.array(elements.shape), np.array((2, 3, *G.element_shape)))
    yield Same(np.all(G.contains(elements)), True)


@axiom(PLACE, "body velocity", "body_velocity(g, d/ds g exp(s xi)) = xi at s = 0", optional=True)
def body_velocity(G: LieGroup, at: At) -> Iterator[Same]:
    rate = slope(lambda s: G.compose(at.g, G.exp(s * at.eta)))
    scale = size(at.eta) * at.condition * at.share(at.g) / STEP
    yield Same(G.body_velocity(at.g, at.shaped(rate)), at.eta, scale)


# ---------------------------------------------------------------- native code

NATIVE: list[Law] = []


@axiom(
    NATIVE,
    "native code",
    "a run of `integrate` gives the same bits compiled and in plain Python",
    once=True,
    optional=True,
)
def same_bits(G: LieGroup, at: At) -> Iterator[Same]:
    if kernel.available() is not None:
        raise NotImplementedError(f"no native code: {kernel.available()}")
    body = LiePoissonSystem(G, KineticEnergy(Vec.of([1.0 + 0.3 * i / G.dim for i in range(G.dim)])))
    start = body.state(mu=np.array(at.mu), g=np.asarray(at.k))
    h = 0.05 / at.units.length(body.velocity(at.mu))
    plain, native = (integrate(body, RKMK(order=4), start, h=h, steps=4, compiled=c) for c in (False, True))
    for a, b in ((native.mu, plain.mu), (native.g, plain.g)):
        yield Same(flat(a).view(np.int64) == flat(b).view(np.int64), np.ones(flat(b).size))
