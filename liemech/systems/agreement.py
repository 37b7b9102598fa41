"""Do an energy, its gradient and a Lagrangian speak of one body on one group?  Asked once, where a
system is made.

Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 7.2 (the
Legendre transform).
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from ..formulas import Vec, derivative, dot
from ..formulas.classes.overriding import WrongResult
from ..groups.lie_group import LieGroup
from .hamiltonian import Hamiltonian
from .kinetic_energy import KineticEnergy
from .lagrangian import Lagrangian

if TYPE_CHECKING:
    from ..formulas import Record

PROBED = 64
"""Formulas of more components than this are not evaluated for a question."""

APART = 1e-6
"""Two numbers that should be the same and differ by more than this, relative to their terms, come
from two different bodies.
"""


ROUNDING = 2.0**-46
"""The error that a slope in one unit may have, relative to all terms: where it cancels it is rounding."""


def parts_in_units(x: Vec, blocks: tuple[int, ...]) -> list[Vec]:
    """For every unit the vector with the components of this unit, and zeros elsewhere."""
    of_unit = np.repeat(np.arange(len(blocks)), blocks)
    return [Vec.of(np.where(of_unit == k, np.array(x), 0.0).tolist()) for k in range(len(blocks))]


def require_one_body(name: str, group: LieGroup, hamiltonian: Hamiltonian, lagrangian: Lagrangian | None) -> None:
    """Raise InvalidInput where dimensions differ, where dH is not the gradient, or where dl/dxi
    does not undo dH/dmu.

    What has no value at the momentum that is tried, a pole or a root, is not judged.
    """
    dim = group.dim
    for formula, argument in ((hamiltonian, "mu"), (lagrangian, "xi")):
        shape = formula._shape(argument, "Vec") if formula is not None else None
        if shape not in (None, (dim,)):
            raise InvalidInput(
                f"{name}: {formula!r} takes vectors of {shape[0]} components; those of {group!r} have {dim}"
            )
    alone = lagrangian is None or lagrangian is hamiltonian  # type: ignore[comparison-overlap]
    # whose inertia is symmetric, as it has made sure
    if dim > PROBED or (alone and type(hamiltonian) is KineticEnergy):
        return
    mu = _probe(5, dim)
    xi = _value(name, group, hamiltonian, hamiltonian.gradient, mu)
    if xi is None:
        return
    if type(hamiltonian).gradient is not Hamiltonian.gradient:
        _require_gradient(name, group, hamiltonian, mu, xi)
    if lagrangian is not None and id(lagrangian) != id(hamiltonian):
        back = _value(name, group, lagrangian, lagrangian.momentum, xi)
        if back is not None and (np.abs(np.array(back) - np.array(mu)) > APART).any():
            raise InvalidInput(
                f"{name}: the Lagrangian is that of another body than the Hamiltonian: at the "
                f"velocity dH/dmu = {_shown(xi)} of the momentum {_shown(mu)} its momentum dl/dxi "
                f"is {_shown(back)}, not the same"
            )


@functools.cache
def _probe(seed: int, dim: int) -> Vec:
    """A generic vector: its components are not zero, and not equal."""
    return Vec.of(np.random.default_rng(seed).uniform(0.5, 1.0, dim).tolist())


def _require_gradient(name: str, group: LieGroup, hamiltonian: Hamiltonian, mu: Vec, xi: Vec) -> None:
    """The slope of the energy along a direction that moves all components of one unit; of every unit."""
    whole = np.abs(np.array(xi) * np.array(_probe(6, len(mu)))).sum()
    for direction in parts_in_units(_probe(6, len(mu)), group.unit_blocks):
        slope = _value(
            name, group, hamiltonian, lambda m, along=direction: derivative(hamiltonian.energy, m, along), mu
        )
        if slope is None:
            return
        terms = float(np.abs(np.array(xi) * np.array(direction)).sum())
        allowed = max(APART * max(terms, abs(slope)), ROUNDING * whole)
        if not abs(slope - dot(xi, direction)) > allowed:
            continue
        raise InvalidInput(
            f"{name}: {type(hamiltonian).__name__}.gradient is not the gradient of its energy: "
            f"along {_shown(direction)} at {_shown(mu)} the energy has the slope {slope:.6g}, it "
            f"gives {dot(xi, direction):.6g}. Leave it out, and it is derived"
        )


def _value(name: str, group: LieGroup, owner: Record, formula: Any, x: Vec) -> Any:
    """A formula's value at a vector of the group's dimension; None where it has none, InvalidInput
    for a missing component.
    """
    try:
        value = formula(x)
        numbers = np.array(value, dtype=float)
    except WrongResult:
        raise
    # a formula of somebody else's may fail anywhere but where it is meant to be used
    except Exception as error:
        if isinstance(error, IndexError) or (isinstance(error, InvalidType) and "components" in str(error)):
            raise InvalidInput(f"{name}: {owner!r} does not fit {group!r}, of dimension {group.dim}: {error}") from None
        return None
    if numbers.ndim == 1 and len(numbers) != group.dim:
        raise InvalidInput(
            f"{name}: {owner!r} gives {len(numbers)} components on {group!r}, whose dimension is {group.dim}"
        )
    return value if numbers.ndim < 2 and np.isfinite(numbers).all() else None


def _shown(x: Any) -> str:
    return np.array2string(np.array(x), precision=4, threshold=8)
