"""Direct products of Lie groups: several bodies, or a body and its rotors, as one."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, require
from ...formulas import Ambient, Complex, Element, Mat, Vec, mat, real_array, record, vec, vectors
from ...formulas.large import Large
from ...formulas.vectors import small
from ..lie_group import LieGroup
from .parts import AlgebraOfParts, GroupOfParts


@record
class DirectSum(AlgebraOfParts):
    """Lie algebras side by side: coordinates one after another, brackets within each; abstract.

    A subclass has `factors` and `dim`.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 3.12.
    """

    if TYPE_CHECKING:  # a field here would be one of every subclass

        @property
        def factors(self) -> tuple[Any, ...]: ...

    def parts(self, xi: Vec) -> tuple[Vec, ...]:
        """The coordinates of each factor.  xi : (dim,)."""
        return tuple([xi[start:end] for start, end in spans([factor.dim for factor in self.factors])])

    def _of_velocities(self, name: str, xi: Vec, eta: Vec, *more: Any) -> Vec:
        """The map of each factor.  xi, eta : (dim,)."""
        shares = zip(self.factors, self.parts(xi), self.parts(eta))
        return joined([getattr(f, name)(x, y, *more) for f, x, y in shares])

    def _of_equations(self, name: str, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, Mat, Mat]:
        """The equations of the factors, and block diagonal derivatives.  xi, p, mu : (dim,)."""
        shares = zip(self.factors, self.parts(xi), self.parts(p), self.parts(mu))
        return _stacked([getattr(f, name)(x, q, m) for f, x, q, m in shares])

    def is_exp_chart(self, xi: Vec) -> bool:
        inside = True
        for factor, x in zip(self.factors, self.parts(xi)):
            inside = inside and factor.is_exp_chart(x)
        return inside


@record
class ProductAlgebra(DirectSum):
    """The direct sum of Lie algebras."""

    factors: tuple[Any, ...]

    @property
    def dim(self) -> int:
        return sum([factor.dim for factor in self.factors])


@record
class DirectProduct(GroupOfParts):
    """Groups side by side: everything happens in each factor on its own; abstract.

    An element is one vector, the entries of the factors' elements one after another, matrices row
    by row and complex entries as real and imaginary part.  Velocities and momenta are those of the
    factors one after another.  A subclass has `factors` and `algebra`.
    """

    if TYPE_CHECKING:  # a field here would be one of every subclass

        @property
        def factors(self) -> tuple[Any, ...]: ...

    # ---------------------------------------------------------------- elements of the factors

    @cached_property
    def places(self) -> tuple[tuple[int, int], ...]:
        """Where the entries of each factor's element begin and end."""
        return tuple(
            spans([np.prod(f.element_shape, dtype=int).item() * (2 if f.is_complex else 1) for f in self.factors])
        )

    def join(self, *elements: Any) -> Any:
        """One element from those of the factors, as a formula or for arrays with leading axes.

        elements : one for each factor, e.g. (..., 3, 3) and (..., 3);  returns (..., 12).  Raises
        InvalidInput for wrong shapes.
        """
        if all(isinstance(g, (vectors.Vec, vectors.Mat)) for g in elements):
            return joined([entries(g) for g in elements])
        return self._joined_arrays(elements)

    def split(self, g: Element) -> tuple[Any, ...]:
        """The elements of the factors.  g : an element, (..., width)."""
        return tuple(self._elements(g))

    def _elements(self, g: Vec) -> list[Any]:
        return [shaped(f, g[start:end]) for f, (start, end) in zip(self.factors, self.places)]

    def _joined_arrays(self, elements: tuple[Any, ...]) -> np.ndarray:
        if len(elements) != len(self.factors):
            raise InvalidInput(f"{self!r}.join: {len(elements)} elements for {len(self.factors)} factors")
        rows = []
        for number, (factor, g) in enumerate(zip(self.factors, elements, strict=True), 1):
            array, axes = (
                real_array(g, f"{self!r}.join: element {number}", factor.is_complex),
                len(factor.element_shape),
            )
            if array.shape[array.ndim - axes :] != factor.element_shape:
                raise InvalidInput(
                    f"{self!r}.join: element {number} has shape {array.shape}; its last axes must "
                    f"be {factor.element_shape}"
                )
            flat = np.ascontiguousarray(array).reshape(*array.shape[: array.ndim - axes], np.prod(factor.element_shape))
            rows.append(flat.view(float))
        try:
            lead = np.broadcast_shapes(*(row.shape[:-1] for row in rows))
        except ValueError:
            raise InvalidInput(
                f"{self!r}.join: the leading axes {[row.shape[:-1] for row in rows]} do not broadcast"
            ) from None
        return np.concatenate([np.broadcast_to(row, (*lead, row.shape[-1])) for row in rows], axis=-1)

    def _element(self, name: str, elements: Any, vectors: Any) -> Element:
        """The elements that the map of each factor gives, one behind the other."""
        parts = [self._elements(g) for g in elements], [self._parts(x) for x in vectors]
        shares = zip(self.factors, *parts[0], *parts[1])
        return joined([entries(getattr(share[0], name)(*share[1:])) for share in shares])

    def _vector(self, name: str, elements: Any, vectors: Any) -> Vec:
        """The vectors that the map of each factor gives, one behind the other."""
        return self._element(name, elements, vectors)

    # ---------------------------------------------------------------- momenta

    def casimirs(self, mu: Vec) -> Vec:
        return self._vector("casimirs", (), (mu,))

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        return tuple(size for factor in self.factors for size in factor.unit_blocks)

    def further_invariants(self, mu: Any) -> tuple[float, ...] | None:
        """The further invariants of the factors; None if one of them has None."""
        ends = np.cumsum([factor.dim for factor in self.factors])
        invariants = [f.further_invariants(part) for f, part in zip(self.factors, np.split(mu, ends[:-1]), strict=True)]
        return None if None in invariants else tuple(x for of_factor in invariants for x in of_factor or ())

    def scale(self, g: Element | None) -> Vec:
        if g is None:
            return joined([factor.scale(None) for factor in self.factors])
        return self._vector("scale", (g,), ())

    def _scales(self, g: np.ndarray) -> np.ndarray:
        factor = self.factors[0]
        if factor.is_complex or any(other != factor for other in self.factors):
            return super()._scales(g)
        return factor._scales(g.reshape(-1, *factor.element_shape)).reshape(len(g), -1)

    def _parts(self, xi: Vec) -> tuple[Vec, ...]:
        """The coordinates of each factor."""
        algebra: Any = self.algebra
        return algebra.parts(xi)

    # ---------------------------------------------------------------- membership

    def defect(self, g: Ambient) -> float:
        """The largest defect among the factors."""
        worst = 0.0
        for factor, a in zip(self.factors, self._elements(g)):
            worst = max(worst, factor.defect(a))
        return worst

    def objection(self, g: np.ndarray) -> str | None:
        for number, (factor, a) in enumerate(zip(self.factors, self._elements(small(g)), strict=True), 1):
            reason = factor.objection(np.array(a))
            if reason:
                return f"in factor {number}, {factor!r}, {reason}"
        return None

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Independent elements of the factors, each as it does."""
        generator = np.random.default_rng(rng)
        return self._joined_arrays(tuple(factor.random(generator, size) for factor in self.factors))

    # ---------------------------------------------------------------- Cayley map

    def why_no_cayley(self) -> str | None:
        """The reason of the first factor without a Cayley map, or None."""
        for factor in self.factors:
            if factor.why_no_cayley() is not None:
                return f"its factor {factor!r} has none: {factor.why_no_cayley()}"
        return None


@record
class ProductGroup(DirectProduct):
    """The direct product of groups, `ProductGroup(SO3(), VectorSpace(3))`: everything happens in
    each factor on its own.  Many copies of one group are a power of it, `SO3() ** 100`.

    An element is one vector, the entries of the factors' elements one after another, matrices row
    by row and complex entries as real and imaginary part; `join` and `split` translate.  Velocities
    and momenta are those of the factors one after another.

    factors : groups of any kind, products and complex ones among them.  Raises InvalidType,
    InvalidInput for what is no group.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 1.12.
    """

    factors: tuple[Any, ...]

    def __init__(self, *factors: LieGroup) -> None:
        object.__setattr__(self, "factors", factors)
        self.__post_init__()

    def __post_init__(self) -> None:
        for number, factor in enumerate(self.factors, 1):
            require(f"ProductGroup: factor {number}", factor, LieGroup)
        if not self.factors:
            raise InvalidInput("ProductGroup needs at least one factor")

    def __repr__(self) -> str:
        return f"ProductGroup({', '.join(map(repr, self.factors))})"

    @cached_property
    def algebra(self) -> ProductAlgebra:
        return ProductAlgebra(tuple([factor.algebra for factor in self.factors]))

    @property
    def by_adjoint(self) -> LieGroup | None:
        """The product of the factors with the Cayley map of Ad_g; None if a factor has none."""
        factors = [factor.by_adjoint for factor in self.factors]
        return None if None in factors else ProductGroup(*factors)


# ------------------------------------------------------------------ parts of vectors


def spans(widths: list[int]) -> list[tuple[int, int]]:
    """Where parts of these widths begin and end, one after another."""
    return [(sum(widths[:i]), sum(widths[: i + 1])) for i in range(len(widths))]


def joined(parts: list[Vec]) -> Vec:
    """The parts as one vector, in their order."""
    return vec(*[x for part in parts for x in part])


def entries(g: Any) -> list[Any]:
    """The real numbers of an element: matrices row by row, complex entries as real and imaginary
    part.  Raises IncompatibleSystem for a matrix in memory.
    """
    if isinstance(g, Large):
        raise IncompatibleSystem(
            f"products write the elements of their factors out; matrices with {len(g)} rows lie in memory: take smaller ones"
        )
    numbers = [x for row in g for x in row] if isinstance(g, vectors.Mat) else [*g]
    if len(numbers) > 0 and isinstance(numbers[0], Complex):
        return [part for x in numbers for part in (x.re, x.im)]
    return numbers


def shaped(group: LieGroup, numbers: Any) -> Any:
    """The element of a group with these entries."""
    if group.is_complex:
        numbers = [Complex(numbers[k], numbers[k + 1]) for k in range(0, len(numbers), 2)]
    if len(group.element_shape) == 1:
        return vec(*numbers)
    rows, columns = group.element_shape
    return mat(*[vec(*numbers[i * columns : (i + 1) * columns]) for i in range(rows)])


def _stacked(equations: list[Any]) -> tuple[Vec, Mat, Mat]:
    """One equation r = 0 from several, and its derivatives, block by block."""
    r = joined([residual for residual, _, _ in equations])
    by_p = [x if isinstance(x, vectors.Mat) else _multiple(x, len(residual)) for residual, x, _ in equations]
    return r, _block_diagonal(by_p), _block_diagonal([x for _, _, x in equations])


def _multiple(x: float, n: int) -> Mat:
    """x times the unit matrix."""
    return mat(*[vec(*[x if i == j else 0.0 for j in range(n)]) for i in range(n)])


def _block_diagonal(blocks: list[Mat]) -> Mat:
    """The matrix with these blocks on its diagonal."""
    width = sum([len(block) for block in blocks])
    places = spans([len(block) for block in blocks])
    return mat(
        *[
            vec(*[0.0] * start, *row, *[0.0] * (width - end))
            for block, (start, end) in zip(blocks, places)
            for row in block
        ]
    )
