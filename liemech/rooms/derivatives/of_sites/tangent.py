"""The tangent map of a run of many sites, and its products with directions: the numbers of all sites
carry the derivative along one direction through the same steps, site by site.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any

import numpy as np

from ....errors import IncompatibleSystem
from ....formulas.classes.layouts import build, layout_of
from ....formulas.numbers.conversions import with_slopes
from ....simulation import arguments
from ....simulation.between.dense import unpacked
from ....simulation.result import of_tangent
from ....simulation.runs.equal import affordable
from ...sites.runs.states import first_of, site_rows
from ..frames import LEVEL, Frames, StatesInFrames, dual_basis
from .adaptive import steps_of
from .adjoint import BackwardRun


class Along:
    """How a run differs when the numbers of its sites carry a derivative.

    slopes : of the numbers of the start, (width, sites).
    """

    slopes: np.ndarray
    level = LEVEL
    carry = None  # a direction is no motion, from which to go on

    def laid_out(self, state: Any) -> tuple[Any, np.ndarray]:
        """The state of the first site, and the numbers of all, each with its slope behind it."""
        both = np.stack([site_rows(state), self.slopes], axis=1)
        rows = both.reshape(-1, both.shape[-1])
        dual = layout_of(with_slopes(first_of(state), LEVEL))
        return build(dual, iter(rows[:, 0].tolist())), rows

    def elements(self, rows: np.ndarray) -> Any:
        """The elements of the sites, without their slopes."""
        one: Any = super()
        return one.elements(rows[0::2])

    def halves(self) -> tuple[np.ndarray, np.ndarray]:
        """The numbers of samples and their slopes, (n, width, sites)."""
        run: Any = self
        rows = run.samples.rows
        return rows[:, 0::2], rows[:, 1::2]


def tangent_by_sites(sites: Any, start: Any, steps: Any, t_end: Any, t0: float, given: Any) -> Any:
    """A run of many sites with its tangent map J, of which every direction of the start makes a column;
    or with products of it.

    given : "along", the run has J v, or "against", J^T w, and the directions; None for J itself.  J^T w is
    found backwards, where steps have a way back and there are fewer samples than directions.  Of adaptive
    steps it is the derivative of those that were accepted, their lengths held fixed.
    """
    plan = sites.plan
    if not plan.adaptive:
        return of_fixed_steps(sites, start, plan._count(steps, t_end, t0), t0, given)
    fixed, ends, run = steps_of(sites, start, steps, t_end, t0)
    tangent_of_steps = of_fixed_steps(fixed._sites, start, len(ends) - 1, 0.0, given)
    return replace(tangent_of_steps, t=ends[[0, -1]], h=run.h, rejected=run.rejected, method=plan.method)


def of_fixed_steps(sites: Any, start: Any, steps: int, t0: float, given: Any) -> Any:
    """The run of `tangent_by_sites` with fixed steps."""
    plan, first = sites.plan, first_of(start)
    frames, every = Frames(sites.site, first), plan.options.every
    moving = sites.count_of(start)
    n, samples = moving * frames.count, steps // every + 1
    name, vectors = given or ("start", None)
    directions = np.eye(n) if vectors is None else arguments.directions(name, vectors, n)
    columns = directions.reshape(n, -1)
    affordable(8 * columns.size * (samples + 1), steps, every)
    run_with = sites.site, start, t0, steps, None, None, None
    tangent = None
    if name == "against" and columns.shape[1] * samples <= n:
        with contextlib.suppress(IncompatibleSystem):
            back = BackwardRun(sites, start, steps, t0)
            run = sites.kind(plan, *run_with)
            trajectory = run.trajectory()
            states = trajectory.states
            tangent = np.stack([[back.back({k: w})[0] for w in columns.T] for k in run.numbers.tolist()]).swapaxes(1, 2)
    if tangent is None:
        products, basis, duals = [], frames.basis(start.arrays), None
        for direction in columns.T if name == "along" else np.eye(n):
            slopes = np.zeros((basis.shape[-1], start.sites))
            slopes[:, :moving] = np.einsum("sc,scn->ns", frames.of_each(direction[None])[0], basis[:moving])
            run = type("RunAlong", (Along, sites.kind), {"slopes": slopes})(plan, *run_with)
            trajectory = run.trajectory()
            values, slopes = (np.moveaxis(x, 1, -1) for x in run.halves())
            by_site = unpacked(layout_of(first), values)
            if duals is None:  # the states are the same along all directions
                duals = dual_basis(StatesInFrames(frames, by_site).basis())
            product = frames.in_a_row((slopes[:, :, None] @ duals)[:, :moving, 0])
            products.append(product @ columns if name == "against" else product)
        tangent = np.stack(products, axis=1 if name == "against" else -1)
        states = plan._one.as_users_see(by_site)
    return of_tangent(
        trajectory, trajectory.steps, {name: tangent.reshape(len(tangent), n, *directions.shape[1:])}, system=plan.system,
        method=plan.method, h=trajectory.h, t=trajectory.t, states=states,
    )  # fmt: skip
