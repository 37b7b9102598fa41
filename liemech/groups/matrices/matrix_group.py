"""Groups of matrices from generators alone: every map follows, compiled for small matrices, through
NumPy for large ones.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, NotDefined
from ...formulas import Ambient, Complex, Element, Mat, Vec, dot, identity_matrix, mat, record, sqrt, vec
from ...formulas.elimination import determinant, inverse, solve_matrix
from ...formulas.large import Large
from ...formulas.sums import abs2, scaled, total
from ..lie_group import MEMBERSHIP, LieGroup
from . import matrix_arrays
from .casimir_polynomials import casimir_polynomials
from .matrix_algebra import MatrixLieAlgebra, adjoint
from .matrix_basis import MatrixBasis, basis_of
from .matrix_functions import expm1, frobenius2, log1pm, logm, plus
from .matrix_invariants import Invariants, invariants_of, objections
from .nearest import nearest


@record
class MatrixLieGroup(LieGroup):
    """A connected group of real or complex matrices, given by generators alone: a basis of its Lie
    algebra.

        class Heisenberg(lm.MatrixLieGroup):
            generators = np.array([...])                     # (dim, n, n)

    The generators may depend on fields (`@record`, and `generators` a property), or be a value:
    `MatrixLieGroup.of(generators)`.  Coordinates are real, of complex matrices too.  From the
    generators follow the structure constants, the exponential and the logarithm, the coadjoint
    action, their differentials, the Cayley family where the algebra is closed under x y x, and what
    all elements leave alone: an array that does not is no element.

    Raises InvalidInput, InvalidType for generators that are no square matrices of finite numbers,
    LawViolation if they are linearly dependent or not closed under the bracket.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., chapters 2, 3 and 5;
    Higham, Functions of Matrices (2008).
    """

    def __new__(cls, *arguments: Any, **options: Any) -> Any:
        if cls is MatrixLieGroup:
            raise NotDefined(
                "MatrixLieGroup is abstract: write MatrixLieGroup.of(generators), or a subclass with `generators`"
            )
        return super().__new__(cls)

    # ---------------------------------------------------------------- 1. a subclass writes

    @property
    def generators(self) -> Any:
        """A basis E_1, ..., E_dim of the algebra.  (dim, n, n), real or complex."""
        raise NotDefined(f"{type(self).__name__} must define `generators`, an array of shape (dim, n, n)")

    @staticmethod
    def of(generators: Any) -> MatrixLieGroup:
        """The group with these generators.  generators : (dim, n, n)."""
        return GeneratedGroup(generators)

    # ---------------------------------------------------------------- what the generators say

    @cached_property
    def generated(self) -> MatrixBasis:
        """The generators, checked, and the constants that follow from them."""
        return basis_of(self.generators, type(self).__name__)

    @cached_property
    def is_large(self) -> bool:
        return self.generated.large

    @cached_property
    def algebra(self) -> MatrixLieAlgebra:
        return MatrixLieAlgebra(self)

    @cached_property
    def invariants(self) -> Invariants:
        """The invariants of all elements: vectors, forms, the determinant; in units where entries
        are of like sizes.
        """
        return invariants_of(self.generated.core)

    def _in_core(self, g: Mat) -> Mat:
        """An element in these units, a conjugate matrix."""
        factors = self._factors
        n = len(factors)
        if n == 0:
            return g
        return mat(*[vec(*[scaled(factors[i][j], g[i, j]) for j in range(n)]) for i in range(n)])

    @cached_property
    def _factors(self) -> tuple[tuple[float, ...], ...]:
        """The factors of the entries of an element in these units, powers of two; none if all are 1."""
        d = self.generated.units[1]
        return () if (d == 1.0).all() else tuple(map(tuple, np.outer(1.0 / d, d).tolist()))

    # ---------------------------------------------------------------- group

    def identity(self) -> Element:
        return _constant(np.eye(self.generated.n, dtype=self._kind), self.is_large)

    @property
    def _kind(self) -> type:
        return complex if self.generated.complex else float

    def inverse(self, g: Element) -> Element:
        """B^-1 g^T B where the group keeps a form B that makes this cheap, else by elimination."""
        b = self._form
        if self.is_large and self.keeps_lengths:
            return adjoint(g)
        if b is None or self.is_large:
            return inverse(g)
        return mat(*[vec(*[scaled(b[i] * b[j], _of(g, j, i)) for j in range(len(b))]) for i in range(len(b))])

    @cached_property
    def _form(self) -> tuple[float, ...] | None:
        """The diagonal of an invariant form, if it is diagonal with entries 1 and -1: its own
        inverse.
        """
        if self._factors:
            return None
        for b in self.invariants.hermitian if self.generated.complex else self.invariants.forms:
            diagonal = np.diag(b)
            if (
                np.array_equal(b, np.diag(diagonal))
                and (np.abs(diagonal) == 1.0).all()
                and not np.any(np.imag(diagonal))
            ):
                return tuple(float(x) for x in np.real(diagonal))
        return None

    over_duals: ClassVar[bool] = False  # are its elements and momenta pairs, matrices over the dual numbers?

    @cached_property
    def keeps_lengths(self) -> bool:
        """Whether all elements are orthogonal or unitary."""
        return self._form is not None and min(self._form) == 1.0

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The momentum of g^H M g^-H, M the matrix that stands for mu."""
        return self.algebra._coadjoint(g, self.inverse(g), mu)

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        return plus(expm1(self.algebra.hat(xi)), 1.0)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """g + g (exp(xi) - 1): rounded by what the step adds, not by what is there."""
        return g + g @ expm1(self.algebra.hat(xi))

    def log(self, g: Element) -> Vec:
        """The principal logarithm, by square roots, corrected on the group; InvalidInput if there
        is none in the algebra.

        The correction is log(exp(xi) h) = xi + dexp_xi^-1 log h + ... (left) of h = exp(-xi) g,
        which is close to 1.  Where an eigenvalue is -1 there may be several; one is found from a
        neighbour of g.
        """
        xi, off2, near, tries = self.algebra.vee(plus(g, -1.0)), 1.0, g, 0.0
        while off2 > 1e-20 and tries < 2.0:
            xi = self.algebra.vee(logm(near))
            remainder = plus(self.exp(-xi) @ g, -1.0)
            off2, turns = frobenius2(remainder), 0.0
            while 1e-31 < off2 < 0.01 and turns < 6.0:
                xi = xi + self.dexp_inv(xi, self.algebra.vee(log1pm(remainder)))
                remainder = plus(self.exp(-xi) @ g, -1.0)
                off2, turns = frobenius2(remainder), turns + 1.0
            off2 = off2 if off2 < 1.0 else 1.0
            near, tries = g @ self._neighbour, tries + 1.0
        if off2 > 1e-16 * max(1.0, frobenius2(g)):
            raise InvalidInput(
                f"{type(self).__name__}.log: the element has no principal logarithm in the "
                "algebra: an eigenvalue is negative or zero, or it is no exponential"
            )
        return xi

    @cached_property
    def _neighbour(self) -> Mat:
        """An element close to the identity, in no special direction."""
        direction = np.cos(np.arange(1.0, self.dim + 1.0))
        x = self.generated.hat(direction)
        small = _constant(1e-3 / np.linalg.norm(x) * x, self.is_large)
        return _constant(np.array(expm1(small)) + np.eye(len(x)), self.is_large)

    # ---------------------------------------------------------------- Cayley map

    def why_no_cayley(self) -> str | None:
        return self.generated.without_cayley

    def _require_cayley(self) -> None:
        if self.why_no_cayley() is not None:
            raise IncompatibleSystem(f"{type(self).__name__} has no Cayley map: {self.why_no_cayley()}")

    def cayley(self, xi: Vec) -> Element:
        """1 + (1 - x/2)^-1 x with the matrix x."""
        return plus(self._cayley1(xi), 1.0)

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """g + g (cay(xi) - 1)."""
        return g + g @ self._cayley1(xi)

    def _cayley1(self, xi: Vec) -> Mat:
        """The Cayley map less the unit matrix, cay(xi) - 1."""
        self._require_cayley()
        x = self.algebra.hat(xi)
        if self.is_large:
            return x.over(plus(-0.5 * x, 1.0))
        return solve_matrix(plus(-0.5 * x, 1.0), x)

    def cayley_inv(self, g: Element) -> Vec:
        """2 (g - 1)(g + 1)^-1; InvalidInput if -1 is an eigenvalue of g."""
        self._require_cayley()
        return self.algebra.vee(2.0 * (plus(g, -1.0) @ inverse(plus(g, 1.0))))

    def why_not_isospectral(self) -> str | None:
        """Why momenta, as matrices, do not move by conjugation and stay in the algebra under Cayley
        maps; None if they do.
        """
        basis = self.generated
        x = basis.hat(np.random.default_rng(2).normal(size=(basis.dim,)))
        defect = float(basis.sticks_out(np.conj(x.T)) / np.linalg.norm(x))
        if defect > 1e-10:
            return f"its algebra is not closed under the adjoint: that of an element sticks out by {defect:.1e}"
        if basis.dim >= basis.n**2 - 1 and (self.keeps_lengths or not basis.complex):
            return None  # the trace is kept by every conjugation
        return self.why_no_cayley()

    @cached_property
    def times_i(self) -> Large:
        """i times the unit matrix, in memory."""
        return Large(1j * np.eye(self.generated.n))

    # ---------------------------------------------------------------- Casimir functions

    def casimirs(self, mu: Vec) -> Vec:
        """The Casimirs found from the generators: momenta along the centre, quadratic forms, traces of
        powers of a matrix made of mu.

        As many as are independent; on a group without an invariant form there may be more of them
        than these.
        """
        if self.is_large:
            return Vec.of(matrix_arrays.casimirs(self, np.array(mu)[None])[0])
        linear, quadratic, powers, from_form = self._polynomials
        values = [dot(z, mu) for z in linear] + [dot(mu, q @ mu) for q in quadratic]
        if len(powers) > 0:
            m = self.algebra.hat(from_form @ mu)
            power = m @ m
            for k in range(3, max(powers) + 1):
                power = power @ m
                if k in powers:
                    trace = total([power[i, i] for i in range(len(power))])
                    values = [*values, trace.im if isinstance(trace, Complex) and k % 2 else _real(trace)]
        return vec(*values)

    @cached_property
    def _polynomials(self) -> tuple[Any, ...]:
        """The constants of the Casimir functions, as formulas take them."""
        core, u = self.generated.core, self.generated.units[0]
        of_core = self if core is self.generated else GeneratedGroup(core.generators)
        linear, quadratic, powers, from_form = casimir_polynomials(core, of_core.algebra)
        return (
            tuple([_constant(z / u) for z in linear]),
            tuple([_constant(q / np.outer(u, u)) for q in quadratic]),
            powers,
            _constant(from_form / np.outer(u, u) if len(from_form) else from_form),
        )

    # ---------------------------------------------------------------- adaptive steps

    def scale(self, g: Element | None) -> Vec:
        """For a generator E that shifts coordinates by others of another unit the size of what g has
        there, |g - 1| over |g E|, as the distance from the origin; 1 for other ones.
        """
        if g is None or not any(self.generated.shifts):
            return super().scale(None)
        core, sizes = self._in_core(g), []
        for unit, blocks in zip(identity_matrix(self.dim), self.generated.shifts):
            if not blocks:
                sizes.append(1.0)
                continue
            moved = self._in_core(g @ self.algebra.hat(unit))
            away, by = (total([abs2(x[i, j]) for j, rows in blocks for i in rows]) for x in (core, moved))
            sizes.append(sqrt(away / by))
        return vec(*sizes)

    # ---------------------------------------------------------------- membership

    def defect(self, g: Ambient) -> float:
        """The largest defect of the invariants, relative to the size of an element."""
        if isinstance(g, Large):
            return float(matrix_arrays.of_group(self, "defect", {"g": g.array[None]})[0])
        element, g = g, self._in_core(g)
        vectors, covectors, commuting, forms, hermitian, coforms, cohermitian, _, _ = self._laws
        spread = max(1.0, frobenius2(g) / len(g))
        if not spread < HUGE:
            return spread
        g_t, g_h = g.T, adjoint(g)
        second = [g_t @ b @ g - b for b in forms] + [g_h @ b @ g - b for b in hermitian]
        second = second + [g @ c @ g_t - c for c in coforms] + [g @ c @ g_h - c for c in cohermitian]
        first = [g @ v - v for v in vectors] + [w @ g - w for w in covectors]
        commutators = [g @ a - a @ g for a in commuting]
        of_forms = max([0.0, 0.0] + [abs2(x) for m in second for row in m for x in row]) / (spread * spread)
        of_vectors = max([0.0, 0.0] + [abs2(x) for v in first for x in v]) / spread
        of_matrices = max([0.0, 0.0] + [abs2(x) for m in commutators for row in m for x in row]) / spread
        others = max(self._determinant_defect(g), self._normaliser_defect(element), self._further_defect(g))
        return max(sqrt(max(of_forms, of_vectors, of_matrices)), others)

    def _determinant_defect(self, g: Mat) -> float:
        det, kind = determinant(g), self.invariants.determinant
        if kind in ("any", "positive"):
            return 0.0 if abs2(det) > 0.0 and (kind == "any" or det > 0.0) else 1.0
        scale = 1.0
        for row in g:
            scale = scale * sqrt(total([abs2(x) for x in row]))
        defect = sqrt(abs2(det - 1.0)) if kind == "1" else abs(sqrt(abs2(det)) - 1.0)
        return defect / max(1.0, scale)

    def _further_defect(self, g: Mat) -> float:
        """The largest defect of cubic forms and of directions that are stretched."""
        worst, spread, columns = 0.0, max(1.0, frobenius2(g) / len(g)), g.T
        *_, rays, cubic = self._laws
        for v in rays:
            image = g @ v
            difference = image - max(dot(v, image), 0.0) * v
            worst = max(worst, dot(difference, difference) / spread)
        for form in cubic:
            # T(g x, ., .) first, then the others
            once = [total([scaled(a, t) for a, t in zip(x, form)]) for x in columns]
            for i, contracted in enumerate(once):
                image = columns @ (contracted @ g) - form[i]
                worst = max(worst, *[abs2(x) / (spread * spread * spread) for row in image for x in row])
        return sqrt(worst)

    def _normaliser_defect(self, g: Mat) -> float:
        if self.invariants.enough:
            return 0.0
        worst, back = 0.0, self.inverse(g)
        for unit in identity_matrix(self.dim):
            moved = g @ self.algebra.hat(unit) @ back
            defect = frobenius2(moved - self.algebra.hat(self.algebra.vee(moved))) / frobenius2(moved)
            worst = max(worst, defect if defect >= 0.0 else 1.0)
        return sqrt(worst)

    @cached_property
    def _laws(self) -> tuple[tuple[Any, ...], ...]:
        """The invariants as constants of formulas, one kind after the other: tuples, whose content nobody
        has to compare.
        """
        kind = self._kind
        names = ("vectors", "covectors", "commuting", "forms", "hermitian", "coforms", "cohermitian", "rays")
        cubic = [t / np.abs(t).max() for t in self.invariants.cubic]
        laws = [[_constant(np.asarray(x, dtype=kind)) for x in getattr(self.invariants, name)] for name in names]
        forms = [tuple([_constant(np.asarray(m, dtype=kind)) for m in t]) for t in cubic]
        return (*map(tuple, laws), tuple(forms))

    def objection(self, g: np.ndarray) -> str | None:
        """The first of the invariants that it breaks, and by how much."""
        return next(
            (
                words
                for off, words in objections(self.invariants, self.generated.core, self.generated.to_core(g))
                if not off <= MEMBERSHIP
            ),
            None,
        )

    def nearest(self, g: Ambient) -> Element:
        """The element of least |h - g|: the polar factor, if all orthogonal or unitary matrices are
        elements.

        Raises InvalidInput for an array that is as close to several, or, on other groups, farther
        away than |g|/4; and where no exponentials were found that lead near to it.
        """
        return _constant(nearest(self, np.array(g)))

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        return matrix_arrays.of_group(self, method, arguments)


