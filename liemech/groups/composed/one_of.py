"""One of several groups, which of them is a parameter of the site: the group of a site in a system of
several species.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from ...formulas import Ambient, Element, Mat, Vec, mat, record, vec, vectors
from ...formulas.sites import SiteArray, own
from ..lie_group import LieGroup
from .parts import AlgebraOfParts, GroupOfParts
from .product import entries, shaped


def chosen(which: SiteArray, kinds: tuple[Any, ...], formula: Callable[[int], Any]) -> Any:
    """formula(k) for the kind k of this site."""
    return _from(0, own(which), len(kinds), formula)


def _from(k: int, mine: float, count: int, formula: Callable[[int], Any]) -> Any:
    if k < count - 1:
        if mine == k:
            return formula(k)
        return _from(k + 1, mine, count, formula)
    return formula(k)


def lengthened(x: Any, like: Vec) -> Vec:
    """A vector, with the rest of a longer one behind it."""
    return vec(*x, *like[len(x) :])


def filled(x: Any, width: int) -> Vec:
    """A vector, with zeros behind it."""
    return vec(*x, *[0.0 for _ in range(width - len(x))])


def widened(x: Any, n: int, width: int, rest: float) -> Mat:
    """A matrix (n, n), perhaps given by its diagonal or as a multiple of the unit matrix, as the first block of a
    larger one with this number on the rest of the diagonal.
    """
    if isinstance(x, vectors.Mat):
        rows = [[*row] for row in x]
    else:
        diagonal = [*x] if isinstance(x, vectors.Vec) else [x for _ in range(n)]
        rows = [[diagonal[i] if i == j else 0.0 for j in range(n)] for i in range(n)]
    padding = [0.0 for _ in range(width - n)]
    unit = [[rest if i == j else 0.0 for j in range(width)] for i in range(n, width)]
    return mat(*[vec(*row, *padding) for row in rows], *[vec(*row) for row in unit])


@record
class AlgebraOfOne(AlgebraOfParts):
    """The algebra of `OneOf`: vectors of fewer components end in zeros.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 3.12.
    """

    kinds: tuple[Any, ...]
    which: SiteArray
    size: int

    @property
    def dim(self) -> int:
        return self.size

    def _of_velocities(self, name: str, xi: Vec, eta: Vec, *more: Any) -> Vec:
        """The map `name` of the site's kind, padded with zeros.  xi, eta : (dim,)."""

        def map_of_kind(k: int) -> Vec:
            kind = self.kinds[k]
            return lengthened(getattr(kind, name)(xi[: kind.dim], eta[: kind.dim], *more), eta)

        return chosen(self.which, self.kinds, map_of_kind)

    def _of_equations(self, name: str, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, Mat, Mat]:
        """The equations of the site's kind, and p = mu for the numbers behind.  xi, p, mu : (dim,)."""

        def equations_of_kind(k: int) -> tuple[Vec, Mat, Mat]:
            kind = self.kinds[k]
            n = kind.dim
            r, by_p, by_xi = getattr(kind, name)(xi[:n], p[:n], mu[:n])
            return (lengthened(r, p - mu), widened(by_p, n, self.dim, 1.0), widened(by_xi, n, self.dim, 0.0))

        return chosen(self.which, self.kinds, equations_of_kind)

    def is_exp_chart(self, xi: Vec) -> bool:
        """Whether xi lies in the chart of exp of the site's kind."""
        kinds = self.kinds
        return chosen(self.which, kinds, lambda k: kinds[k].is_exp_chart(xi[: kinds[k].dim]))


@record
class OneOf(GroupOfParts):
    """One of several groups, by a parameter of the site: elements are their entries in a row, matrices
    row by row and complex entries as two, and end in zeros where others have more; so do velocities
    and momenta.

    kinds : the groups.  those : of their algebras.  Make it by `OneOf.of_kinds`.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 1.12.
    """

    kinds: tuple[LieGroup, ...]
    those: AlgebraOfOne
    is_complex = False  # complex entries are two real ones

    @classmethod
    def of_kinds(cls, kinds: tuple[Any, ...], which: SiteArray) -> OneOf:
        """The group whose kind depends on the site.  which : of every site the number of its group."""
        algebras = tuple([kind.algebra for kind in kinds])
        return cls(kinds, AlgebraOfOne(algebras, which, max([kind.dim for kind in kinds])))

    @property
    def algebra(self) -> AlgebraOfOne:
        """The Lie algebra: vectors padded with zeros, of the kind of the site at hand."""
        return self.those

    @cached_property
    def widths(self) -> tuple[int, ...]:
        """The widths of elements of each kind, in real numbers."""
        return tuple([width_of(kind) for kind in self.kinds])

    @cached_property
    def element_shape(self) -> tuple[int, ...]:
        """The shape of elements as vectors of the widest kind."""
        return (max(self.widths),)

    def element(self, k: int, g: Element) -> Any:
        """The element of kind k.  g : an element."""
        return shaped(self.kinds[k], g[: self.widths[k]])

    def _element(self, name: str, elements: Any, vectors: Any) -> Element:
        """An element of the site's kind, padded like the first argument of the map, or by zeros."""
        like = elements[0] if len(elements) > 0 else filled((), self.element_shape[0])
        return self._of_kind(name, elements, vectors, like)

    def _vector(self, name: str, elements: Any, vectors: Any) -> Vec:
        """A vector of the site's kind, which ends as the one that the map takes, or in zeros."""
        return self._of_kind(name, elements, vectors, vectors[0] if len(vectors) > 0 else filled((), self.dim))

    def _of_kind(self, name: str, elements: Any, vectors: Any, like: Vec) -> Vec:
        """The numbers that the map of the site's kind gives, with the rest of a longer vector behind them."""

        def map_of_kind(k: int) -> Vec:
            kind = self.kinds[k]
            parts = [self.element(k, g) for g in elements], [x[: kind.dim] for x in vectors]
            return lengthened(entries(getattr(kind, name)(*parts[0], *parts[1])), like)

        return chosen(self.those.which, self.kinds, map_of_kind)

    def why_no_cayley(self) -> str | None:
        """The reason of the first kind without a Cayley map, or None."""
        for kind in self.kinds:
            if kind.why_no_cayley() is not None:
                return f"{kind!r} has none: {kind.why_no_cayley()}"
        return None

    def defect(self, g: Ambient) -> float:
        kinds = self.kinds
        return chosen(self.those.which, kinds, lambda k: kinds[k].defect(self.element(k, g)))

    def scale(self, g: Element | None) -> Vec:
        if g is not None:
            return self._vector("scale", (g,), ())
        kinds = self.kinds
        return chosen(self.those.which, kinds, lambda k: filled(kinds[k].scale(None), self.dim))

    @property
    def by_adjoint(self) -> LieGroup | None:
        """The group of the kinds with the Cayley map of Ad_g; None if a kind has none."""
        groups: list[Any] = [kind.by_adjoint for kind in self.kinds]
        return None if None in groups else OneOf.of_kinds(tuple(groups), self.those.which)


def width_of(group: LieGroup) -> int:
    """The number of real numbers in an element."""
    count = 2 if group.is_complex else 1
    for n in group.element_shape:
        count = count * n
    return count
