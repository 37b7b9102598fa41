"""Fields g(s, t) on a group, with ends that are free, held, loaded or closed to a ring."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import InvalidInput, OrderWarning, require, warn
from ...formulas import Element, Vec, real_array, record, vec
from ...formulas.classes.of_each import each
from ...groups.lie_group import LieGroup
from ...groups.retractions import Exponential, Retraction
from ...systems.lie_poisson import BodyState
from ...systems.potential import Force, Potential
from ..sites.terms.terms import PerSite, Terms
from .cell import Cell
from .density import FieldDensity
from .in_cells import FieldInCells

FORCED = 1.0 / 16.0
"""The energy of strain at a free end, over that of the cell that has most, above which the end is not free of force."""

LEAST, ROUNDING = 4, 2.0**-40
"""Cells of which two tell what is at an end; and the part of displacements that is rounding."""


@record
class Field(FieldInCells):
    """A field g(s, t) on a group, with the density l(eta, xi), in cells along a line.

    target : the group, such as SO3().  density : a FieldDensity, of the strain eta = g^-1 g_s and the
    velocity xi = g^-1 g_t.
    length : of the line.  cells : how many; there are as many nodes, and one more on a line that is not
    closed.
    ends : of the first node and the last, each "free", "held", or a Potential or a Force that acts there.
    closed : the last cell leads back to the first node.
    acting : Potentials and Forces in a unit of length.
    retraction : tau, of the strain of cells.

    States have a row for each node: mu, (nodes, dim), momenta w mu of the part w of the line at a node, and
    elements g.  `column` is the field whose steps go along s.  Steps are KickDrift()'s; on groups whose free
    motion is not known, KickDrift(CovariantVariational(Cayley())).

    Source: Demoures, Gay-Balmaz, Kobilarov and Ratiu, Commun. Nonlinear Sci. Numer. Simul. 19 (2014), 3492;
    Ellis, Gay-Balmaz, Holm, Putkaradze and Ratiu, Arch. Ration. Mech. Anal. 197 (2010), 811 (covariant
    Euler-Poincare equations).
    """

    target: LieGroup
    density: FieldDensity
    length: float
    cells: int
    ends: tuple[Any, Any] = ("free", "free")
    closed: bool = False
    acting: tuple[Any, ...] = ()
    retraction: Retraction = Exponential()

    def _check(self) -> None:
        name = type(self).__name__
        require(f"{name}: target", self.target, LieGroup, "SO3()")
        require(f"{name}: density", self.density, FieldDensity, "FieldDensity(KineticEnergy(M), KineticEnergy(C))")
        require(f"{name}: retraction", self.retraction, Retraction, "Exponential()")
        for energy in (self.density.kinetic, self.density.stored):
            shape = energy._shape("xi", "Vec")
            if shape not in (None, (self.target.dim,)):
                raise InvalidInput(
                    f"{name}: {energy!r} takes vectors of {shape[0]} components; those of {self.target!r} have "
                    f"{self.target.dim}"
                )
        length, least = real_array(self.length, f"{name}: length"), 3 if self.closed else 1
        if length.ndim or not 0.0 < length < np.inf:
            raise InvalidInput(f"{name}: length must be positive and finite; got {self.length!r}")
        if type(self.cells) is not int or self.cells < least:
            raise InvalidInput(f"{name}: cells must be a whole number from {least} on; got {self.cells!r}")
        require(f"{name}: closed", self.closed, bool, "True or False")
        for what in ("ends", "acting"):
            require(f"{name}: {what}", getattr(self, what), (tuple, list), "a tuple")
            object.__setattr__(self, what, tuple(getattr(self, what)))
        for energy in self.acting:
            require(f"{name}: acting", energy, (Potential, Force), "Potentials and Forces in a unit of length")
        ends: Any = self.ends
        if len(ends) != 2 or not all(x in ("free", "held") or isinstance(x, (Potential, Force)) for x in ends):
            raise InvalidInput(f'{name}: ends are two, each "free", "held", a Potential or a Force; got {ends!r}')
        if self.closed and ends != ("free", "free"):
            raise InvalidInput(f"{name}: a closed line has no ends; got {ends!r}")

    @property
    def element(self) -> Cell:
        """The energy of a cell."""
        return Cell(self.target, self.density.stored, self.length / self.cells, self.retraction)

    def state(self, mu: Any = None, g: Any = None, *, xi: Any = None) -> BodyState:
        """A start for `integrate`: momenta mu of nodes, or velocities xi, and elements g, (nodes, ...).

        Raises what `MechanicalSystem.state` raises.  Warns by an OrderWarning of a start with a force, or one that begins,
        where an end is free: a front of waves comes from there, behind which the order in cells and steps is one.
        """
        state = super().state(mu, g, xi=xi)
        for end, which in zip(("first", "last"), (slice(None), slice(None, None, -1))):
            if self.closed or self.cells < LEAST or self.ends[end == "last"] != "free":
                continue
            for what, size, at_all in self._strained(state, which):
                if (size > FORCED * at_all).any():
                    warn(
                        f"{type(self).__name__}.state: the {end} node is free, and {what} is not zero there: it has "
                        f"{np.sqrt((size / at_all).max()):.2g} of its largest value on the line. From a start whose force "
                        "does not fade at a free end a front runs in, and the order is one instead of two: let it fade, or "
                        "hold the end",
                        OrderWarning,
                    )
                    return state
        return state

    def _strained(self, start: Any, which: slice) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """Of the strain beyond that of rest and of its rate a name, the energy at an end, extrapolated from the two cells
        next to it, and the largest one of a cell that is more than rounding.  which : the cells, from that end on.
        """
        C = np.array(self.density.stored.hessian(vec(*np.atleast_2d(self.rest_strain)[0])), dtype=float)
        C = np.diag(C) if C.ndim == 1 else C
        mu = start.arrays["mu"].reshape(-1, self.nodes, self.target.dim)
        g = start.arrays["g"].reshape(-1, self.nodes, *self.target.element_shape)
        x = self._displacements("state", g)[2]
        xi = np.asarray(self.density.kinetic.gradient(mu / self.parts[:, None]))
        after, before = (
            np.asarray(self.retraction.dtau_inv(self.target, y, v))
            for y, v in ((x, xi[..., 1:, :]), (-x, xi[..., :-1, :]))
        )
        rate, l = after - before, self.length / self.cells
        for what, change, whole in (("the force", x - l * self.rest_strain, x), ("the rate of the force", rate, after)):
            cells, whole = change[..., which, :], np.abs(whole).max()
            end = 1.5 * cells[..., 0, :] - 0.5 * cells[..., 1, :]
            energies = np.einsum("...i,ij,...j->...", cells, C, cells)
            noise = (ROUNDING * whole) ** 2 * np.abs(C).max()
            yield what, np.einsum("...i,ij,...j->...", end, C, end), np.maximum(energies.max(axis=-1), noise)

    def held(self) -> tuple[list[int], list[int]]:
        """The nodes at ends that are held; none turns where it is."""
        return [node for node, end in zip((0, self.cells), self.ends) if end == "held"], []

    def others(self) -> tuple[list[Any], Any]:
        """Terms of the potentials that act on nodes, and the load."""
        parts = [*((energy, self.parts) for energy in self.acting), *zip(self.ends, np.eye(self.nodes)[[0, -1]])]
        of_nodes: Any = each
        potentials = [PerSite(PartOfPotential(V, of_nodes(w))) for V, w in parts if isinstance(V, Potential)]
        forces = [PerSite(PartOfForce(F, of_nodes(w))) for F, w in parts if isinstance(F, Force)]
        return potentials, Terms(*forces) if forces else None

    def column(
        self, duration: float, steps: int, ends: tuple[Any, Any] = ("free", "free"), closed: bool = False
    ) -> Field:
        """The field whose steps go along s and whose nodes are times: -l, with xi and eta exchanged.

        duration : in s, in so many steps.  ends : at the first time and the last, "free" where there is no
        momentum.  closed : periodic in time.  Momenta are the internal forces dPhi/deta; the longest stable
        step is the way of the slowest wave in a time step.
        """
        forces = [energy for energy in self.acting if isinstance(energy, Force)]
        if forces:
            raise InvalidInput(f"{type(self).__name__}.column: {forces[0]!r} has no potential")
        exchanged = FieldDensity(self.density.stored, self.density.kinetic)
        acting = tuple([PartOfPotential(V, -1.0) for V in self.acting])
        return type(self)(self.target, exchanged, duration, steps, ends, closed, acting, self.retraction)


@record
class PartOfPotential(Potential):
    """A potential V in a unit of length on a part w of the line.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 7.7.
    """

    potential: Potential
    part: float

    def energy(self, g: Any) -> float:
        """The energy w V(g) of the part."""
        return self.part * self.potential.energy(g)

    def force(self, group: LieGroup, g: Element) -> Vec:
        return self.part * self.potential.force(group, g)


@record
class PartOfForce(Force):
    """A force F in a unit of length on a part w of the line.

    Source: Marsden and West, Discrete mechanics and variational integrators, Acta Numerica 10 (2001), section 3.1.
    """

    force: Force
    part: float

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        """The force w F(t, xi, g) on the part."""
        return self.part * self.force.covector(t, xi, g)

    def resistance(self, t: float, xi: Vec, g: Any, along: Vec) -> Vec:
        return self.part * self.force.resistance(t, xi, g, along)
