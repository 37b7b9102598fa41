"""Products of powers: the configurations of sites of several species."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType
from ...formulas import Element, Vec, record
from ...formulas.sites import SiteArray
from ..lie_group import LieGroup
from .one_of import OneOf
from .power import ELEMENTS, SITE_BY_SITE, WRITTEN_OUT, PowerGroup
from .product import DirectProduct, ProductAlgebra, ProductGroup, spans


@record
class SpeciesGroup(DirectProduct):
    """A product of powers, `SO3() ** 100 * SE3() ** 8`: the configurations of sites of several
    species, which are numbered from 0, as are the sites of each.

    An element is one vector, as that of `ProductGroup`.  Systems on it take momenta, velocities and
    elements of every species, [(100, 3), (8, 6)] and [(100, 3, 3), (8, 4, 4)], and show them so.

    powers : of each species.  Raises InvalidType for what is no power, InvalidInput for none at all.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 1.12.
    """

    powers: tuple[PowerGroup, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        for power in self.powers:
            if not isinstance(power, PowerGroup):
                raise InvalidType(f"SpeciesGroup: a species is a power of a group, such as SO3() ** 100; got {power!r}")
        if not self.powers:
            raise InvalidInput("SpeciesGroup needs one species at least, such as SO3() ** 100")

    def __repr__(self) -> str:
        return " * ".join(map(repr, self.powers))

    @property
    def factors(self) -> tuple[Any, ...]:
        """The factors: one power for each species."""
        return self.powers

    @cached_property
    def algebra(self) -> ProductAlgebra:
        return ProductAlgebra(tuple([power.algebra for power in self.powers]))

    @property
    def by_adjoint(self) -> LieGroup | None:
        """The product of the powers with the Cayley map of Ad_g; None if a power has none."""
        powers: Any = [power.by_adjoint for power in self.powers]
        return None if None in powers else SpeciesGroup(tuple(powers))

    # ---------------------------------------------------------------- sites

    @cached_property
    def copies(self) -> int:
        """The number of sites of all species."""
        return sum([power.copies for power in self.powers])

    @cached_property
    def firsts(self) -> tuple[int, ...]:
        """The number of the first site of each species among all."""
        return tuple([first for first, _ in spans([power.copies for power in self.powers])])

    @property
    def examples(self) -> tuple[int, ...]:
        """A site of every species."""
        return self.firsts

    def named(self, i: int) -> str:
        """How a site is called."""
        k = self.species_of(i)
        return f"{i - self.firsts[k]} of species {k}"

    def species_of(self, i: int) -> int:
        """The species of site i."""
        return sum([first <= i for first in self.firsts]) - 1

    def base_of(self, i: int) -> LieGroup:
        """The group of site i."""
        return self.powers[self.species_of(i)].base

    def momentum_of(self, mu: Vec, i: int) -> Vec:
        """The momentum of site i, or its velocity.  mu : (dim,)."""
        k = self.species_of(i)
        n = self.powers[k].base.dim
        first = self.algebra_spans[k][0] + n * (i - self.firsts[k])
        return mu[first : first + n]

    def site(self, g: Element, i: int) -> Any:
        """The element of site i.  g : an element."""
        k = self.species_of(i)
        first, end = self.places[k]
        return self.powers[k].site(g[first:end], i - self.firsts[k])

    @cached_property
    def algebra_spans(self) -> tuple[tuple[int, int], ...]:
        """Where the velocities of each species begin and end."""
        return tuple(spans([power.dim for power in self.powers]))

    @cached_property
    def base(self) -> LieGroup:
        """The group of a site whose number is open: that of all, or one of several."""
        kinds: list[Any] = []
        for power in self.powers:
            if power.base not in kinds:
                kinds.append(power.base)
        if len(kinds) == 1:
            return kinds[0]
        numbers = [float(kinds.index(power.base)) for power in self.powers]
        return OneOf.of_kinds(tuple(kinds), SiteArray.of(np.repeat(numbers, self.counts)))

    @property
    def counts(self) -> list[int]:
        """The number of sites of each species."""
        return [power.copies for power in self.powers]

    # ---------------------------------------------------------------- arrays

    @property
    def is_large(self) -> bool:
        return self.dim > WRITTEN_OUT

    @cached_property
    def _columns(self) -> dict[str, np.ndarray]:
        """For each number of a row of all sites its place in an array with an axis of sites."""
        columns, wide = {}, {"Vec": self.base.dim, "Element": self._width}
        for kind, width in wide.items():
            sizes = [p.base.dim if kind == "Vec" else p.width for p in self.powers]
            rows = [
                (width * (first + np.arange(p.copies))[:, None] + np.arange(n)).ravel()
                for p, first, n in zip(self.powers, self.firsts, sizes)
            ]
            columns[kind] = np.concatenate(rows)
        return columns

    @property
    def _width(self) -> int:
        return max([power.width for power in self.powers])

    def by_site(self, array: Any, kind: str) -> np.ndarray:
        """Momenta or velocities (..., dim), or elements, with an axis of sites: (..., sites, n), where
        those that have fewer numbers end in zeros.
        """
        lead, width = array.shape[:-1], self.base.dim if kind == "Vec" else self._width
        padded = np.zeros((*lead, self.copies * width))
        padded[..., self._columns[kind]] = array
        padded = padded.reshape(*lead, self.copies, width)
        if kind == "Vec" or isinstance(self.base, OneOf):
            return padded
        if self.base.is_complex:
            padded = padded.view(complex)
        return padded.reshape(*lead, self.copies, *self.base.element_shape)

    def without_sites(self, array: Any, kind: str) -> np.ndarray:
        """The inverse of `by_site`: a row without the zeros behind."""
        array = np.ascontiguousarray(array)
        axes = 2 if kind == "Vec" else 1 + len(self.base.element_shape)
        rows = array.reshape(*array.shape[: array.ndim - axes], -1)
        rows = rows.view(float) if np.iscomplexobj(rows) else rows
        return rows[..., self._columns[kind]]

    def by_species(self, array: Any, kind: str) -> list[Any]:
        """Momenta, velocities or elements of each species, with an axis of sites.  array : (..., dim),
        or elements.
        """
        ends = self.algebra_spans if kind == "Vec" else self.places
        parts = [array[..., first:end] for first, end in ends]
        return [power.by_site(part, kind) for power, part in zip(self.powers, parts)]

    def in_a_row(self, value: Any, kind: str) -> Any:
        """The inverse of `by_species`, of a list or a tuple; other values unchanged."""
        if not isinstance(value, (list, tuple)) or len(value) != len(self.powers):
            return value
        parts = [np.asarray(p.in_a_row(x, kind)) for p, x in zip(self.powers, value)]
        row_shapes = [(p.dim,) if kind == "Vec" else p.element_shape for p in self.powers]
        if any(x.shape[-1:] != shape for x, shape in zip(parts, row_shapes)):
            return value
        lead = np.broadcast_shapes(*[x.shape[:-1] for x in parts])
        return np.concatenate([np.broadcast_to(x, (*lead, x.shape[-1])) for x in parts], axis=-1)

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        if method not in SITE_BY_SITE:
            return None
        blocks = []
        for power, vectors, elements in zip(self.powers, self.algebra_spans, self.places):
            spans_of = {name: elements if name in ELEMENTS else vectors for name in arguments}
            slices = {name: x[..., slice(*spans_of[name])] for name, x in arguments.items()}
            blocks.append(power._in_numpy(method, slices))
        if method in ("defect", "contains"):
            return np.max(blocks, axis=0) if method == "defect" else np.all(blocks, axis=0)
        return np.concatenate(blocks, axis=1)

    def _in_rows(self, value: Any, kind: str) -> Any:
        return self.in_a_row(value, "Vec" if kind == "Vec" else "Element")

    def _out_of_rows(self, results: Any, kind: str | None = None) -> Any:
        width = results.shape[-1:]
        if kind is None and width not in ((self.dim,), self.element_shape):
            return results
        kind = kind or ("Vec" if width == (self.dim,) else "Element")
        return self.by_species(results, "Vec" if kind == "Vec" else "Element")


def times(one: LieGroup, other: LieGroup) -> LieGroup:
    """The product of two groups: of powers, that of species.  Raises InvalidInput for a power beside a
    group of one body.
    """
    powers = [
        x.powers if isinstance(x, SpeciesGroup) else (x,) if isinstance(x, PowerGroup) else () for x in (one, other)
    ]
    if all(powers):
        return SpeciesGroup((*powers[0], *powers[1]))
    if any(powers):
        single = other if powers[0] else one
        raise InvalidInput(f"{one!r} * {other!r}: of one site write {single!r} ** 1")
    factors = [x.factors if isinstance(x, ProductGroup) else (x,) for x in (one, other)]
    return ProductGroup(*factors[0], *factors[1])
