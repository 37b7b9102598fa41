"""Steady motions of systems with symmetry, and whether they are stable: the energy-momentum method.

A relative equilibrium moves along the symmetries of its system, z' = sum_a w_a Z_a, Z_a the motion that the kept
momentum J_a generates: it is a critical point of the augmented energy

    H_w = H - sum_a w_a J_a,     J_a = j_a.

Near it, in the frame that moves along, z' = Omega^{-T} D^2 H_w z.  Where D^2 H_w, restricted to ker dJ without what the
symmetries move, is definite, the motion is stable; where the linearised motion grows, it is not.

Source: Simo, Lewis, Marsden, Stability of relative equilibria, part I, Arch. Rational Mech. Anal. 115 (1991); Marsden,
Lectures on Mechanics, chapter 5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InvalidInput, NoConvergence, warn
from ...formulas import vec
from ...formulas.classes.frozen import frozen
from ...groups.matrices.skew_matrices import like_sizes
from ...simulation.reports.written_tables import html_table
from .near_a_state import NearState, states_near
from .symmetries import STILL, changing, kept_momenta, momentum_slopes, nonzero, null_space, pivoted

TURNS = 60
"""Newton steps, of which a good guess takes ten."""

FARTHEST = 0.5
"""Beside its size, how far a step may move the state."""

SOLVED = 1e-9
"""Beside the size of the state, the defect after which one more step is rounding."""

DEPENDENT = 1e-9
"""Singular values beside the largest one that count as zero."""

ROUNDING = 2.0**-53

FINE = {"xatol": 1e-12, "fatol": 1e-15}
"""How finely the weights of momenta that move nothing are looked for."""

FEW_DIGITS = 1e-7
"""Beside the largest frequency, growth that may be rounding: double frequencies split by the root of it."""


@frozen
class RelativeEquilibrium:
    """A steady motion, and the motion near it; `print` it.

    state : of the system.  velocity : (v, mu') in the state, body velocity and rate of the momentum, (2 dim,).
    symmetries : how many momenta are kept.
    eigenvalues : of the motion near it, at the same momenta and but for what the symmetries move, complex.
    squares : the numbers of positive and of negative squares of the augmented energy there; None for a system with a
    load that has no potential.
    """

    state: Any
    velocity: np.ndarray
    symmetries: int
    eigenvalues: np.ndarray
    squares: tuple[int, int] | None

    @property
    def growth(self) -> float:
        """The largest rate at which a disturbance grows, in 1/s; 0 if none does, up to rounding."""
        rate = float(self.eigenvalues.real.max(initial=0.0))
        return rate if rate > FEW_DIGITS * np.abs(self.eigenvalues).max(initial=0.0) else 0.0

    @property
    def frequencies(self) -> np.ndarray:
        """The angular frequencies of small oscillations about the motion, in rad/s, ascending."""
        return np.sort(self.eigenvalues.imag[self.eigenvalues.imag > 0.0])

    @property
    def verdict(self) -> str:
        """`stable` (for all times, at the same momenta and but for a drift along the symmetries: the augmented energy is
        definite), `unstable` (a disturbance grows), `asymptotically stable` (all die out, under a load), or
        `spectrally stable` (none grows at first; the energy does not decide).
        """
        if self.growth:
            return "unstable"
        if self.squares is not None and len(self.eigenvalues) == max(self.squares):
            return "stable"
        size = np.abs(self.eigenvalues).max(initial=0.0)
        if self.squares is None and (self.eigenvalues.real < -FEW_DIGITS * size).all():
            return "asymptotically stable"
        return "spectrally stable"

    @property
    def _headline(self) -> str:
        if self.growth:
            why = f"a disturbance grows as exp({self.growth:.6g} t)"
        elif self.squares is None:
            why = "the energy is not kept, and says nothing"
        else:
            why = "the augmented energy has {} positive and {} negative squares".format(*self.squares)
        return f"relative equilibrium, {self.verdict}: {why}"

    def _rows(self, indent: int) -> list[tuple[str, str]]:
        """Names and numbers; what is rounding beside others is shown as 0."""
        shown = {
            **self.state.arrays,
            "velocity": self.velocity[: len(self.velocity) // 2],
            "frequencies": self.frequencies,
        }
        rows = []
        for name, x in shown.items():
            numbers = np.where(np.abs(x) > FEW_DIGITS**2 * np.abs(x).max(initial=0.0), x, 0.0)
            rows.append((name, np.array2string(numbers, precision=6, prefix=" " * indent)))
        return [*rows, ("symmetries", str(self.symmetries))]

    def __repr__(self) -> str:
        return "\n".join([self._headline, *(f"  {name:<12} {numbers}" for name, numbers in self._rows(15))])

    def _repr_html_(self) -> str:
        return html_table(self._headline, ("", ""), self._rows(0))


def relative_equilibrium(system: Any, guess: Any) -> RelativeEquilibrium:
    """The relative equilibrium near a state, of its momenta: a top that precesses without nodding, a satellite that
    always faces the planet, masses that turn as a triangle.

    system : a LiePoissonSystem, a MechanicalSystem, a CotangentSystem or a HamiltonianSystem, whose energy does not change
    with time.  Its symmetries are found from its equations: left and right translations of the group, and linear maps of
    positions.
    guess : a state, `system.state(...)`, near the equilibrium.  The momenta of its symmetries are kept.

    Newton's method for the critical point of H - sum_a w_a J_a at J_a = j_a, each step the shortest one, as states that
    the symmetries move to are equilibria too.  Returns a RelativeEquilibrium, with its frequencies and a verdict.
    Raises IncompatibleSystem for other systems, InvalidInput for units in which squares leave the range of numbers,
    NoConvergence if there is no relative equilibrium of these momenta near the guess.  Warns where a fold, at which two of
    them merge, may lie between the guess and what was found.

    Source: Simo, Lewis, Marsden, Stability of relative equilibria, part I, Arch. Rational Mech. Anal. 115 (1991).
    """
    near = states_near("relative_equilibrium", system, guess)
    sizes = near.sizes()
    least, most = np.sqrt([np.finfo(float).tiny, np.finfo(float).max])
    if not ((sizes == 0.0) | ((least < sizes) & (sizes < most))).all():
        raise InvalidInput(
            f"relative_equilibrium: displacements of {sizes.min():.0e} to {sizes.max():.0e} have squares beyond the range of "
            "numbers; tell the system in other units"
        )
    near.require_autonomous("relative_equilibrium", sizes)
    conserved, changes = kept_momenta(near, sizes)
    moving = changing(near, sizes, conserved, changes)
    w = _weights(near, sizes, moving, slice(near.dim))  # by the velocity: forces are what is out of balance
    before = _with_motion_near(near, sizes, conserved, moving, w, True).squares
    near, w = _critical_point(near, sizes, conserved, changes)
    steady = _with_motion_near(near, near.sizes(sizes), conserved, changing(near, sizes, conserved, changes), w)
    after = steady.squares
    if before and after and sum(before) == sum(after) and (before[1] - after[1]) % 2:
        warn(
            f"relative_equilibrium: the augmented energy has {before[1]} negative squares at the guess and {after[1]} at what "
            "was found: between them may lie a fold, where two relative equilibria merge, and this be the other one. Follow "
            "one that you know, in small steps of its momenta",
            RuntimeWarning,
        )
    return steady


def _weights(near: NearState, sizes: np.ndarray, moving: np.ndarray, rows: slice = slice(None)) -> np.ndarray:
    """The weights of momenta by which the motion is along the symmetries as nearly as it can be.  rows : those of (v, mu')
    that count.
    """
    along, velocity = _generated(near, moving) / sizes[:, None], np.asarray(near.field(near.here)) / sizes
    return np.asarray(np.linalg.lstsq(along[rows], velocity[rows])[0])


def _critical_point(
    near: NearState, sizes: np.ndarray, conserved: np.ndarray, changes: np.ndarray
) -> tuple[NearState, np.ndarray]:
    """The equilibrium, and the weights w of its kept momenta."""
    prescribed = np.asarray(near.momenta(near.here)) @ conserved
    moving = changing(near, sizes, conserved, changes)
    w = _weights(near, sizes, moving)
    left, settled = np.inf, False
    for _ in range(TURNS):
        moving = changing(near, sizes, conserved, changes)
        matrix, defects, units = _equations(near, sizes, moving, w, prescribed * moving.any(axis=0))
        left = float(np.abs(defects).max())
        step = np.linalg.lstsq(matrix, -defects, rcond=DEPENDENT)[0]
        step *= min(1.0, FARTHEST / np.abs(step[: len(sizes)]).max(initial=FARTHEST))
        near, w = near.moved(sizes * step[: len(sizes)]), w + units * step[len(sizes) :]
        if settled:
            return near, w
        settled = left <= SOLVED
    raise NoConvergence(
        f"relative_equilibrium: after {TURNS} steps of Newton's method the state is still {left:.1e} of its size away from "
        "steady motion: there is no relative equilibrium with the momenta of the guess near it, as beyond a fold, where two "
        "of them merge and end; change the guess, or follow one that you know in small steps of its momenta"
    )


def _equations(
    near: NearState, sizes: np.ndarray, conserved: np.ndarray, w: np.ndarray, prescribed: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The matrix of Newton's equations for (z, w), the defects, and the units of w; those of z are the sizes, and all
    rows are parts of a size.
    """
    slopes = near.slopes(conserved @ w) / sizes[:, None] * sizes
    fast = np.abs(slopes).max() or 1.0  # the rate in which rates are told
    generated = _generated(near, conserved) / sizes[:, None]
    units = fast / nonzero(np.abs(generated).max(axis=0))
    by_state = conserved.T @ momentum_slopes(near) * sizes
    levels = nonzero(np.abs(by_state).max(axis=1))
    momenta = np.asarray(near.momenta(near.here)) @ conserved
    corner = np.zeros((len(w), len(w)))
    matrix = np.block([[slopes / fast, -generated * units / fast], [by_state / levels[:, None], corner]])
    steady = np.asarray(near.field(near.here)) / sizes - generated @ w
    return matrix, np.concatenate([steady / fast, (momenta - prescribed) / levels]), units


def _with_motion_near(
    near: NearState, sizes: np.ndarray, conserved: np.ndarray, moving: np.ndarray, w: np.ndarray, guessed: bool = False
) -> RelativeEquilibrium:
    """The equilibrium with the motion near it.  moving : those of the kept momenta that are not stationary there.
    guessed : is it near one only, where second derivatives are symmetric but for what is left of the first?
    """
    generated = _generated(near, moving) / sizes[:, None]
    units = 1.0 / nonzero(np.abs(generated).max(axis=0))  # of the weights
    generated, by_state = generated * units, moving.T @ momentum_slopes(near) * sizes
    by_state = by_state / nonzero(np.abs(by_state).max(axis=1))[:, None]
    form = near.two_form().T * sizes * sizes[:, None]

    def linear_motion(w: np.ndarray) -> np.ndarray:
        """The matrix of the motion in the frame that moves with rates w."""
        return near.slopes(conserved @ w) / sizes[:, None] * sizes

    motion = linear_motion(w)
    energy = form @ motion  # D^2 H_w
    level, coordinates = null_space(by_state)
    along_symmetries = (generated @ null_space(by_state @ generated)[0])[coordinates]
    dropped, left, shift = _complement(along_symmetries, level.T @ energy @ level)
    across = level[:, left]
    reduced = (motion @ across)[coordinates]
    reduced = reduced[left] - shift @ reduced[dropped]
    squares = None
    if guessed or np.abs(energy - energy.T).max(initial=0.0) <= FEW_DIGITS * np.abs(energy).max(initial=0.0):
        idle = null_space(generated)[0].T  # weights of momenta that move nothing
        others = [form @ linear_motion(w + units * weights) - energy for weights in idle]
        size = np.abs([energy, *others]).max(axis=(1, 2), initial=0.0)
        forms = across.T @ np.array([energy, *others]) @ across
        changes = np.abs(forms).max(axis=(1, 2), initial=0.0)
        above_rounding = changes > STILL * np.maximum(size, size[0])
        squares = _squares(forms[0], *forms[1:][above_rounding[1:]])
    velocity = np.asarray(near.field(near.here))
    return RelativeEquilibrium(near.state, velocity, conserved.shape[1], np.linalg.eigvals(reduced), squares)


def _complement(directions: np.ndarray, energy: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The space of coordinates without some directions in it: the coordinates to be dropped, those that are left, and
    how these change along the directions for one unit of those that are dropped.

    Of two coordinates that may be dropped it is the one of the larger energy: that of a satellite's attitude would be a
    difference of those of its orbit else.
    """
    _, independent, rank = pivoted(directions)
    directions = directions[:, independent[:rank]]
    stiff = np.abs(energy).max(axis=1, initial=0.0) / (np.abs(energy).max(initial=0.0) or 1.0)
    order = pivoted(directions.T / (1.0 - 0.05 * np.log2(np.maximum(stiff, ROUNDING))))[1]
    dropped, left = order[:rank], order[rank:]
    return dropped, left, directions[left] @ np.linalg.inv(directions[dropped])


def _squares(form: np.ndarray, *others: np.ndarray) -> tuple[int, int]:
    """The numbers of positive and of negative squares of a symmetric form, to which multiples of others may be added that
    make it definite: momenta that move nothing have a weight of any size.
    """
    from scipy.optimize import minimize

    units = like_sizes(form)
    form, *free = [0.5 * units[:, None] * (x + x.T) * units for x in (form, *others)]

    def values(multiples: np.ndarray) -> np.ndarray:
        return np.linalg.eigvalsh(form + sum(k * x for k, x in zip(multiples, free, strict=True)))

    best = np.zeros(len(free))
    if free and len(form):
        size = np.abs(form).max() / max(np.abs(x).max() for x in free)
        for sign in (1.0, -1.0):  # the smallest eigenvalue is a concave function of the multiples
            highest = minimize(lambda x, up: -(up * values(x * size)).min(), best, sign, "Nelder-Mead", options=FINE)
            if highest.fun < 0.0:
                best = highest.x * size
                break
    eigenvalues = values(best)
    rounding = FEW_DIGITS**2 * np.abs(eigenvalues).max(initial=0.0)
    return int((eigenvalues > rounding).sum()), int((eigenvalues < -rounding).sum())


def _generated(near: NearState, conserved: np.ndarray) -> np.ndarray:
    """The motions that the kept momenta generate, (2 dim, k)."""
    return np.array([near.generated(vec(*c), near.here) for c in conserved.T.tolist()]).reshape(-1, 2 * near.dim).T
