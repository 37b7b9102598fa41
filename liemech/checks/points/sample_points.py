"""The points at which laws are checked: at the neutral element, 1e-8 beside it, at random, with
coordinates of mixed sizes, along each axis, and on both sides of where `dexp` is singular.  The
size of a velocity is that of ad_xi: in radians, for rotations.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...formulas import Vec
from ...formulas.vectors import small
from ...groups.lie_group import LieGroup
from ...systems.system import lies_in_memory
from ..report import shown
from .like_units import GroupInUnits
from .seeds import generator

STEP = 0.01
"""The step of differences, where velocities have size one: truncation below 1e-15, for the Cayley
map too, and rounding 1/STEP.
"""

STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
"""f' = sum of weight (f(k STEP) - f(-k STEP))/STEP over the pairs (k, weight), of order eight.

Source: Fornberg, Generation of finite difference formulas on arbitrarily spaced grids, Math. Comp.
51 (1988), table 1.
"""

FAR = 12.0
"""How far out where nothing becomes singular."""

MANY = 20
"""Beyond this dimension brackets of all axes are asked for at once, and derivatives by all components are
looked at in one place.
"""

LARGE = 6
"""Up to this dimension all axes are visited; in higher ones three, drawn by lot."""


# ---------------------------------------------------------------- numbers


def flat(value: Any) -> np.ndarray:
    """A formula's value as one real vector."""
    array = np.asarray(value).ravel()
    return array.view(float) if array.dtype.kind == "c" else array.astype(float)


def size(value: Any) -> float:
    """The Euclidean norm of all components."""
    return float(np.linalg.norm(flat(value)))


def of_rows(f: Callable[[Any], Any], rows: np.ndarray) -> np.ndarray:
    """A formula's values for all rows; where these are long, all in one call."""
    if rows.shape[1] > LARGE:
        images = np.asarray(f(rows)).reshape(len(rows), -1)
        return images.view(float) if images.dtype.kind == "c" else images
    return np.stack([flat(f(Vec.of(row))) for row in rows.tolist()])


def slope(f: Callable[[float], Any], step: float = STEP) -> np.ndarray:
    """The derivative f'(0) by central differences."""
    return np.asarray(sum([(weight / step) * (flat(f(k * step)) - flat(f(-k * step))) for k, weight in STENCIL]))


def exponential(a: np.ndarray) -> np.ndarray:
    """e^a = (e^(a/2^k))^(2^k): the series of a small matrix, squared k times."""
    if not np.isfinite(a).all():
        return np.full(a.shape, np.nan)
    halvings = max(0, 2 + math.frexp(float(np.abs(a).sum(axis=0).max()))[1])
    small = a / 2.0**halvings  # |small| <= 1/4
    less_one = small / 14.0
    for k in range(13, 0, -1):
        less_one = (small + small @ less_one) / k
    for _ in range(halvings):
        less_one = 2.0 * less_one + less_one @ less_one
    return np.asarray(np.eye(len(a)) + less_one)


def phi1(a: np.ndarray) -> np.ndarray:
    """(e^a - 1)/a = 1 + a/2 + a^2/6 + ..., a block of an exponential."""
    n = len(a)
    return exponential(np.block([[a, np.eye(n)], [np.zeros((n, 2 * n))]]))[:n, n:]


def turning(a: np.ndarray) -> tuple[float, float]:
    """The largest imaginary and the largest real part among the eigenvalues of a."""
    if not np.isfinite(a).all():
        return math.inf, math.inf
    eigenvalues = np.linalg.eigvals(a)
    # eigenvalues of nilpotent matrices are zero only to a root of the rounding
    floor = 1e-3 * np.abs(a).max(initial=0.0)
    spread = [float(np.abs(part).max(initial=0.0)) for part in (eigenvalues.imag, eigenvalues.real)]
    return tuple(x if x > floor else 0.0 for x in spread)  # type: ignore[return-value]


# ---------------------------------------------------------------- points


