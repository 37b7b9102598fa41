"""Lie-Poisson systems: a group and an energy that depends on the body momentum alone."""

from __future__ import annotations

from typing import Any, final

import numpy as np

from ..errors import InvalidInput, InvalidType
from ..groups.lie_group import LieGroup
from ..native import Element, Record, Vec, check_finite, real_array, record
from ..native.border import small
from .hamiltonian import Hamiltonian
from .lagrangian import Lagrangian


@record
class BodyState(Record):
    """Where a body is and how it moves: body momentum `mu`, and the group element `g` from body to space (None: not asked for).

    mu : (dim,) or, for an ensemble, (bodies, dim);  g : (n, n) or (bodies, n, n).
    """

    mu: Any
    g: Any = None

    @property
    def bodies(self) -> int | None:
        """How many bodies; None for a single one."""
        return len(self.mu) if isinstance(self.mu, np.ndarray) else None


@record
class LiePoissonSystem(Record):
    """Motion on the dual of a Lie algebra, mu' = ad*_xi mu with xi = dH/dmu, and on the group above it, g' = g xi.

    group : the configuration space.  hamiltonian : the energy as a function of the body momentum.
    lagrangian : the same motion told by velocities, for methods that need it; left out, the Hamiltonian stands in if it is a
    Lagrangian too, like KineticEnergy.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 13.1, 13.5 and 13.7.
    """

    group: LieGroup
    hamiltonian: Hamiltonian
    lagrangian: Lagrangian | None = None

    def __post_init__(self) -> None:
        given: tuple[Any, ...] = self.group, self.hamiltonian, self.lagrangian or Lagrangian()
        for name, value, kind in zip(("group", "hamiltonian", "lagrangian"), given, (LieGroup, Hamiltonian, Lagrangian)):
            if not isinstance(value, kind):
                raise InvalidType(f"{type(self).__name__}: {name} must be a {kind.__name__}; got {value!r}")
        if self.lagrangian is None and isinstance(self.hamiltonian, Lagrangian):
            object.__setattr__(self, "lagrangian", self.hamiltonian)
        super().__post_init__()

    # ---------------------------------------------------------------- formulas

    @final
    def velocity(self, mu: Vec) -> Vec:
        """The body velocity xi = dH/dmu.  mu : (dim,)."""
        return self.hamiltonian.gradient(mu)

    @final
    def energy(self, mu: Vec) -> float:
        """H(mu).  mu : (dim,)."""
        return self.hamiltonian.energy(mu)

    @final
    def casimirs(self, mu: Vec) -> Vec:
        """The Casimir functions of the group: constant whatever the energy.  mu : (dim,)."""
        return self.group.casimirs(mu)

    @final
    def spatial_momentum(self, mu: Vec, g: Element) -> Vec:
        """The momentum seen from space, K_g mu = Ad*_{g^-1} mu: constant by Noether's theorem.  mu : (dim,), g : an element."""
        return self.group.K(g, mu)

    # ---------------------------------------------------------------- the border

    @final
    def state(self, mu: Any, g: Any = None) -> BodyState:
        """A start for `integrate`: body momentum mu and, if the motion on the group is wanted, the element g.

        mu : (dim,) for one body, (bodies, dim) for an ensemble;  g : an element, for matrix groups (n, n), or (bodies, n, n).
        Raises InvalidInput for wrong shapes, entries that are not finite, and a g that is not on the group.
        """
        name = f"{type(self).__name__}.state"
        momenta = real_array(mu, f"{name}: mu")
        dim = self.group.dim
        if momenta.ndim not in (1, 2) or momenta.shape[-1] != dim:
            raise InvalidInput(
                f"{name}: mu has shape {momenta.shape}; a momentum on {self.group!r} has shape ({dim},), many (bodies, {dim})"
            )
        if not len(momenta):
            raise InvalidInput(f"{name}: mu has shape {momenta.shape}; an ensemble needs at least one body")
        check_finite(momenta, f"{name}: mu")
        if g is None:
            return BodyState(Vec.of(momenta.tolist()) if momenta.ndim == 1 else _frozen(momenta))
        elements = real_array(g, f"{name}: g", self.group.is_complex)
        shape = self.group.element_shape
        if elements.shape not in (shape, (*elements.shape[:1], *shape)):
            raise InvalidInput(f"{name}: g has shape {elements.shape}; an element of {self.group!r} has shape {shape}")
        if not elements.size:
            raise InvalidInput(f"{name}: g has shape {elements.shape}; an ensemble needs at least one body")
        many = elements.shape != shape
        check_finite(elements, f"{name}: g")
        off = np.flatnonzero(~np.atleast_1d(self.group.contains(elements)))
        if len(off):
            which = f"g[{off[0]}]" if many else "g"
            raise InvalidInput(f"{name}: {which} {self.group._objection('g', elements[off[0]] if many else elements)}")
        if momenta.ndim == 1 and not many:
            return BodyState(Vec.of(momenta.tolist()), small(elements))
        bodies = len(momenta) if momenta.ndim == 2 else len(elements)
        if many and len(elements) != bodies:
            raise InvalidInput(f"{name}: {bodies} momenta and {len(elements)} group elements")
        return BodyState(
            _frozen(np.broadcast_to(momenta, (bodies, dim))), _frozen(np.broadcast_to(elements, (bodies, *shape)))
        )

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return self.group._shape(argument, kind)

    def _complex(self, kind: str) -> bool:
        return self.group._complex(kind)

    def _objection(self, argument: str, value: Any) -> str | None:
        return self.group._objection(argument, value)


def _frozen(array: np.ndarray) -> np.ndarray:
    copy = np.array(array)
    copy.flags.writeable = False
    return copy
