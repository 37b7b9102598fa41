"""The laws of maps from the algebra to the group: of the exponential, the Cayley map, and any
retraction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.linalg import cond, inv, norm, solve

from ...errors import InvalidInput, NoConvergence, OutsideChart
from ...formulas import Vec
from ...groups.bernoulli import BERNOULLI
from ...groups.coadjoint import CoadjointAction
from ...groups.lie_algebra import LieAlgebra
from ...groups.lie_group import LieGroup
from ...groups.retractions import Cayley, Exponential, Retraction
from ...systems.system import lies_in_memory
from ..points.sample_points import LARGE, MANY, STEP, At, flat, of_rows, phi1, size, slope, turning
from .law import Law, Same, axiom, cases, factors, replaced

MAPS: list[Law] = []
"""In names and formulas {tau} stands for exp, cayley, or tau itself."""

EXP = "exp log exp_Ad_star compose_exp dexp dexp_inv dexp_dual dexp_inv_dual exp_residual is_exp_chart"
CAY = "cayley cayley_inv cayley_Ad_star compose_cayley dcayley dcayley_inv dcayley_dual dcayley_inv_dual cayley_residual is_chart"
TAU = "tau tau_inv tau_Ad_star compose_tau dtau dtau_inv dtau_dual dtau_inv_dual residual is_chart"


@dataclass(eq=False)
class Map:
    """A retraction on a group, under the names that it has there.

    author : the group whose class is asked for closed forms; `group` may be that in other units.
    """

    retraction: Retraction
    group: LieGroup
    author: LieGroup
    differentials: dict[tuple[At, str], tuple[np.ndarray, float]] = field(default_factory=dict, repr=False)

    def __getattr__(self, name: str) -> Any:
        return partial(getattr(self.retraction, name), self.group)

    @property
    def is_exp(self) -> bool:
        return isinstance(self.retraction, Exponential)

    @property
    def words(self) -> dict[str, str]:
        """The names of the methods: dtau is dexp for the exponential."""
        names = EXP if self.is_exp else CAY if isinstance(self.retraction, Cayley) else TAU
        return dict(zip(TAU.split(), names.split(), strict=True))

    def laws(self) -> list[Law]:
        """The laws, in the words of the map."""
        words = self.words
        return [replace(law, name=law.name.format(**words), formula=law.formula.format(**words)) for law in MAPS]

    def own(self, name: str) -> bool:
        """Whether the method is the author's own.  What a retraction leaves out is made by differentiating tau: his own
        too.
        """
        if name in ("tau_compose", "tau_act"):
            return replaced(self.retraction, Retraction, name)
        if isinstance(self.retraction, Exponential | Cayley):
            word = self.words.get(name, name)
            if hasattr(LieAlgebra, word):
                return replaced(self.author.algebra, LieAlgebra, word)
            return replaced(self.author, LieGroup, word)
        derived = ("dtau", "dtau_dual", "dtau_inv", "dtau_inv_dual", "residual")
        return replaced(self.retraction, Retraction, name) or name in derived[: None if self.group.dim <= LARGE else 1]

    def differential(self, at: At, side: str) -> tuple[np.ndarray, float]:
        """The matrix of dtau by definition, and how many roundings are in it: found once, for
        several laws need it.
        """
        if (at, side) not in self.differentials:
            if self.is_exp:
                matrix_and_roundings = phi1(at.ad if side == "right" else -at.ad), 1.0
            else:
                units, lengths = np.eye(at.dim), at.units.lengths
                matrix_and_roundings = self.differences(at, units / lengths, side) * lengths, 1.0 / STEP
            self.differentials[at, side] = matrix_and_roundings
        return self.differentials[at, side]

    def difference(self, at: At, eta: Vec, side: str) -> np.ndarray:
        """d/de of tau(xi + e eta) tau(xi)^-1, or of tau(xi)^-1 tau(xi + e eta) for side="left"."""
        length = at.units.length(eta)
        return self.differences(at, flat(eta)[None] / length, side)[:, 0] * length

    def differences(self, at: At, etas: np.ndarray, side: str) -> np.ndarray:
        """The differentials of many directions of size one.  etas : (many, dim); (dim, many)."""
        group, back = self.group, self.group.inverse(self.tau(at.xi))

        def moved(xi: Any) -> Any:
            element = self.tau(xi)
            return group.compose(element, back) if side == "right" else group.compose(back, element)

        changes = slope(lambda s: of_rows(moved, flat(at.xi) + s * etas)).reshape(len(etas), -1)
        return at.units.coordinates(changes.T)

    def slips(self, at: At, dual: bool, inverse: bool) -> dict[str, Any]:
        """The maps for which a differential, its inverse or a dual of them is mistaken."""
        left, right = (self.differential(at, side)[0] for side in ("left", "right"))
        x = flat(at.mu) if dual else flat(at.eta)
        if inverse:
            left, right = inv(left), inv(right)
        if dual:
            left, right = left.T, right.T
        slips = {
            "it is the right-trivialised one": right @ x,
            "it is not the dual" if dual else "it is the dual": left.T @ x,
            "it is not the inverse" if inverse else "it is the inverse": inv(left) @ x,
            "it is not the inverse, and the right-trivialised one"
            if inverse
            else "it is the inverse of the right-trivialised one": inv(right) @ x,
        }
        if self.is_exp and inverse and not dual:
            sums = np.cumsum(bernoulli_terms(-at.ad, x), axis=0)
            slips |= {f"it is the series cut after ad^{k}": sums[k] for k in (0, 1, 2, 4, 6, 8, 10)}
        return slips


def bernoulli_terms(ad: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """B_k/k! ad^k eta, one row for each k."""
    powers = [eta]
    for _ in BERNOULLI[1:]:
        powers.append(ad @ powers[-1])
    return np.array([b * power for b, power in zip(BERNOULLI, powers, strict=True)])


# ---------------------------------------------------------------- the map


@axiom(MAPS, "{tau} at zero", "{tau}(0) = e, and d/ds {tau}(s xi) = xi at s = 0", once=True)
def map_at_zero(tau: Map, at: At) -> Iterator[Same]:
    yield Same(tau.tau(0.0 * at.xi), tau.group.identity(), at.units.weight)
    rate = at.units.coordinates(slope(lambda s: tau.tau(s * at.eta)))
    yield Same(rate, at.eta, size(at.eta) / STEP, lambda: factors(at.eta))


@axiom(MAPS, "inverse of {tau}", "{tau}(-xi) = {tau}(xi)^-1")
def map_of_the_opposite(tau: Map, at: At) -> Iterator[Same]:
    g = tau.tau(at.xi)
    back = tau.group.inverse(g)
    yield Same(tau.tau(-at.xi), back, at.elements(g, back) * (1.0 + at.length))


@axiom(
    MAPS, "{tau_inv}", "{tau_inv}({tau}(xi)) = xi inside the chart, {tau}({tau_inv}(g)) = g", "tau_inv", optional=True
)
def inverse_map(tau: Map, at: At) -> Iterator[Same]:
    # where the logarithm changes its branch
    cut, angle = math.pi if tau.is_exp else math.inf, at.spectrum[0]
    points = [at.xi] if angle < 0.98 * cut else []
    if tau.is_exp and at.name == "random" and angle:
        # close to the cut, where roundings grow like 1/distance
        points.append(((1.0 - 1e-6) * cut / angle) * at.xi)
    for xi in points:
        g = tau.tau(xi)
        try:
            logarithm = tau.tau_inv(g)
        except (InvalidInput, NoConvergence):
            if xi is at.xi:
                raise
            continue  # so close to the cut, to refuse is honest
        beside = cut / (cut - angle * size(xi) / size(at.xi)) if tau.is_exp and size(xi) else 1.0
        scale = at.share(g, tau.group.inverse(g)) * (1.0 + at.length) * beside
        yield Same(logarithm, xi, (size(xi) + size(at.eta)) * scale * at.condition, partial(factors, xi))
        yield Same(tau.tau(logarithm), g, at.units.weight * scale)


@axiom(MAPS, "{tau_Ad_star}", "{tau_Ad_star}(xi, mu) = Ad_star({tau}(xi), mu)", "tau_Ad_star", optional=True)
def coadjoint_shortcut(tau: Map, at: At) -> Iterator[Same]:
    group, g = tau.group, tau.tau(at.xi)
    back = group.inverse(g)
    scale = at.share(g, back) * at.condition * size(at.mu) * (1.0 + at.length)
    slips = {"a wrong sign of xi, it is the left action K": group.Ad_star(back, at.mu)}
    yield Same(tau.tau_Ad_star(at.xi, at.mu), group.Ad_star(g, at.mu), scale, lambda: slips)


@axiom(
    MAPS,
    "{compose_tau}",
    "{compose_tau}(g, xi) = g {tau}(xi), and so from the other side",
    "compose_tau",
    "tau_compose",
    optional=True,
)
def composition_shortcut(tau: Map, at: At) -> Iterator[Same]:
    group, g = tau.group, tau.tau(at.xi)
    slips = {
        "the factors are swapped": group.compose(g, at.h),
        "a wrong sign of xi": group.compose(at.h, group.inverse(g)),
    }
    scale = at.elements(at.h, g) * (1.0 + at.length)
    yield Same(tau.compose_tau(at.h, at.xi), group.compose(at.h, g), scale, lambda: slips)
    back = group.inverse(at.h)
    scale = scale * at.share(at.h, back)  # of Ad
    yield Same(tau.tau_compose(at.xi, at.h), group.compose(g, at.h), scale)


@axiom(MAPS, "tau_act", "tau_act(xi, x) = {tau}(xi) . x, of momenta", "tau_act")
def action_shortcut(tau: Map, at: At) -> Iterator[Same]:
    action, g = CoadjointAction(tau.group), tau.tau(at.xi)
    moved = action.act(g, at.mu)
    scale = at.share(g, tau.group.inverse(g)) * at.condition * size(at.mu) * (1.0 + at.length)
    slips = {"a wrong sign of xi": tau.group.Ad_star(g, at.mu)}
    yield Same(tau.retraction.tau_act(action, at.xi, at.mu), moved, scale, lambda: slips)


@axiom(MAPS, "{is_chart}", "{is_chart}(xi) is true at zero, and false where {dtau} is singular", "is_chart", once=True)
def chart(tau: Map, at: At) -> Iterator[Same]:
    yield Same(bool(tau.is_chart(0.0 * at.eta)), True)
    for axis in (at.axes if at.dim <= MANY else at.axes[:LARGE]) if tau.is_exp else []:
        angle, _ = turning(at.units.ad(axis))
        beyond = (1.001 * 2.0 * math.pi / angle) * axis if angle else 0.0 * axis
        if angle and not tau.is_chart(1e3 * beyond):  # who does not know lets all pass
            yield Same(bool(tau.is_chart(beyond)), False)


# ---------------------------------------------------------------- its differential

DEFINITION = "d/de {tau}(xi + e eta) = {tau}(xi) ({dtau}_xi eta)"


@axiom(MAPS, "{dtau} by definition", DEFINITION, "dtau", optional=True)
def differential_by_definition(tau: Map, at: At) -> Iterator[Same]:
    g = tau.tau(at.xi)
    difference = tau.difference(at, at.eta, "left")
    scale = at.share(g, tau.group.inverse(g)) * (size(difference) + size(at.eta)) / STEP
    yield Same(tau.dtau(at.xi, at.eta), difference, scale, partial(tau.slips, at, False, False))


@axiom(MAPS, "{dtau_dual}", "<{dtau_dual}_xi mu, eta> = <mu, {dtau}_xi eta>", "dtau_dual", optional=True)
def dual_differential(tau: Map, at: At) -> Iterator[Same]:
    d, roundings = tau.differential(at, "left")
    scale = max(1.0, float(norm(d, 2))) * size(at.mu) * (1.0 + at.length) * roundings
    slips = partial(tau.slips, at, True, False)
    yield Same(tau.dtau_dual(at.xi, at.mu), d.T @ flat(at.mu), scale, slips)


@axiom(MAPS, "{dtau_inv}", "{dtau_inv}_xi {dtau}_xi eta = eta", "dtau_inv", optional=True)
def inverse_differential(tau: Map, at: At) -> Iterator[Same]:
    d, roundings = tau.differential(at, "left")
    scale = float(norm(inv(d), 2) * cond(d)) * size(at.eta) * (1.0 + at.length)
    slips = partial(tau.slips, at, False, True)
    try:
        preimage = tau.dtau_inv(at.xi, at.eta)
    except (OutsideChart, InvalidInput):  # of large matrices its series ends before the chart does
        if at.inside and not lies_in_memory(tau.group):
            raise
        return  # behind the place where dtau is singular, to refuse is honest
    yield Same(preimage, inv(d) @ flat(at.eta), scale * roundings, slips)
    if not tau.is_exp:  # of which the series is accurate enough
        back = tau.dtau_inv(at.xi, tau.dtau(at.xi, at.eta))
        yield Same(back, at.eta, scale * float(cond(d)))


PAIRING = "<{dtau_inv_dual}_xi mu, eta> = <mu, {dtau_inv}_xi eta>"


@axiom(MAPS, "{dtau_inv_dual}", PAIRING, "dtau_inv_dual", optional=True)
def dual_of_the_inverse(tau: Map, at: At) -> Iterator[Same]:
    d, roundings = tau.differential(at, "left")
    scale = float(norm(inv(d), 2) * cond(d)) * size(at.mu) * (1.0 + at.length) * roundings
    slips = partial(tau.slips, at, True, True)
    try:
        image = tau.dtau_inv_dual(at.xi, at.mu)
    except (OutsideChart, InvalidInput):  # of large matrices its series ends before the chart does
        if at.inside and not lies_in_memory(tau.group):
            raise
        return
    yield Same(image, inv(d).T @ flat(at.mu), scale, slips)


NEWTON = "r = 0 where p = {dtau_dual}_-xi mu, and dr/dp and dr/dxi are the derivatives of r"


@axiom(MAPS, "{residual}", NEWTON, "residual", "dtau_dual", optional=True)
def residual(tau: Map, at: At) -> Iterator[Same]:
    if lies_in_memory(tau.group) or (at.dim > MANY and not (at.name == "random" and at.length < 1.1)):
        return  # large matrices do not take Newton's method; many formulas cost their time
    d, roundings = tau.differential(at, "right")
    p = Vec.of((d.T @ flat(at.mu)).tolist())
    r, by_p, _ = tau.residual(at.xi, p, at.mu)
    scale = (1.0 + size(by_p)) * (size(p) + size(at.mu)) * (1.0 + at.length) ** 2
    left = flat(p) - tau.differential(at, "left")[0].T @ flat(at.mu)
    yield Same(r, 0.0 * p, scale * roundings, lambda: {"it is that of the left-trivialised dual": times(by_p, left)})

    q = p + at.nu
    _, by_p, by_xi = tau.residual(at.xi, q, at.mu)
    change = slope(lambda s: tau.residual(at.xi + s * at.eta, q + s * at.nu, at.mu)[0])
    by_formula = times(by_xi, at.eta) + times(by_p, at.nu)
    scale = (
        (size(by_xi) + size(by_p) * (size(q) + size(at.nu)) + size(at.mu)) * (1.0 + size(at.eta)) * (1.0 + at.length)
    )
    slips = {
        "dr/dxi is transposed": change + times(by_xi, at.eta) - times(np.asarray(by_xi).T, at.eta),
        "the sign of dr/dxi": change + 2.0 * times(by_xi, at.eta),
        "the sign of dr/dp": change + 2.0 * times(by_p, at.nu),
    }
    yield Same(by_formula, change, scale / STEP, lambda: slips)


def times(derivative: Any, direction: Any) -> np.ndarray:
    """A number or a matrix times a vector."""
    matrix = np.asarray(derivative, dtype=float)
    return np.asarray(matrix @ flat(direction) if matrix.ndim else matrix * flat(direction))


# ---------------------------------------------------------------- what only the exponential has

EXPONENTIAL: list[Law] = []


@axiom(EXPONENTIAL, "dexp as a series", "dexp_xi = sum of (-ad_xi)^k/(k + 1)!", "dtau")
def series_of_the_differential(exp: Map, at: At) -> Iterator[Same]:
    d, _ = exp.differential(at, "left")
    scale = max(1.0, float(norm(d, 2))) * size(at.eta) * (1.0 + at.length)
    slips = partial(exp.slips, at, False, False)
    yield Same(exp.dtau(at.xi, at.eta), d @ flat(at.eta), scale, slips)


@axiom(EXPONENTIAL, "dexp_inv_series", "sum of B_k/k! (-ad_xi)^k, k = 0, ..., terms", "dexp_inv_series")
def series_of_the_inverse(exp: Map, at: At) -> Iterator[Same]:
    terms = bernoulli_terms(-at.ad, flat(at.eta))
    scale = float(norm(terms, axis=1).sum()) * (1.0 + at.length)
    for k, total in enumerate(np.cumsum(terms, axis=0)):
        yield Same(exp.group.algebra.dexp_inv_series(at.xi, at.eta, k), total, scale)


# ---------------------------------------------------------------- what only the Cayley map has

CAYLEY: list[Law] = []


@axiom(CAYLEY, "cayley as matrices", "cayley(xi) = (1 - X/2)^-1 (1 + X/2) with X = hat(xi)", "tau")
def cayley_as_matrices(cay: Map, at: At) -> Iterator[Same]:
    def cayley(x: np.ndarray) -> np.ndarray:
        return solve(np.eye(len(x)) - 0.5 * x, np.eye(len(x)) + 0.5 * x)

    if at.units.are_matrices:
        x = np.asarray(cay.group.algebra.hat(at.xi))
        scale = at.elements(cayley(x)) * float(cond(np.eye(len(x)) - 0.5 * x)) * (1.0 + size(x))
        yield Same(cay.tau(at.xi), cayley(x), scale, partial(cases, cayley, factors(x)))


@axiom(CAYLEY, "dcayley_inv as matrices", "dcayley_inv_xi eta = (1 + X/2) Y (1 - X/2)", "dtau_inv")
def dcayley_inv_as_matrices(cay: Map, at: At) -> Iterator[Same]:
    def product(x: np.ndarray) -> np.ndarray:
        return (np.eye(len(x)) + 0.5 * x) @ y @ (np.eye(len(x)) - 0.5 * x)

    if at.units.are_matrices:
        hat = cay.group.algebra.hat
        x, y = np.asarray(hat(at.xi)), np.asarray(hat(at.eta))
        slips = {"it is the right-trivialised one": -x, "a factor 2 too many": 2.0 * x}
        scale = (1.0 + size(x)) ** 2 * size(y)
        image = hat(cay.dtau_inv(at.xi, at.eta))
        yield Same(image, product(x), scale, partial(cases, product, slips))