@dataclass(frozen=True)
class Units:
    """The natural scales of a group: the constants of its bracket, a unit of velocity, the weight
    of its elements.
    """

    group: LieGroup

    @property
    def dim(self) -> int:
        return self.group.dim

    @cached_property
    def axes(self) -> list[Vec]:
        """The basis of the algebra."""
        return [Vec.of(row) for row in np.eye(self.dim).tolist()]

    @cached_property
    def constants(self) -> np.ndarray:
        """c[i, j] = [E_i, E_j], asked of the bracket; of long vectors of all at once."""
        if self.dim > MANY:
            units = np.eye(self.dim)
            return np.asarray(self.group.algebra.bracket(units[:, None], units[None]))
        return np.array([[flat(self.group.algebra.bracket(a, b)) for b in self.axes] for a in self.axes])

    def ad(self, xi: Vec) -> np.ndarray:
        """The matrix of ad_xi, from the structure constants."""
        if lies_in_memory(self.group):
            return np.tensordot(flat(xi), self.constants, 1).T
        return np.einsum("i,ijk->kj", flat(xi), self.constants)

    def bracket_size(self, *velocities: Vec) -> float:
        """The size of the largest terms of a nested bracket of velocities."""
        total = np.abs(flat(velocities[-1]))
        for xi in velocities[-2::-1]:
            total = np.einsum("i,j,ijk->k", np.abs(flat(xi)), total, np.abs(self.constants))
        return float(total.max(initial=0.0))

    def hat(self, xi: Vec) -> np.ndarray | None:
        """The matrix of a velocity; None if the algebra has none."""
        try:
            return np.asarray(self.group.algebra.hat(xi))
        except NotImplementedError:
            return None

    @cached_property
    def are_matrices(self) -> bool:
        """Whether the elements of the group are matrices like those of its algebra, with the unit matrix among them."""
        e, x = np.asarray(self.group.identity()), self.hat(self.axes[0])
        return x is not None and e.ndim == 2 and e.shape == x.shape and np.array_equal(e, np.eye(len(e)))

    def length(self, xi: Vec) -> float:
        """The size of a velocity: the norm of ad_xi, of its matrix if it commutes with all, else of
        its coordinates.
        """
        matrices = self.ad(xi), self.hat(xi), np.diag(flat(xi))
        norms = [float(np.linalg.norm(a, 2)) for a in matrices if a is not None and np.isfinite(a).all()]
        return next((n for n in norms if n > 0.0), 1.0)

    @cached_property
    def lengths(self) -> np.ndarray:
        """The sizes of E_1, ..., E_dim.  (dim,)"""
        return np.array([self.length(axis) for axis in self.axes])

    def of_unit_length(self, xi: np.ndarray) -> Vec:
        return Vec.of((xi * (1.0 / self.length(Vec.of(xi.tolist())))).tolist())

    @cached_property
    def weight(self) -> float:
        """The size of elements not far from the neutral one."""
        g = self.group
        return max(size(g.identity()), *(size(g.exp(a * (1.0 / r))) for a, r in zip(self.axes, self.lengths))) or 1.0

    @cached_property
    def tangents(self) -> np.ndarray:
        """The velocities E_1, ..., E_dim as columns of changes of an element at e."""

        units = np.diag(1.0 / self.lengths)
        changes = slope(lambda s: of_rows(self.group.exp, s * units)).reshape(self.dim, -1)
        return np.asarray((self.lengths[:, None] * changes).T)

    @cached_property
    def _inverse_tangents(self) -> np.ndarray:
        return np.linalg.pinv(self.tangents)

    def coordinates(self, change: np.ndarray) -> np.ndarray:
        """The velocity whose change at e this is, by least squares."""
        if lies_in_memory(self.group):
            return np.asarray(self._inverse_tangents @ change)
        return np.asarray(np.linalg.lstsq(self.tangents, change, rcond=None)[0])


