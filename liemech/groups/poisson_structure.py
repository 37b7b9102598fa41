"""Poisson structures: matrices B(y) that turn the gradient of an energy into its motion, and
brackets of functions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any, ClassVar, final

import numpy as np

from ..errors import InvalidInput, InvalidType, LawViolation, NotDefined, require, undefined
from ..formulas import Mat, Record, Vec, derivative, dot, exp, gradient, log, mat, plain, record, vec
from ..formulas.arrays import check_finite, real_array
from ..formulas.classes.derived import derived, derived_from
from .lie_group import LieGroup
from .linear_motion import linear_motion
from .matrices.matrix_group import whole_number
from .matrices.skew_matrices import null_vectors, pairs

Observable = Callable[[Any], Any]
"""A formula from points y, (n,), to numbers."""

KEPT = 2.0**-40
"""A bracket below this, relative to the terms it is the sum of, is zero up to rounding."""


@record
class PoissonStructure(Record):
    """A Poisson structure on R^n: {F, G}(y) = dF . B(y) dG, and the motion of an energy H is
    y' = B(y) dH(y).

    1. A subclass says its dimension `dim`, n, and writes `matrix(y)`, as a formula: skew-symmetric, with the
    Jacobi identity sum_l (d_l b_ij b_lk + d_l b_jk b_li + d_l b_ki b_lj) = 0.  `check_poisson` looks whether it
    is.
    2. It may write `casimirs`, say the `rank` that B has almost everywhere and the `unit_blocks`, and write in closed form `sharp`,
    the product B(y) a, and the motions whose energy is a coordinate, `coordinate_flow`, or p . y, `linear_motion`.
    3. Brackets, derivatives along motions and vector fields follow: formulas that compile, and may
    be bracketed again.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.2.
    """

    rank: ClassVar[int | None] = None

    # ---------------------------------------------------------------- 1. a subclass writes

    @property
    def dim(self) -> int:
        """The dimension n of the points y."""
        raise NotDefined(f"{type(self).__name__} must say its dimension, dim: ClassVar[int] = 3")

    def matrix(self, y: Vec) -> Mat:
        """B(y), (n, n).  y : (n,)."""
        raise undefined(self, "matrix")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """The numbers of coordinates, one after the other, that share a unit; by default each has its own."""
        return (1,) * self.dim

    @derived_from("matrix")
    def casimirs(self, y: Vec) -> Vec:
        """The functions C with B dC = 0, constant whatever the energy; none by default.  y : (n,),
        returns (number,).
        """
        return vec()

    @derived
    def sharp(self, y: Vec, a: Vec) -> Vec:
        """B(y) a: the velocity that belongs to a gradient.  y, a : (n,)."""
        return self.matrix(y) @ a

    @derived_from("matrix")
    def coordinate_flow(self, y: Vec, index: int, s: float) -> Vec:
        """Where y is after the time s if the coordinate y_index is the energy, y' = B(y) e_index.
        y : (n,), index from 0.
        """
        raise NotDefined(f"{type(self).__name__} knows no `coordinate_flow`")

    @derived_from("matrix")
    def linear_motion(self, y: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The change of y in a unit of time of the motion with the energy p . y, y' = B(y) p, and the mean of the
        change over that time.  y, p : (n,).
        """
        return linear_motion(self, y, p)

    # ---------------------------------------------------------------- 3. what follows

    @final
    def bracket(self, F: Observable, G: Observable) -> Observable:
        """The bracket {F, G}(y) = dF . B(y) dG of two formulas of y: again such a formula.

        F, G : from y, (n,), to a number, for instance `hamiltonian.energy`.  Along a motion
        F' = {F, H}.
        Raises InvalidType for what cannot be called.
        """
        require_formula("bracket", "F", F)
        require_formula("bracket", "G", G)

        def bracket_at(y: Any) -> Any:
            at = vec(*y)
            return dot(gradient(F, at), self.sharp(at, gradient(G, at)))

        return bracket_at

    @final
    def lie_derivative(self, F: Observable, H: Observable, times: int = 1) -> Observable:
        """The rate of change of F along the motion of H, {F, H}, or its derivative {{F, H}, H},
        ...: a formula of y.

        times : how often.  Source: Hairer, Lubich, Wanner, VII.2.1.
        """
        for _ in range(whole_number("lie_derivative", times, 1)):
            F = self.bracket(F, H)
        return F

    @final
    def hamiltonian_vector_field(self, H: Observable) -> Callable[[Any], Vec]:
        """The velocity y' = B(y) dH(y) of the motion of H: a formula of y."""
        require_formula("hamiltonian_vector_field", "H", H)

        def velocity(y: Any) -> Vec:
            at = vec(*y)
            return self.sharp(at, gradient(H, at))

        return velocity

    @final
    def is_invariant(self, F: Observable, H: Observable, points: Any = None, seed: int = 0) -> bool:
        """Whether F is constant along the motion of H, {F, H} = 0 up to rounding.

        points : (m, n), where to look; left out, five random points of size one.
        """
        return all(self.commute(F, H, y) for y in self._points(points, seed, "is_invariant"))

    @final
    def poisson_theorem(
        self, F: Observable, G: Observable, H: Observable, points: Any = None, seed: int = 0
    ) -> Observable:
        """Poisson's theorem: the bracket of two invariants of H is one more.  Returns {F, G}.

        points : as in `is_invariant`.  Raises LawViolation if F or G is no invariant of H there.

        Source: Hairer, Lubich, Wanner, VII.2.1.
        """
        for name, invariant in (("F", F), ("G", G)):
            for y in self._points(points, seed, "poisson_theorem"):
                if not self.commute(invariant, H, y):
                    rate = self.bracket(invariant, H)(y)
                    raise LawViolation(
                        f"poisson_theorem: {name} is no invariant of H: at y = {list(y)} its rate is {rate:.3g}"
                    )
        return self.bracket(F, G)

    @final
    def rank_at(self, y: Vec) -> int:
        """The rank of B(y), whatever the units of the coordinates are.  y : (n,)."""
        return 2 * len(pairs(np.array(self.matrix(y), dtype=float), self.terms(y)))

    @final
    def terms(self, y: Vec) -> np.ndarray:
        """The scale of the rounding of each entry of B(y), |b_ij| + sum_l |d_l b_ij y_l|.
        y : (n,), returns (n, n).
        """
        size = np.abs(np.array(self.matrix(y), dtype=float))
        return size + np.einsum("lij,l->ij", np.abs(slopes_of(self, y)), np.abs(np.array(y)))

    def __call__(self, y: Any) -> Any:
        """The matrix B(y) of the structure, as `matrix`."""
        return self.matrix(y)

    def commute(self, F: Observable, H: Observable, y: Vec) -> bool:
        """Whether {F, H} = 0 at a point, up to rounding.  y : (n,)."""
        a, b = np.array(gradient(F, y), dtype=float), np.array(gradient(H, y), dtype=float)
        terms = np.abs(a) @ np.abs(np.array(self.matrix(y), dtype=float)) @ np.abs(b)
        return bool(abs(self.bracket(F, H)(y)) <= KEPT * terms)

    def _points(self, points: Any, seed: int, method: str) -> list[Vec]:
        if points is None:
            points = np.random.default_rng(seed).normal(size=(5, self.dim))
        array = np.atleast_2d(real_array(points, f"{method}: points"))
        if array.shape[1:] != (self.dim,):
            raise InvalidInput(f"{method}: points must have shape (m, {self.dim}); got {array.shape}")
        check_finite(array, f"{method}: points")
        return [Vec.of(row) for row in array.tolist()]

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.dim,) if kind == "Vec" else None


