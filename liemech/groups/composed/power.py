"""Powers of a Lie group: many copies of one, the configurations of many like sites."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidInput, require
from ...formulas import Element, Vec, record
from ..lie_group import LieGroup
from .product import DirectProduct, DirectSum, shaped

WRITTEN_OUT = 300
"""Powers of more dimensions than this are not written out: arrays are taken site by site."""

ELEMENTS = "g", "h", "rate"
"""The names of arguments that are elements, in the methods of groups."""

SITE_BY_SITE = frozenset(
    {
        *("compose", "inverse", "Ad", "Ad_star", "K", "ad", "ad_star", "exp_Ad_star", "exp", "log"),
        *("dexp", "dexp_inv", "compose_exp", "cayley", "cayley_inv", "compose_cayley"),
        *("body_velocity", "casimirs", "nearest", "defect", "contains"),
    }
)
"""Methods that do in each copy what they do."""


@record
class PowerAlgebra(DirectSum):
    """The direct sum of copies of one Lie algebra.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 3.12.
    """

    base: Any
    copies: int

    @property
    def factors(self) -> tuple[Any, ...]:
        """The factors of the direct sum, all of them the base's algebra."""
        return tuple([self.base for _ in range(self.copies)])

    @property
    def dim(self) -> int:
        return self.copies * self.base.dim

    def parts(self, xi: Vec) -> tuple[Vec, ...]:
        """The coordinates of each copy.  xi : (dim,)."""
        n = self.base.dim
        return tuple([xi[n * i : n * (i + 1)] for i in range(self.copies)])


@record
class PowerGroup(DirectProduct):
    """Many copies of one group, `SO3() ** 100`: the configurations of as many sites.

    An element is one vector, the entries of the elements of the copies one after another; arrays
    may have an axis of sites as well, velocities and momenta (copies, dim) and elements (copies, n,
    n), and give back what is shaped so.  A system on a power shows its states in that shape.

    base : the group, which is no power itself.  copies : how many.  Raises InvalidType for
    what is no group, InvalidInput for a power and for no copies.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 1.12.
    """

    base: LieGroup
    copies: int
    is_complex = False  # complex entries are two real ones
    examples = (0,)  # a site of every species, of which there is one

    def __post_init__(self) -> None:
        super().__post_init__()
        base: Any = self.base
        require("PowerGroup: base", base, LieGroup)
        if hasattr(base, "copies"):
            raise InvalidInput(f"PowerGroup: base is the group of one site, and {base!r} is one of {base.copies}")
        if isinstance(self.copies, bool) or self.copies < 1:
            raise InvalidInput(
                f"{self.base!r} ** {self.copies!r}: the exponent is how many sites there are, a whole number from 1 on"
            )

    def __repr__(self) -> str:
        return f"{self.base!r} ** {self.copies}"

    @property
    def factors(self) -> tuple[Any, ...]:
        """The factors of the product, all of them the base."""
        return tuple([self.base for _ in range(self.copies)])

    @cached_property
    def algebra(self) -> PowerAlgebra:
        return PowerAlgebra(self.base.algebra, self.copies)

    @property
    def by_adjoint(self) -> LieGroup | None:
        """The power of the base with the Cayley map of Ad_g; None if there is none."""
        base = self.base.by_adjoint
        return None if base is None else PowerGroup(base, self.copies)

    def why_no_cayley(self) -> str | None:
        return self.base.why_no_cayley()

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        return self.base.unit_blocks * self.copies

    # ---------------------------------------------------------------- sites

    @cached_property
    def width(self) -> int:
        """The number of real numbers in an element of the base."""
        return math.prod(self.base.element_shape) * (2 if self.base.is_complex else 1)

    @cached_property
    def places(self) -> tuple[tuple[int, int], ...]:
        return tuple([(self.width * i, self.width * (i + 1)) for i in range(self.copies)])

    @cached_property
    def element_shape(self) -> tuple[int, ...]:
        """The shape of elements as one vector, (copies width,)."""
        return (self.copies * self.width,)

    def named(self, i: int) -> str:
        """How a site is called."""
        return str(i)

    def base_of(self, i: int) -> LieGroup:
        """The group of one copy."""
        return self.base

    def momentum_of(self, mu: Vec, i: int) -> Vec:
        """The momentum of one copy, or its velocity.  mu : (dim,)."""
        n = self.base.dim
        return mu[n * i : n * (i + 1)]

    def site(self, g: Element, i: int) -> Any:
        """The element of one copy.  g : an element."""
        return shaped(self.base, g[self.width * i : self.width * (i + 1)])

    def in_a_row(self, value: Any, kind: str) -> Any:
        """An array with an axis of sites as one without, (..., copies, dim) to (..., copies dim); other values
        unchanged.  kind : "Vec", or "Element".
        """
        site_shape = (self.base.dim,) if kind == "Vec" else self.base.element_shape
        try:
            array = np.asarray(value)
        except ValueError:
            return value
        axes = 1 + len(site_shape)
        if array.shape[-axes:] != (self.copies, *site_shape):
            return value
        lead = array.shape[:-axes]
        if kind != "Vec" and self.base.is_complex:
            array = np.ascontiguousarray(array, dtype=complex).view(float)
        return array.reshape(*lead, self.copies * (site_shape[0] if kind == "Vec" else self.width))

    def by_site(self, array: Any, kind: str | None = None) -> Any:
        """An array (..., copies dim) of momenta, velocities or elements with an axis of sites, (..., copies, dim);
        other values unchanged.

        kind : "Vec", or "Element"; None: told from its length.
        """
        n, lead = array.shape[-1:], array.shape[:-1]
        if n == (self.copies * self.base.dim,) and kind != "Element":
            return array.reshape(*lead, self.copies, self.base.dim)
        if n != self.element_shape or kind == "Vec":
            return array
        if self.base.is_complex:
            array = np.ascontiguousarray(array).view(complex)
        return array.reshape(*lead, self.copies, *self.base.element_shape)

    def without_sites(self, array: Any, kind: str) -> Any:
        """The inverse of `by_site`: sites in a row."""
        return self.in_a_row(array, kind)

    # ---------------------------------------------------------------- many sites, on arrays

    @property
    def is_large(self) -> bool:
        return self.dim > WRITTEN_OUT

    def objection(self, g: np.ndarray) -> str | None:
        elements = self.by_site(np.asarray(g), "Element")
        outside = np.flatnonzero(~np.atleast_1d(self.base.contains(elements)))
        return f"at site {outside[0]} {self.base.objection(elements[outside[0]])}" if len(outside) else None

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        kinds = {name: "Element" if name in ELEMENTS else "Vec" for name in arguments}
        if method not in SITE_BY_SITE:
            return None
        by_site = [self.by_site(x, kinds[name]) for name, x in arguments.items()]
        values = np.asarray(getattr(self.base, method)(*by_site))
        if method in ("defect", "contains"):
            return values.max(axis=1) if method == "defect" else values.all(axis=1)
        if np.iscomplexobj(values):
            values = np.ascontiguousarray(values).view(float)
        return values.reshape(len(values), math.prod(values.shape[1:]))

    def _in_rows(self, value: Any, kind: str) -> Any:
        return self.in_a_row(value, "Vec" if kind == "Vec" else "Element")

    def _out_of_rows(self, results: Any, kind: str | None = None) -> Any:
        return self.by_site(results, kind)
