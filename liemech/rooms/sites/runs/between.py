"""The motion of many sites between the steps that a run has kept."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

from ....compiler.sites.planes import Planes
from ....errors import NotFinite, failure
from ....formulas.classes.frozen import frozen
from ....formulas.sites import rows_of
from ....simulation.between.dense import one_or_many, packed, unpacked, within_run
from ....simulation.compiled.control import TIME
from ....simulation.plan import Plan
from ....systems.system import state_of
from .driver import Moment
from .states import as_users_see, first_of, state_of_rows


class BetweenEnds:
    """The motion of the sites of a run between the ends of its steps; abstract.

    A subclass has `t`, the ends of the steps, (n,), `ends`, the states there by their parts, and
    `kind`, that of a state, and writes `inside`.
    """

    t: Any
    ends: Any
    kind: Any

    def inside(self, k: int, times: np.ndarray) -> dict[str, np.ndarray]:
        """The states at some times in step k, in the order of the run."""
        raise NotImplementedError

    def __call__(self, times: Any) -> Any:
        """The state at one time, or at many, (m,), whose arrays then have a leading axis.  Raises InvalidInput
        for times outside the run.
        """
        t, asked_times = self.t, one_or_many(times)
        at = within_run(np.atleast_1d(asked_times).astype(float), t)
        sign = 1.0 if t[-1] >= t[0] else -1.0
        step = np.searchsorted(sign * t, sign * at, "right") - 1
        states = {name: x[step] for name, x in self.ends.items()}  # a copy
        between = at != t[step]
        for k in np.unique(step[between]):
            at_step = np.flatnonzero(between & (step == k))
            inner, back = np.unique(sign * at[at_step], return_inverse=True)
            for name, x in self.inside(int(k), sign * inner).items():
                states[name][at_step] = x[back]
        which: Any = 0 if asked_times.ndim == 0 else slice(None)
        return state_of(self.kind, {name: x[which] for name, x in states.items()})


class SitesBetween(BetweenEnds):
    """That of fixed steps: from the last end of a step a shorter one of the method, as for `t_eval`.

    run : one that has kept the ends of all steps.  kind : of its states.
    """

    def __init__(self, run: Any, kind: Any) -> None:
        self.run, self.kind, self.t, self.ends = run, kind, run.t, run.states

    @functools.cached_property
    def plan(self) -> Any:
        """The plan of such steps."""
        run = self.run
        return Plan(run.system, run.method, h=run.h, breaks=run.breaks, progress=False)

    def inside(self, k: int, times: np.ndarray) -> dict[str, np.ndarray]:
        system, t = self.run.system, float(self.t[k])  # states may have drifted from constraints, as a start must not
        start = system.vouched(system._reached(**{name: x[k] for name, x in self.ends.items()}), t)
        at_times = self.plan.run(start, steps=1, t0=t, t_eval=times)
        return dict(at_times.states)


@frozen(eq=False)
class SitesDense(BetweenEnds):
    """That of adaptive steps: in every step a polynomial in the algebra of each site, carried to its group.

    example : the state of one site.  sites : their number.
    rows : (n + 1, 1 + width sites) of every end of a step the time, and what adaptive steps carry along
    of all sites: the states, the velocities there, and the way of the step before.
    """

    system: Any
    method: Any
    example: Any
    sites: int
    rows: np.ndarray
    order: int
    wanted: bool | None = None

    @classmethod
    def of(cls, run: Any) -> SitesDense:
        """The motion of a run so far, which has kept its ways."""
        method, t, ways = run.plan.method, run.clocks.item(TIME, 0), run.ways
        if t != ways[-1][0]:
            ways = [*ways, (t, run._memory.copy())]
        rows = np.empty((len(ways), 1 + ways[0][1].size))
        for row, (t, memory) in zip(rows, ways):
            row[0], row[1:] = t, memory.ravel()
        motion = first_of(run.state), run.count, rows, method.dense_order
        return cls(run.plan.system, method, *motion, run.plan.options.compiled)

    @property
    def t(self) -> np.ndarray:
        """The ends of the steps, (n + 1,)."""
        return self.rows[:, 0]

    @functools.cached_property
    def shape(self) -> Any:
        """The layouts, and the native code that looks inside of a step."""
        plan = Plan(self.system, self.method, rtol=1e-6, compiled=self.wanted, progress=False)
        starts = np.repeat(packed(self.example)[:, None], self.sites, axis=1)
        return plan._sites.shape_of(self.example, Planes(rows_of(starts), self.sites), True)

    @property
    def memory(self) -> np.ndarray:
        """Numbers that are carried along, (n + 1, width, sites)."""
        return self.rows[:, 1:].reshape(len(self.rows), -1, self.sites)

    @functools.cached_property
    def ends(self) -> dict[str, np.ndarray]:
        """The states at the ends of steps."""
        return self._parts(np.array([self.shape.shown_rows(x) for x in self.memory]))

    @functools.cached_property
    def kind(self) -> Any:
        """That of a state as users see it."""
        state = state_of_rows(self.shape.state, self.shape.shown_rows(self.memory[0]))
        return type(as_users_see(self.system, state))

    def _parts(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """The parts of states, of their numbers, (m, width, sites)."""
        return self.system.as_users_see(unpacked(self.shape.state, np.moveaxis(rows, 1, -1)))

    def inside(self, k: int, times: np.ndarray) -> dict[str, np.ndarray]:
        """On the way of the step, as for `t_eval`."""
        memory, shape = self.memory[k : k + 2], self.shape
        sites = Planes(rows_of(memory.reshape(-1, self.sites)), self.sites)
        looking, rows = shape.looking.of_a_run(), []
        for t in times.tolist():
            begin, end = self.t[k : k + 2].tolist()
            moment = Moment(t, (t - begin) / (end - begin), 1.0)
            states_at_times, _, failures, _ = shape.look(looking, shape.site, moment, sites)
            if failures is not None:
                error = failures[-1] if failures else NotFinite("a state is not finite")
                raise failure(error, "dense output", f"between two steps, t = {t:g}")
            rows.append(states_at_times.array[:, : self.sites])
        return self._parts(np.array(rows))

    def then(self, rest: SitesDense) -> SitesDense:
        """This motion and the one that follows it."""
        return dataclasses.replace(rest, rows=np.concatenate([self.rows, rest.rows[1:]]))