def require_formula(method: str, name: str, value: Any) -> None:
    """Refuse what is no formula, where a formula says so too: by its type, without asking whether
    it can be called.
    """
    if isinstance(value, (float, int, str, tuple, list, np.ndarray, Record)) or value is None:
        what = "a formula of momenta, or of points y, as `hamiltonian.energy` is"
        raise InvalidType(f"{method}: {name} must be {what}; got {value!r}")


# ---------------------------------------------------------------- constant ones


@record
class Canonical(PoissonStructure):
    """The canonical structure of R^2n, y = (q, p): B = [[0, 1], [-1, 0]], {q_i, p_j} = delta_ij.

    degrees : n.  Books that write y = (p, q) have the negative matrix, and the same brackets.

    Source: Hairer, Lubich, Wanner, VII.2.1.
    """

    degrees: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "degrees", whole_number(type(self).__name__, self.degrees, 1))

    @property
    def dim(self) -> int:
        return 2 * self.degrees

    @property
    def rank(self) -> int:  # type: ignore[override]
        """The rank 2n: the structure is symplectic everywhere."""
        return 2 * self.degrees

    def matrix(self, y: Vec) -> Mat:
        """[[0, 1], [-1, 0]].  y : (2n,)."""
        n = self.degrees
        return mat(*[vec(*[float(j == i + n) - float(i == j + n) for j in range(2 * n)]) for i in range(2 * n)])

    def sharp(self, y: Vec, a: Vec) -> Vec:
        """(a_p, -a_q).  y, a : (2n,)."""
        n = self.degrees
        return vec(*[a[i + n] for i in range(n)], *[-a[i] for i in range(n)])

    def linear_motion(self, y: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The straight line y + s B p.  y, p : (2n,)."""
        change = self.sharp(y, p)
        return change, 0.5 * change

    def coordinate_flow(self, y: Vec, index: int, s: float) -> Vec:
        """The conjugate coordinate moves, y + s B e_index.  y : (2n,)."""
        n = self.degrees
        return vec(*[y[i] + s if i + n == index else y[i] - s if i == index + n else y[i] for i in range(2 * n)])


@record
class _OfMatrix(PoissonStructure):
    """A structure made of one skew-symmetric matrix, `values`, (n, n), with null vectors, `kernel`,
    for its Casimirs; abstract.
    """

    values: Mat
    kernel: tuple[Vec, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        array = skew(self.values, f"{type(self).__name__}: values")
        object.__setattr__(self, "kernel", null_vectors(array))
        super().__post_init__()

    @property
    def dim(self) -> int:
        return len(self.values)

    @property
    def rank(self) -> int:  # type: ignore[override]
        """n less the number of Casimirs."""
        return len(self.values) - len(self.kernel)


@record
class ConstantStructure(_OfMatrix):
    """A structure that is the same everywhere, {y_i, y_j} = b_ij: any skew-symmetric matrix.

    values : B, (n, n).  Its Casimirs are the linear functions k . y with B k = 0.  Raises
    InvalidInput if B is not skew-symmetric.

    Source: Hairer, Lubich, Wanner, VII.2.2.
    """

    def matrix(self, y: Vec) -> Mat:
        """The values.  y : (n,)."""
        return self.values

    def casimirs(self, y: Vec) -> Vec:
        """k . y for a basis of the null space.  y : (n,)."""
        return vec(*[dot(k, y) for k in self.kernel])

    def linear_motion(self, y: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The straight line y + s B p.  y, p : (n,)."""
        change = self.sharp(y, p)
        return change, 0.5 * change

    def coordinate_flow(self, y: Vec, index: int, s: float) -> Vec:
        """y + s B e_index.  y : (n,)."""
        return vec(*[y[i] + s * self.values[i, index] for i in range(len(y))])


# ---------------------------------------------------------------- others


@record
class LogCanonical(_OfMatrix):
    """A structure that is constant in the logarithms of the coordinates, {y_i, y_j} = c_ij y_i y_j:
    that of Lotka and Volterra.

    values : the skew-symmetric matrix c, (n, n).  Its Casimirs are the products of y_i^k_i with c
    k = 0, of which this takes the logarithms, for y_i > 0.

    Raises InvalidInput if c is not skew-symmetric.  Source: Hairer, Lubich, Wanner, VII.2.2; Plank,
    J. Math.  Phys. 36 (1995), 3520.
    """

    of_logarithms: ConstantStructure | None = field(init=False, repr=False)  # None of a subclass with another B

    def __post_init__(self) -> None:
        super().__post_init__()
        constant = ConstantStructure(self.values) if type(self).sharp is LogCanonical.sharp else None
        object.__setattr__(self, "of_logarithms", constant)

    def matrix(self, y: Vec) -> Mat:
        """c_ij y_i y_j.  y : (n,)."""
        n, c = len(y), self.values
        return mat(*[vec(*[c[i, j] * (y[i] * y[j]) for j in range(n)]) for i in range(n)])

    def sharp(self, y: Vec, a: Vec) -> Vec:
        """y (c (y a)), products of components.  y, a : (n,)."""
        return y * (self.values @ (y * a))

    def casimirs(self, y: Vec) -> Vec:
        """sum k_i ln y_i for a basis of the null space of c.  y : (n,), positive."""
        logs = vec(*[log(a) for a in y])
        return vec(*[dot(k, logs) for k in self.kernel])

    def coordinate_flow(self, y: Vec, index: int, s: float) -> Vec:
        """y_i exp(s c_i,index y_index): positive for every s.  y : (n,)."""
        start = plain(y)
        rate = s * start[index]
        return vec(*[y[i] if i == index else start[i] * exp(self.values[i, index] * rate) for i in range(len(y))])


@record
class LiePoissonStructure(PoissonStructure):
    """The structure of the dual of a Lie algebra, {mu_i, mu_j} = -+ c^k_ij mu_k.

    group : whose algebra it is.  sign : -1, the minus bracket, for momenta in the body, as
    everywhere in this library; +1 for momenta in space.  With `SemidirectProduct` it is that of
    heavy tops and fluids.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 13.1.
    """

    group: LieGroup
    sign: int = -1

    def __post_init__(self) -> None:
        require(f"{type(self).__name__}: group", self.group, LieGroup)
        if type(self.sign) is not int or self.sign not in (-1, 1):
            raise InvalidInput(
                f"{type(self).__name__}: sign is -1 (momenta in the body) or 1 (in space); got {self.sign!r}"
            )

    @property
    def dim(self) -> int:
        return self.group.dim

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """The blocks of equal units of the group, which momenta have too."""
        return self.group.unit_blocks

    @property
    def opposite(self) -> LiePoissonStructure:
        """The structure with the other sign."""
        return LiePoissonStructure(self.group, -self.sign)

    def matrix(self, y: Vec) -> Mat:
        """-+ c^k_ij y_k.  y : (dim,), a momentum."""
        B = self.group.algebra.poisson_structure(y)
        return B if self.sign == -1 else -B

    def casimirs(self, y: Vec) -> Vec:
        """The Casimirs of the group.  y : (dim,)."""
        return self.group.casimirs(y)

    def sharp(self, y: Vec, a: Vec) -> Vec:
        """ad*_a y, or its negative.  y, a : (dim,)."""
        rate = self.group.ad_star(a, y)
        return rate if self.sign == -1 else -rate

    def linear_motion(self, y: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The motion Ad*_exp(s p) y, with the mean (dexp_p)* y, right-trivialised.  y, p : (dim,)."""
        mean = self.group.algebra.dexp_dual(-p if self.sign == -1 else p, y)
        return self.sharp(mean, p), mean - y

    def coordinate_flow(self, y: Vec, index: int, s: float) -> Vec:
        """Ad* of exp(-+ s E_index).  y : (dim,)."""
        turn = s if self.sign == -1 else -s
        return self.group.exp_Ad_star(vec(*[turn if i == index else 0.0 for i in range(self.group.dim)]), y)


def slopes_of(structure: PoissonStructure, y: Vec) -> np.ndarray:
    """The derivatives d_l b_ij of the entries of B(y), (n, n, n), l first.  y : (n,)."""
    units = np.eye(len(y)).tolist()
    return np.array([np.array(derivative(structure.matrix, y, unit), dtype=float) for unit in units])


def jacobi_sums(slopes: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """The sums sum_l (d_l b_ij b_lk + d_l b_jk b_li + d_l b_ki b_lj), which Jacobi's identity makes zero, (n, n, n).

    slopes : d_l b_ij, (n, n, n), l first.  matrix : B, (n, n).
    """
    nested = np.einsum("lij,lk->ijk", slopes, matrix)
    return nested + nested.transpose(2, 0, 1) + nested.transpose(1, 2, 0)  # ijk, jki, kij


def skew(value: Any, name: str) -> np.ndarray:
    """A skew-symmetric matrix, or InvalidInput."""
    array = real_array(value, name)
    if array.ndim != 2 or array.shape[0] != array.shape[1] or not array.size:
        raise InvalidInput(f"{name} must be a square matrix; got shape {array.shape}")
    check_finite(array, name)
    off = np.abs(array + array.T)
    i, j = np.unravel_index(int(off.argmax()), off.shape)
    if off[i, j] > 0.0:
        pair = f"entries ({i + 1}, {j + 1}) and ({j + 1}, {i + 1}) are {array[i, j]:g} and {array[j, i]:g}"
        raise InvalidInput(f"{name} must be skew-symmetric; {pair}")
    return array
