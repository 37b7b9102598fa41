"""The momentum that coupled sites keep together: of the symmetry that turns all of them at once.

The sum P of the momenta of all sites changes as

    dP/dt = sum_i ad*_(xi_i) mu_i,      xi_i = dH/dmu_i,

and <P, zeta> is kept if the energy stays as it is when exp(s zeta) turns every site, which is so if this
rate has no component along zeta wherever the momenta are.  It is looked for at random momenta.

Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 11.4 (Noether's theorem).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...groups.composed.power import PowerGroup

MORE = 3
"""Random momenta at which it is looked for, beyond the dimension of the group of a site."""

ROUNDING = 1e-11
"""Rates below this part of their terms are rounding."""

NAME = "total momentum"


def kept_directions(system: Any, mu: np.ndarray) -> np.ndarray | None:
    """Directions zeta of the algebra of a site along which the sum of all momenta is kept, (k, dim),
    orthonormal, axes first; None where nothing moves, or random momenta have no velocity.

    mu : (..., sites, dim), momenta in a motion, whose sizes the random ones have.
    """
    base = system.group.base
    dim, sites = base.dim, system.group.copies
    size = np.abs(mu).reshape(-1, sites, dim).max(axis=(0, 2))
    size = np.where(size > 0.0, size, size.max())
    rng = np.random.default_rng(1)
    samples = rng.normal(size=(dim + MORE, sites, dim)) * size[:, None]
    try:
        with np.errstate(all="ignore"):
            xi = np.asarray(system.velocity(samples))
            turned = np.asarray(base.ad_star(xi, samples))
    except ArithmeticError:
        return None
    terms = np.abs(turned).sum(axis=(1, 2))
    if not (np.isfinite(terms).all() and terms.all()):
        return None
    rates = turned.sum(axis=1) / terms[:, None]
    axes = [k for k in range(dim) if np.abs(rates[:, k]).max() <= ROUNDING]
    mixed = [k for k in range(dim) if k not in axes]
    directions_kept = [*np.eye(dim)[axes]]
    if mixed:
        _, sizes, directions = np.linalg.svd(rates[:, mixed])
        for direction in directions[sizes <= ROUNDING]:
            whole = np.zeros(dim)
            whole[mixed] = direction * np.sign(direction[np.abs(direction).argmax()])
            directions_kept.append(whole)
    return np.array(directions_kept).reshape(-1, dim)


def momenta_of_symmetry(system: Any, mu: np.ndarray) -> dict[str, np.ndarray]:
    """The total momentum where it is kept, by name: whole, (..., dim), or its components along the
    directions in which it is, (...).

    mu : (..., sites, dim), or with all numbers in a row.
    """
    group = system.group
    if not isinstance(group, PowerGroup) or group.copies == 1:
        return {}
    dim = group.base.dim
    of_sites = mu if mu.shape[-1] == dim else mu.reshape(*mu.shape[:-1], group.copies, dim)
    directions = kept_directions(system, of_sites)
    if directions is None:
        return {}
    total = of_sites.sum(axis=-2)
    if len(directions) == dim:
        return {NAME: total}
    return {
        f"{NAME} along ({', '.join(f'{x:.3g}' for x in np.round(zeta, 9) + 0.0)})": total @ zeta for zeta in directions
    }
