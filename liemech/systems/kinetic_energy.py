"""Quadratic energy: Lagrangian and Hamiltonian of a free body."""

from __future__ import annotations

import sys
from dataclasses import field
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import Mat, Vec, check_finite, dot, real_array, record, vectors
from ..formulas.classes.fields import OfEach
from ..formulas.classes.layouts import laid_out
from ..formulas.classes.of_each import Each, each
from ..formulas.classes.records import fields_of, fill
from ..formulas.large import Large
from ..formulas.vectors import small
from .hamiltonian import Hamiltonian
from .inertia import SYMMETRY
from .lagrangian import Lagrangian


@record
class KineticEnergy(Hamiltonian, Lagrangian):
    """Kinetic energy with inertia J: l(xi) = xi . J xi/2 and, the same number, H(mu) = mu . J^-1
    mu/2.

    inertia : (dim,) principal moments, or (dim, dim) a symmetric matrix; `each(values)` of them for
    the sites of `PerSite`.  The inverse is stored: formulas never divide by J.
    Raises InvalidInput for a matrix that is not symmetric, and for an inertia without an inverse.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 1.2 and
    15.2.
    """

    inertia: Vec | Mat
    inverse: Vec | Mat = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.inertia, Each):
            object.__setattr__(self, "inverse", _inverse_of_each(self.inertia))
            return
        if not len(self.inertia):
            raise InvalidInput(f"{type(self).__name__}: inertia is empty; got {self.inertia!r}")
        require_invertible(self.inertia)
        if isinstance(self.inertia, vectors.Vec) or np.ndim(self.inertia) == 1:
            inverse: Vec | Mat = 1.0 / self.inertia
        else:
            matrix = np.linalg.inv(np.array(self.inertia))
            inverse = Large(matrix) if isinstance(self.inertia, Large) else Mat.of(matrix.tolist())
        object.__setattr__(self, "inverse", inverse)

    def energy(self, mu: Vec) -> float:
        """H(mu) = mu . J^-1 mu/2."""
        return 0.5 * dot(mu, self._velocity(mu))

    def gradient(self, mu: Vec) -> Vec:
        """The velocity xi = J^-1 mu of a momentum."""
        return self._velocity(mu)

    def _velocity(self, mu: Vec) -> Vec:
        return times(self.inverse, mu)

    def value(self, xi: Vec) -> float:
        """l(xi) = xi . J xi/2."""
        return 0.5 * dot(xi, self._momentum(xi))

    def momentum(self, xi: Vec) -> Vec:
        """The momentum mu = J xi of a velocity."""
        return self._momentum(xi)

    def _momentum(self, xi: Vec) -> Vec:
        return times(self.inertia, xi)

    def hessian(self, xi: Vec) -> Mat | Vec:
        """The inertia J = d2l/dxi2, a matrix or its diagonal."""
        return self.inertia

    @property
    def inertias(self) -> np.ndarray:
        """The inertia as a matrix, (1, dim, dim), or those of all sites."""
        each = isinstance(self.inertia, OfEach)
        inertias = self.inertia.values if each else np.array(self.inertia)[None]
        return inertias if inertias.ndim == 3 else inertias[:, :, None] * np.eye(inertias.shape[1])

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        one_vector = kind == "Vec" and not isinstance(self.inertia, OfEach)
        return (len(self.inertia),) if one_vector else None


def has_inertia(energy: Any) -> bool:
    """Whether the inertia says all about an energy: a `KineticEnergy` whose class overrides neither `energy` nor `value`."""
    return (
        isinstance(energy, KineticEnergy)
        and type(energy).energy is KineticEnergy.energy
        and type(energy).value is KineticEnergy.value
    )


def _inverse_of_each(inertia: Each) -> Each:
    """The inverses of moments or matrices, one for each."""
    values = inertia.values
    if values.ndim == 2 and bool((np.abs(values) >= LEAST).all()):
        return each(1.0 / values)
    for i, inertia_of_site in enumerate(values):
        try:
            require_invertible(small(inertia_of_site))
        except InvalidInput as error:
            raise InvalidInput(f"{error} (value {i} of {inertia!r})") from None
    return each(np.linalg.inv(values))


@record
class KineticEnergyByEntries(KineticEnergy):
    """A kinetic energy on large matrices whose velocity is the momentum entry by entry.

    entries : the factors of the entries, real and imaginary parts apart.
    """

    entries: Any = None

    def __repr__(self) -> str:
        return f"KineticEnergy(inertia={self.inertia!r})"

    def velocity_matrix(self, algebra: Any, m: Mat) -> Mat:
        """The momentum, entry by entry."""
        return self.entries * m


