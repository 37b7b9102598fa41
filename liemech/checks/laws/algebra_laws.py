"""The laws of a Lie algebra."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...errors import NotDefined
from ...groups.lie_algebra import LieAlgebra
from ..points.sample_points import At, flat, size
from .law import Law, Same, axiom, factors, vanishes

ALGEBRA: list[Law] = []


@axiom(ALGEBRA, "antisymmetry", "[xi, eta] = -[eta, xi]")
def antisymmetry(a: LieAlgebra, at: At) -> Iterator[Same]:
    yield Same(a.bracket(at.xi, at.eta), -a.bracket(at.eta, at.xi), at.units.bracket_size(at.xi, at.eta))


@axiom(ALGEBRA, "Jacobi identity", "[xi, [eta, zeta]] + [eta, [zeta, xi]] + [zeta, [xi, eta]] = 0")
def jacobi(a: LieAlgebra, at: At) -> Iterator[Same]:
    x, y, z, b = at.xi, at.eta, at.zeta, a.bracket
    largest = sum(at.units.bracket_size(*three) for three in ((x, y, z), (y, z, x), (z, x, y)))
    yield vanishes(b(x, b(y, z)) + b(y, b(z, x)) + b(z, b(x, y)), largest)


@axiom(ALGEBRA, "structure constants", "[E_i, E_j] = sum_k c[k][i][j] E_k, and the bracket is bilinear")
def structure_constants(a: LieAlgebra, at: At) -> Iterator[Same]:
    constants, commutators = (np.array(a.structure_constants, dtype=float).transpose(1, 2, 0), at.units.constants)
    order = {"the order of the indices, c[k][i][j] has k first": commutators.transpose(1, 2, 0)}
    yield Same(constants, commutators, np.abs(commutators).max(initial=0.0), lambda: factors(commutators) | order)
    yield Same(a.bracket(at.xi, at.eta), at.ad @ flat(at.eta), at.units.bracket_size(at.xi, at.eta))


@axiom(ALGEBRA, "dual of the bracket", "<ad*_xi mu, eta> = <mu, [xi, eta]>", "ad_star")
def dual_of_the_bracket(a: LieAlgebra, at: At) -> Iterator[Same]:
    mu, ad = flat(at.mu), at.ad
    terms = float((np.abs(ad).T @ np.abs(mu)).max(initial=0.0))
    yield Same(
        a.ad_star(at.xi, at.mu), ad.T @ mu, terms, lambda: factors(ad.T @ mu) | {"it is ad_xi, not the dual": ad @ mu}
    )


@axiom(ALGEBRA, "ad_matrix", "ad_matrix(xi) eta = [xi, eta]", "ad_matrix")
def matrix_of_the_bracket(a: LieAlgebra, at: At) -> Iterator[Same]:
    yield Same(a.ad_matrix(at.xi), at.ad, size(at.ad), lambda: factors(at.ad) | {"it is transposed": at.ad.T})


@axiom(ALGEBRA, "invariant form", "([xi, eta], zeta) = (xi, [eta, zeta])", "invariant_form", optional=True)
def form_is_invariant(a: LieAlgebra, at: At) -> Iterator[Same]:
    form = a.invariant_form
    if form is None:
        raise NotDefined("the algebra says that it has none")
    left, right = flat(a.bracket(at.xi, at.eta)), flat(a.bracket(at.eta, at.zeta))
    scale = size(form) * (size(left) * size(at.zeta) + size(at.xi) * size(right))
    yield Same(left @ form @ flat(at.zeta), flat(at.xi) @ form @ right, scale)


@axiom(ALGEBRA, "hat and vee", "hat is linear, vee(hat(xi)) = xi", optional=True)
def hat_and_vee(a: LieAlgebra, at: At) -> Iterator[Same]:
    x = np.asarray(a.hat(at.xi))
    yield Same(sum(c * np.asarray(a.hat(e)) for c, e in zip(at.xi, at.axes, strict=True)), x, size(x))
    yield Same(a.vee(a.hat(at.xi)), at.xi, size(at.xi), lambda: factors(at.xi))


@axiom(ALGEBRA, "commutator", "hat([xi, eta]) = hat(xi) hat(eta) - hat(eta) hat(xi)", optional=True)
def commutator(a: LieAlgebra, at: At) -> Iterator[Same]:
    x, y = np.asarray(a.hat(at.xi)), np.asarray(a.hat(at.eta))
    transposed = {"hat is transposed": y @ x - x @ y}
    xy = a.hat(a.bracket(at.xi, at.eta))
    yield Same(xy, x @ y - y @ x, 2.0 * size(x) * size(y), lambda: factors(x @ y - y @ x) | transposed)