class Matrices:
    """Generators as one constant of native code: two of them are the same if all their entries are."""

    def __init__(self, array: np.ndarray) -> None:
        import hashlib

        self.array = array
        self.digest = hashlib.sha256(array.tobytes()).hexdigest()

    def __repr__(self) -> str:
        dim, n, _ = self.array.shape
        return f"{dim} {'complex' if np.iscomplexobj(self.array) else 'real'} matrices {n} x {n}, {self.digest[:16]}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Matrices) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


@record
class GeneratedGroup(MatrixLieGroup):
    """A group whose generators are a value: what `MatrixLieGroup.of` returns.

    matrices : (dim, n, n).
    """

    matrices: Any

    def __post_init__(self) -> None:
        if not isinstance(self.matrices, Matrices):
            object.__setattr__(self, "matrices", Matrices(basis_of(self.matrices, "MatrixLieGroup").generators))

    @property
    def generators(self) -> np.ndarray:
        return self.matrices.array

    def __repr__(self) -> str:
        return f"MatrixLieGroup.of({self.matrices})"


HUGE = 1e150


def named_by_size(self: Any) -> str:
    """The `__repr__` of a group or algebra with a size n: SO(4)."""
    return f"{type(self).__name__}({self.n})"


def whole_number(name: str, n: Any, smallest: int) -> int:
    """The size of a group, checked.  Raises InvalidInput."""
    if isinstance(n, bool) or not isinstance(n, (int, np.integer)):
        raise InvalidInput(f"{name}(n): n must be an integer; got {n!r}")
    if n < smallest:
        raise InvalidInput(f"{name}({n}): the smallest is {name}({smallest})")
    return int(n)


def _constant(array: np.ndarray, large: bool = False) -> Any:
    """A vector or matrix of constant numbers, for formulas."""
    if large:
        return Large(array)
    return Vec.of(array.tolist()) if array.ndim == 1 else Mat.of(array.tolist())


def _real(x: Any) -> Any:
    return x.re if isinstance(x, Complex) else x


def _of(g: Mat, i: int, j: int) -> Any:
    """The entry i, j, conjugated."""
    return g[i, j].conjugate() if isinstance(g[i, j], Complex) else g[i, j]