def by_entries(energy: Any, group: Any) -> Any:
    """A kinetic energy by principal moments as one by entries, where they are those of entries, as on
    SO(n); anything else as it is.
    """
    if type(energy) is not KineticEnergy or np.ndim(energy.inertia) != 1:
        return energy
    basis, inverse = group.generated, np.array(energy.inverse)
    if len(inverse) != basis.dim:
        return energy
    unit = np.random.default_rng(1).uniform(1.0, 2.0, (2, basis.dim))
    m = [Large(basis.covector(probe)).numbers for probe in unit]
    x = [Large(basis.hat(inverse * basis.pairing(basis.covector(probe)))).numbers for probe in unit]
    with np.errstate(all="ignore"):
        factors = np.where(m[0] == 0.0, 0.0, x[0] / m[0])
    if not np.allclose(factors * m[1], x[1], rtol=1e-14, atol=0.0):
        return energy
    entries = Large.of_numbers(factors, basis.complex)
    return fill(KineticEnergyByEntries, {**fields_of(energy), "entries": entries})


def kinetic_energy(inertia: Vec | Mat) -> KineticEnergy:
    """KineticEnergy(inertia), sooner where there is nothing to convert and nothing wrong.
    inertia : (dim,) or (dim, dim).
    """
    if isinstance(inertia, vectors.Vec) and _invertible(inertia):
        energy = fill(KineticEnergy, {"inertia": inertia, "inverse": 1.0 / inertia})
        return laid_out(energy, len(inertia))
    return KineticEnergy(inertia)


def _invertible(moments: Vec) -> bool:
    """Whether all moments have finite inverses."""
    return _FLOAT.issuperset(map(type, moments)) and all(LEAST <= abs(x) <= MAX for x in moments)


MAX = sys.float_info.max
LEAST = 1.0 / MAX
_FLOAT = frozenset([float])


def require_invertible(inertia: Vec | Mat) -> None:
    """Raise InvalidInput for an inertia that is empty, not finite, not symmetric or singular. (dim,) or (dim, dim)"""
    if isinstance(inertia, vectors.Vec) and _invertible(inertia):
        return
    array = real_array(inertia, "KineticEnergy: inertia")
    check_finite(array, "KineticEnergy: inertia")
    if array.ndim == 1:
        small = np.flatnonzero(np.abs(array) < 1.0 / MAX)
        if len(small):
            at = int(small[0])
            raise InvalidInput(
                f"KineticEnergy: inertia[{at}] is {array[at]:g}; a moment without a finite inverse has no velocity"
            )
        return
    if array.shape != array.T.shape:
        raise InvalidInput(
            f"KineticEnergy: inertia has shape {array.shape}; give moments, (dim,), or a square matrix, (dim, dim)"
        )
    unit = np.sqrt(np.abs(np.diag(array)))
    sizes = np.maximum(np.maximum(np.abs(array), np.abs(array.T)), unit[:, None] * unit)
    asymmetry = np.abs(array - array.T)
    if (asymmetry > SYMMETRY * sizes).any():
        i, j = (int(k) for k in np.unravel_index(int((asymmetry - SYMMETRY * sizes).argmax()), asymmetry.shape))
        raise InvalidInput(
            f"KineticEnergy: inertia is not symmetric: [{i}, {j}] is {array[i, j]:g}, [{j}, {i}] "
            f"is {array[j, i]:g}. The energy knows only the symmetric part, (J + J^T)/2"
        )
    # in such units rows can be compared
    unit = 1.0 / np.where(unit > 0.0, unit, np.abs(array).max() ** 0.5 or 1.0)
    lengths = np.linalg.svd(unit[:, None] * array * unit, compute_uv=False)
    if lengths[-1] <= len(array) * 2.0**-51 * lengths[0]:
        raise InvalidInput(
            f"KineticEnergy: inertia is singular up to rounding: a velocity has no momentum. It is {array.tolist()}"
        )


def times(inertia: Vec | Mat, x: Any) -> Any:
    """The product of an inertia, where a Vec stands for a diagonal matrix, with a vector or another such matrix."""
    by_rows = isinstance(inertia, vectors.Mat) or (isinstance(inertia, Large) and inertia.axes == 2)
    return inertia @ x if by_rows else inertia * x


def trace(inertia: Vec | Mat) -> float:
    """The trace of such a matrix of three rows."""
    m = inertia
    return m[0, 0] + m[1, 1] + m[2, 2] if isinstance(m, vectors.Mat) else m[0] + m[1] + m[2]
