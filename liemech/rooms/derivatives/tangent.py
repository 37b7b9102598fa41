"""Tangent maps: the exact derivative of a discrete motion, by steps whose numbers carry it along."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, NotCompilable
from ...formulas import record
from ...formulas.classes.layouts import Layout, layout_of, leaves
from ...formulas.numbers.conversions import with_slopes
from ...formulas.tables import Table, entry
from ...integrators.ending_at_jumps import cuts, sees_powers
from ...integrators.method import Wrapping
from ...simulation import arguments
from ...simulation.between.dense import unpacked
from ...simulation.compiled.control import TAKEN
from ...simulation.compiled.execution import like
from ...simulation.compiled.prepared import Steps
from ...simulation.compiled.systems import Methods, Systems
from ...simulation.result import AsItIs, ends, of_some, of_tangent
from ...simulation.runs.equal import StraightRun
from ...simulation.trajectory import TangentTrajectory, Trajectory
from ...systems.system import State
from ..fictive_time.origin import Origin
from .directions import Directions, dual_of, with_step
from .frames import LEVEL

# ------------------------------------------------------------------ what is asked for


def of_one(plan: Any, start: State, steps: Any, t_end: Any, t0: float, names: tuple[str, ...]) -> TangentTrajectory:
    """The run of one body with its tangent map."""
    if plan.adaptive:
        if "h" in names:
            raise InvalidInput("Plan.tangent: h is for fixed steps; the lengths of adaptive ones are held fixed")
        run = plan._in_pieces(start, t0, steps, t_end, None, None)
        return adaptive_tangent_run(plan, run, start, names)
    if plan.fictive:
        if t_end is not None or steps is None:
            raise InvalidInput(
                "Plan.tangent: in fictive time give steps, and no t_end, which is met by a step of another length"
            )
        steps = arguments.count(steps, "steps", 0)
        return fictive_tangent_run(plan, start, steps, t0, names)
    return tangent_run(plan, start, plan._count(steps, t_end, t0), t0, names)


# ------------------------------------------------------------------ runs


def tangent_run(plan: Any, start: State, steps: int, t0: float, names: tuple[str, ...]) -> TangentTrajectory:
    """`steps` fixed steps from a start, with their derivative by the named parameters."""
    prepared: Steps = plan._steps
    method = prepared.method
    dressed = None
    if "h" in names:
        if prepared.way is not prepared.method and cuts(prepared.way, prepared.one):
            raise IncompatibleSystem(
                f"Plan.tangent: steps of {method!r} end where an input jumps, whatever h is, and "
                "have no derivative by it; by the start and by parameters of the system they have one"
            )
        dressed = with_step(prepared.h, t0)
    directions = Directions(prepared.one, method, start, names, dressed)
    run, t, values, tangent = carried_along(plan, start, steps, t0, directions)
    return of_tangent(
        run, steps, directions.named(tangent), system=prepared.one, method=method, h=prepared.h, t=t,
        states=unpacked(layout_of(start), values),
    )  # fmt: skip


def carried_along(
    plan: Any, start: Any, steps: int, t0: float, directions: Directions
) -> tuple[Trajectory, np.ndarray, np.ndarray, np.ndarray]:
    """The run whose numbers carry the derivatives, and up to the first direction that stopped: its times, the
    numbers of the states, (n, width), and their components, (n, components, directions).
    """
    with derived(plan, "tangent"):
        run = _Run(plan, start, directions, steps, t0)
        trajectory = run.trajectory()
    n, values, slopes = run.halves()
    tangent = directions.frames.components(unpacked(layout_of(start), values), slopes).swapaxes(1, 2)
    return trajectory, trajectory.t[:n], values, tangent


@contextlib.contextmanager
def derived(plan: Any, what: str) -> Iterator[None]:
    """A context that raises IncompatibleSystem for a method whose numbers cannot carry a derivative."""
    try:
        yield
    except (TypeError, AttributeError) as error:
        carries_none = sees_powers(plan.method) or "series" in str(error) or "Dual" in str(error)
        if carries_none and not isinstance(error, NotCompilable):
            raise IncompatibleSystem(
                f"Plan.{what}: {plan.method!r} computes with power series or keeps numbers that "
                "cannot carry a derivative; differences of runs tell it"
            ) from None
        raise


def fictive_tangent_run(
    given_plan: Any, start: State, steps: int, t0: float, names: tuple[str, ...]
) -> TangentTrajectory:
    """`steps` fixed steps in fictive time, with their derivative at the same fictive times.

    The energy and the first 1/sigma, which the start decides for the whole run, are differentiated too, by
    differences of order 8 as for parameters.
    """
    plan: Steps = given_plan._steps
    origin = Origin(plan.one, plan.method, start)
    whole, first_state = origin.whole, origin.begun(t0)

    def begins(system: Any, method: Any, at: Any) -> tuple[Any, Any]:
        with_clock = Origin(system, method, at).whole
        return with_clock, with_clock.extended(at, t0)

    dressed = with_step(plan.h, 0.0) if "h" in names else None
    directions = Directions(plan.one, plan.method, start, names, dressed, begins)
    clocked_plan = given_plan.in_fictive_time(origin)
    run, tau, values, tangent = carried_along(clocked_plan, first_state, steps, 0.0, directions)
    t, states, _ = whole.apart(unpacked(layout_of(first_state), values))
    size = tangent.shape[1]
    # z is not shown
    rows = whole.of_tangent(size) if plan.one.fictive else [*range(size - 1)]
    return of_tangent(
        run, steps, directions.named(tangent[:, rows]), system=whole.system, method=plan.method, h=plan.h,
        t=t, states=states, tau=tau,
    )  # fmt: skip


@record
class StepsOfARun(Wrapping):
    """The steps of an adaptive run, their lengths held fixed: step number n at the time n."""

    begun: Any  # a table of the times at which steps begin
    lengths: Any  # a table of the lengths of steps

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        n = int(t)
        return self.method.step(system, entry(self.begun, n), memory, entry(self.lengths, n))


def in_steps(plan: Any, t: np.ndarray) -> Any:
    """The plan of fixed steps that repeats the steps of an adaptive run, which end at the times t."""
    begins = plan._steps.begun(t)
    return like(plan, _steps=repeated(plan, dressed_in(begins, t)(plan._steps.method)))


def dressed_in(begins: np.ndarray, t: np.ndarray) -> Any:
    """The function from a method to its steps that begin and end at these times."""
    tables = Table([*begins, 0.0]), Table([*(t[1:] - begins), 0.0])
    return lambda method: StepsOfARun(method, *tables)


def repeated(plan: Any, method: StepsOfARun) -> Steps:
    """The steps of an adaptive plan as fixed ones, whose time is their number."""
    adaptive = plan._steps
    return Steps(
        adaptive.system, method, 1.0, 1, False, "double", adaptive.compiled, adaptive.progress, 1, clock="step"
    )  # fmt: skip


def adaptive_tangent_run(plan: Any, run: Trajectory, start: State, names: tuple[str, ...]) -> TangentTrajectory:
    """An adaptive run, every step of which is kept, with the derivative of its steps, their lengths held fixed."""
    adaptive, begins = plan._steps, plan._steps.begun(run.t)
    directions = Directions(adaptive.system, adaptive.method, start, names, dressed_in(begins, run.t))
    repeating = like(plan, _steps=repeated(plan, directions.method))
    again, times, _, tangent = carried_along(repeating, start, len(begins), 0.0, directions)
    states = {name: x[: len(times)] for name, x in run.states.items()}
    return of_tangent(
        again, run.steps, directions.named(tangent), system=adaptive.system, method=adaptive.method, h=run.h,
        t=run.t[: len(times)], states=states, rejected=run.rejected,
    )  # fmt: skip


def of_bodies(method: Any, runs: list[TangentTrajectory]) -> TangentTrajectory:
    """The runs of all bodies as one."""
    alone = all(run.system is runs[0].system for run in runs)
    system: Any = runs[0].system if alone else Systems(tuple([run.system for run in runs]))
    names, numbers = ("events", "time_tangents"), [run.ended for run in runs]  # type: Any, list[Any]
    by_event = {name: tuple(zip(*[getattr(run, name) for run in runs], strict=True)) for name in names}
    return of_some(runs, system=system, method=method, ended=ends(numbers), **by_event)


def multiplied(run: TangentTrajectory, name: str, given: Any) -> TangentTrajectory:
    """The run with the products J v ("along") or J^T w ("against") of its tangent map with directions, in its place."""
    map_ = run.tangent["start"]
    map_ = map_ if name == "along" else np.swapaxes(map_, -1, -2)
    return replace(run, tangent={name: map_ @ arguments.directions(name, given, map_.shape[-1])})


class Directionless(AsItIs):
    """The view of bodies that are directions of a derivative: no states, and no notes in errors."""

    def arrays(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        return {}

    def mark(self, error: Any, t: float, numbers: np.ndarray) -> None:
        """Leave the error as it is: a direction is no body."""


class _Run(StraightRun):
    """A run of an ensemble whose members are the directions of the derivative, all with one value."""

    def __init__(self, plan: Any, start: State, directions: Directions, steps: int, t0: float) -> None:
        of_method, of_system, of_start = (directions.slopes[:, part] for part in directions.places)
        self.duals = [dual_of(start, move) for move in of_start]
        prepared = plan._steps
        if of_system.any():
            things = [directions.varied.get(k, directions.system) for k in range(len(of_system))]
            systems = Systems(tuple(map(dual_of, things, of_system)))
            prepared = replace(prepared, system=systems, shapes={})
        if of_method.any():
            methods = Methods(tuple([dual_of(directions.method, x) for x in of_method]))
            prepared = replace(prepared, method=methods, shapes={})
        count = SimpleNamespace(bodies=len(directions.slopes))
        super().__init__(like(plan, _steps=prepared), count, t0, steps, None, None)

    def _member(self, i: int) -> Any:
        return self.duals[i]

    def _first(self, one: State, started: Layout) -> tuple[Any, Any]:
        """The first carry and sample, every number of the carry with a slope: zeros of first guesses may come to depend
        on the start.
        """
        carry, example = super()._first(one, started)
        return with_slopes(carry, LEVEL), example

    def _lay_down(self, columns: np.ndarray) -> None:
        numbers = np.array([leaves(dual, self.shape.given) for dual in self.duals]).T
        columns[:] = numbers[:, np.minimum(np.arange(columns.shape[1]), self.count - 1)]

    @functools.cached_property
    def view(self) -> AsItIs:
        return Directionless(self.lanes.example)

    def first_sample(self) -> dict[str, Any]:
        none: dict[str, Any] = {"t": np.empty(0), "states": {}}
        return {"system": self.plan.system, "h": self.way.h} | none

    def tell(self, made: Trajectory) -> None:
        """Without a warning of directions that stopped, which are no bodies."""

    def halves(self) -> tuple[int, np.ndarray, np.ndarray]:
        """The number n of samples that all directions reached; of these the numbers of the states, (n, width), and
        their derivatives in every direction, (n, directions, width).
        """
        samples = self.observers[0]
        n = max(1, int(samples.samples_after(self.clocks[TAKEN].min())))
        out = samples.array[:n]
        return n, out[:, 0::2, 0], out[:, 1::2, : self.count].transpose(0, 2, 1)
