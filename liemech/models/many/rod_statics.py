"""Rods at rest: their stiffness as a sparse matrix, and shapes in which all forces balance."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ...errors import NoConvergence
from ...formulas import Mat, Record, Vec, mat, record, vec
from ...formulas.classes.records import with_fields
from ...groups.rigid.se3 import SE3
from ...groups.rigid.so3 import SO3
from ...rooms.sites.terms.terms import Site
from ...solvers import LIMIT, TOLERANCE

LONGEST = 0.5
"""A correction of Newton's method turns no frame by more than this, in rad, and moves none by more
than this part of the length: longer ones are shortened.
"""

ROUNDING = 2.0**-48
"""Corrections below this, in rad and in parts of the length, are none."""

SHARP, LEAST = 15, 2.0**-30
"""Corrections of a rod that is held at both ends are shortened up to this one, by a part of the
diagonal that is a quarter each time, in the end the least.
"""


@record
class ElementInRows(Record):
    """An element whose two frames are a row of 32 numbers, with its rest strain behind them.

    Source: Sonneville, Cardona and Bruls, Comput. Methods Appl. Mech. Eng. 268 (2014), 451.
    """

    element: Any

    def balance(self, numbers: Vec) -> Vec:
        """Forces on both frames, and the four blocks of their derivatives, in a row of 156 numbers."""
        a, b = (Site(g=_pose(numbers[16 * k : 16 * k + 16])) for k in range(2))
        beam: Any = with_fields(self.element, rest=numbers[32:38])
        forces, blocks = beam.forces(SE3(), a, b), beam.stiffnesses(SE3(), a, b)
        rows = [x for f in forces for x in f]
        return vec(*rows, *[x for pair in blocks for block in pair for row in block for x in row])

    def _shape(self, argument: str, kind: str) -> tuple[int, ...]:
        return (38,)


def _pose(numbers: Vec) -> Mat:
    return mat(*[numbers[4 * i : 4 * i + 4] for i in range(4)])


def balance(rod: Any, g: np.ndarray, share: float = 1.0) -> tuple[np.ndarray, Any]:
    """The forces on all frames, (frames, 6), and their derivative by left-trivialised displacements
    with the opposite sign, sparse, (6 frames, 6 frames).

    share : of the loads.
    """
    from scipy.sparse import coo_matrix

    n, count = rod.elements, rod.frames
    first, second = np.arange(n), (np.arange(n) + 1) % count
    flat, strain = g.reshape(count, 16), np.broadcast_to(rod.rest_strain, (n, 6))
    rows = np.concatenate([flat[first], flat[second], strain], axis=1)
    of_elements = np.asarray(ElementInRows(rod.element).balance(rows)).reshape(n, 156)
    force = np.zeros((count, 6))
    for ends, part in ((first, of_elements[:, :6]), (second, of_elements[:, 6:12])):
        np.add.at(force, ends, part)
    blocks = [of_elements[:, 12 + 36 * k : 48 + 36 * k].reshape(n, 6, 6) for k in range(4)]
    places = [(i, j) for i in (first, second) for j in (first, second)]
    pull, moment, following = rod.loads
    turned = np.swapaxes(g[:, :3, :3], 1, 2)
    pulled, twisted = ((turned @ (share * x)[:, :, None])[:, :, 0] for x in (pull, moment))
    force += share * following + np.concatenate([twisted, pulled], axis=1)
    of_loads = np.zeros((count, 6, 6))
    hat = SO3().algebra.hat
    of_loads[:, :3, :3], of_loads[:, 3:, :3] = -np.asarray(hat(twisted)), -np.asarray(hat(pulled))
    blocks, places = [*blocks, of_loads], [*places, (np.arange(count),) * 2]
    six = np.arange(6)
    row = np.concatenate([np.repeat(6 * i[:, None] + six, 6, axis=1).ravel() for i, _ in places])
    column = np.concatenate([np.tile(6 * j[:, None] + six, 6).ravel() for _, j in places])
    values = np.concatenate([block.ravel() for block in blocks])
    return force, coo_matrix((values, (row, column)), (6 * count, 6 * count)).tocsr()


def equilibrium(rod: Any, g: np.ndarray, stages: int) -> np.ndarray:
    """Frames at which all forces balance, near g, (frames, 4, 4), with the loads put on in equal
    stages.  Raises NoConvergence.
    """
    free, easy = rod.free, "free" in rod.ends and not rod.closed
    for stage in range(1, stages + 1):
        last, done, path, before = False, False, 0.0, np.inf
        for k in range(4 * LIMIT):
            part = 0.0 if easy else 4.0**-k if k < SHARP else LEAST
            force, stiffness = balance(rod, g, stage / stages)
            zeta = np.zeros(6 * rod.frames)
            if free.any():
                zeta[free] = solution(stiffness[free][:, free].tocsc(), force.ravel()[free], part)
            zeta = zeta.reshape(-1, 6)
            size = np.abs(zeta / np.array([1.0] * 3 + [rod.length] * 3)).max()
            if not np.isfinite(size):
                break
            g = moved(rod, g, min(1.0, LONGEST / max(size, LONGEST)) * zeta)
            path += size
            small = size <= max(TOLERANCE * path, ROUNDING)
            small |= 0.5 * before <= size <= TOLERANCE  # rounding, where the rod gives way easily
            before = size
            done, last = last, small and (easy or k >= SHARP)
            if done:
                break
        if not done:
            raise NoConvergence(
                f"CosseratRod.equilibrium: no balance found at {stage} of {stages} parts of the load; "
                "give more stages, or frames nearer to it: beyond a buckling load those of the side to "
                "which it bends"
            )
    return g


def solution(stiffness: Any, force: np.ndarray, part: float) -> np.ndarray:
    """The displacement that balances a force, with a part added to the diagonal, which makes it shorter.

    Where the rod may move as a whole, as one that is hinged at both ends turns about its axis, a small
    part stays, so that it hardly does so.
    """
    from scipy.sparse import diags
    from scipy.sparse.linalg import MatrixRankWarning, spsolve

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MatrixRankWarning)
        for stiffening in (part, LEAST):
            displacement = spsolve(stiffness + diags(stiffening * np.abs(stiffness.diagonal())), force)
            if np.isfinite(displacement).all():
                break
    return np.asarray(displacement)


def moved(rod: Any, g: np.ndarray, zeta: np.ndarray) -> np.ndarray:
    """The frames after displacements to first order in zeta, (frames, 6).

    Where an end is free it is the strains that change by what zeta says, so that a rod that bends
    far does not stretch; else the frames go along exp.
    """
    if rod.closed or "free" not in rod.ends:
        return np.asarray(SE3().compose_exp(g, zeta))
    tau, group = rod.retraction, SE3()
    x = np.asarray(tau.tau_inv(group, group.compose(group.inverse(g[:-1]), g[1:])))
    x = x + np.asarray(tau.dtau_inv(group, x, zeta[1:])) - np.asarray(tau.dtau_inv(group, -x, zeta[:-1]))
    frames, h = np.empty_like(g), np.asarray(tau.tau(group, x))
    if rod.ends[1] == "free":
        frames[0] = group.compose_exp(g[0], zeta[0])
        for k in range(rod.elements):
            frames[k + 1] = frames[k] @ h[k]
    else:
        frames[-1] = group.compose_exp(g[-1], zeta[-1])
        for k in range(rod.elements - 1, -1, -1):
            frames[k] = frames[k + 1] @ np.asarray(group.inverse(h[k]))
    return frames