@dataclass(frozen=True, eq=False)
class At:
    """A point: a velocity xi of the named size, two of size one, two momenta, and three elements of
    the group.
    """

    name: str
    units: Units
    xi: Vec
    eta: Vec
    zeta: Vec
    mu: Vec
    nu: Vec
    point: Any = None

    @property
    def group(self) -> LieGroup:
        return self.units.group

    @property
    def dim(self) -> int:
        return self.units.dim

    @property
    def axes(self) -> list[Vec]:
        return self.units.axes

    @cached_property
    def g(self) -> Any:
        return self.group.exp(self.xi)

    @cached_property
    def h(self) -> Any:
        return self.group.exp(self.eta)

    @cached_property
    def k(self) -> Any:
        return self.group.exp(self.zeta)

    @cached_property
    def back(self) -> Any:
        """The inverse g^-1 of the element."""
        return self.group.inverse(self.g)

    @cached_property
    def ad(self) -> np.ndarray:
        """The matrix of ad_xi, (dim, dim)."""
        return self.units.ad(self.xi)

    @cached_property
    def Ad(self) -> np.ndarray:
        """The matrix of Ad_g, (dim, dim)."""
        return of_rows(lambda a: self.group.Ad(self.g, a), np.eye(self.dim)).T

    @cached_property
    def length(self) -> float:
        """The spectral norm of the matrix of ad_xi."""
        return float(np.linalg.norm(self.ad, 2))

    @cached_property
    def spectrum(self) -> tuple[float, float]:
        """The turning and stretching of xi: the largest imaginary and real parts of eigenvalues of ad_xi and of its
        matrix.
        """
        x = self.units.hat(self.xi)
        turns, stretches = zip(*[turning(a) for a in (self.ad, x) if a is not None], strict=True)
        return max(turns), max(stretches)

    @cached_property
    def inside(self) -> bool:
        """Whether xi turns by less than a full turn, where `dexp` is singular."""
        return self.spectrum[0] < 2.0 * math.pi

    def share(self, *elements: Any) -> float:
        """By how much factors may enlarge a rounding."""
        return math.prod(max(1.0, size(g) / self.units.weight) for g in elements)

    def elements(self, *elements: Any) -> float:
        """The size of the rounding of a product."""
        return self.units.weight * self.share(*elements)

    @cached_property
    def condition(self) -> float:
        """By how much conjugation with g may enlarge a rounding."""
        return self.share(self.g, self.back) * (1.0 + float(np.linalg.norm(self.Ad, 2)))

    def shaped(self, numbers: np.ndarray) -> Any:
        """Real numbers in the shape of an element."""
        numbers = numbers.view(complex) if self.group.is_complex else numbers
        return small(numbers.reshape(self.group.element_shape))

    def disturbed(self, g: Any) -> Any:
        """An array off an element by a thousandth, in no particular direction."""
        change = np.random.default_rng(len(self.name)).normal(size=flat(g).size)
        return self.shaped(flat(g) + 1e-3 * self.units.weight * change)

    def __str__(self) -> str:
        group, xi = self.group, self.xi
        in_units = group.units * xi if isinstance(group, GroupInUnits) else xi
        return f"{self.name}, {shown('xi', in_units)}"


def sample_points(group: LieGroup, seed: int) -> list[At]:
    """The points at which the laws of a group are checked."""
    rng, units = generator("check", seed), Units(group)
    n = units.dim

    def unit() -> np.ndarray:
        return flat(units.of_unit_length(rng.normal(size=n)))

    def at(name: str, xi: np.ndarray) -> At:
        return At(
            name, units, *(Vec.of(v.tolist()) for v in (xi, unit(), unit(), rng.normal(size=n), rng.normal(size=n)))
        )

    points = [at("the neutral element", 0.0 * unit()), at("size 1e-8", 1e-8 * unit())]
    points += [at("random", 1.3 * unit()), at("random", unit())]
    points += [at("mixed sizes", unit() * 10.0 ** -rng.integers(0, 9, size=n)) for _ in range(3 if n <= LARGE else 1)]
    for i in range(n) if n <= LARGE else sorted(rng.choice(n, 3, replace=False)):
        points.append(at(f"along axis {i + 1}", flat(units.of_unit_length(np.eye(n)[i]))))
    u = unit()
    imaginary, real = turning(units.ad(Vec.of(u.tolist())))
    turn = 2.0 * math.pi / imaginary if imaginary else math.inf
    far = min(0.95 * turn, 3.0 / real if real else FAR, FAR)
    points.append(at(f"size {far:.2g}", far * u))
    if 0.95 * turn <= far:  # before and behind the place where `dexp` is singular
        for part in (0.995, 1.6):
            large = at(f"size {part * turn:.3g}", part * turn * u)
            points.append(dataclasses.replace(large, mu=20.0 * large.mu, nu=0.1 * large.nu))
    return points
