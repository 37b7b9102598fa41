"""Prepared runs: a system, a method and a way of stepping, checked once, for any number of starts."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Any

from ..errors import IncompatibleSystem, IntegrationInterrupted, InvalidInput, StepWarning, warn
from ..formulas.classes.layouts import Layout, layout_of
from ..formulas.classes.signatures import spelt
from ..integrators.method import Method
from ..systems.system import State, System, member
from . import arguments
from .between.jump import Jump
from .checkpoint import Checkpoint
from .compiled.execution import like
from .compiled.prepared import Steps
from .compiled.systems import OfBodies, each_of, methods_of, of_body, systems_of
from .options import EQUAL, FICTIVE, TOLERANCE, ErrorControl, FixedSteps, Options, Save, words_of
from .recorded import recorder_of
from .runs.carry import Carry, SiteCarry
from .runs.equal import Advance, EqualRun, StraightRun
from .runs.going_on import carry_of
from .runs.short import advanced, short_run, short_steps
from .runs.starts import started
from .runs.tolerance import AdaptiveSteps, ToleranceRun
from .trajectory import TangentTrajectory, Trajectory, require_savable

if TYPE_CHECKING:
    from ..rooms.at_work.stepper import Stepper
    from ..rooms.derivatives.gradient import Gradient


class Plan:
    """A run that is prepared: `run` starts it, `resume` goes on, as often as wanted, at a cost of
    microseconds.

    system, method : what moves, and how it is stepped.  A list of systems, or of methods, of one
    kind, one for each body of an ensemble, gives every body its own parameters.

    Fixed steps:
    h : the step, in s; negative runs backwards; (bodies,) gives every body of an ensemble its own.
    every, compensated, precision : as for `integrate`.

    Adaptive steps, of a method with an error estimate, if h is None or rtol or atol is given:
    rtol, atol, dense : as for `integrate`.  h : the first step; max_step : the longest one;
    (bodies,) gives every body its own.

    breaks, for both : times at which the velocity jumps, such as the ends of a pulse; no step goes
    across one.  Those of tables in the fields of the system are known.
    record, events, compiled, progress, workers : as for `integrate`.

    control, save : FixedSteps(h), ErrorControl(rtol, atol) and Save(every=..., record=...) say the same
    by values.

    A plan does not change; `replace` makes another one.  What formulas read from outside counts as
    it is when a run begins.
    """

    @spelt
    def __init__(
        self,
        system: System | Sequence[System],
        method: Method | Sequence[Method],
        h: Any = None,
        *,
        control: FixedSteps | ErrorControl | None = None,
        save: Save | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        max_step: float | None = None,
        breaks: Any = (),
        every: int = 1,
        record: Iterable[str] | None = None,
        events: Any = (),
        dense: bool | None = None,
        compensated: bool | None = None,
        precision: str = "double",
        compiled: bool | None = None,
        progress: bool | None = None,
        workers: int = 1,
    ) -> None:
        if not isinstance(system, System) and isinstance(system, (list, tuple)):
            system = tuple(system)
        if isinstance(method, (list, tuple)):
            method = tuple(method)
        options = self.options = Options(
            h, rtol, atol, max_step, breaks, every, record, events, dense, compensated, precision,
            compiled, progress, workers,
        ).with_values(control, save).checked()  # fmt: skip
        h = options.h
        if save is not None and save.at is not None:
            raise InvalidInput(f"Plan: the times of {save!r} are those of a run: plan.run(..., t_eval=)")
        several, kinds = systems_of(system), methods_of(method)
        first_system: Any = system if several is None else several[0]
        for each_method in (method,) if kinds is None else kinds:
            arguments.matching(first_system, each_method)
        self.system: Any = first_system if several is None else several
        self.method: Any = method if kinds is None else kinds
        self.record, self.events, self._one = options.record, options.events, first_system
        self.recorder = recorder_of(options.record, first_system)
        self._given: dict[str, Any] = {"system": system, "method": method} | options._asdict()
        numbers = [(name, getattr(options, name)) for name in ("h", "rtol", "atol", "max_step")]
        self.of_each: dict[str, Any] = {
            name: value
            for name, value in (("system", several), ("method", kinds), *numbers)
            if isinstance(value, OfBodies) or (value is not None and arguments.axes(value, name))
        }
        # of starts as they are given: how they are laid out in runs
        self._laid_out: dict[Any, tuple[Layout, int]] = {}
        self._backwards: dict[Any, Any] = {}  # what gradients have prepared
        first = self._first_of
        self.fictive = bool(first("method").fictive or first_system.fictive)  # steps equal in fictive time
        kind = FICTIVE if self.fictive else TOLERANCE if options.asks_for_tolerance else EQUAL
        options.require(kind, first("method"))
        self._steps: Any
        if kind == TOLERANCE:
            h = None if h is None else arguments.step_length(first("h"))
            tolerances = (
                arguments.tolerance(first("rtol"), "rtol", arguments.RTOL),
                arguments.tolerance(first("atol"), "atol", arguments.ATOL),
                arguments.longest(first("max_step")),
            )
            parameters: Any = h, *tolerances, options.breaks, options.dense, compiled, progress
            self._steps = AdaptiveSteps(first_system, first("method"), *parameters)
        else:
            h = arguments.step_lengths(h)
            digits = options.compensated, options.precision
            parameters = h, options.every, *digits, compiled, progress, options.workers
            self._steps = Steps(self.system, self.method, *parameters, breaks=options.breaks)  # type: ignore[misc]
        self.adaptive = not isinstance(self._steps, Steps)  # are they chosen by an error estimate?
        self.jumps = any(isinstance(event, Jump) for event in self.events)  # does the state jump?
        if self.jumps:
            self._require_jumps()
        self._sites = self._of_sites()
        of_each = {*self.of_each} - (set() if self.adaptive else {"system", "method"})
        kinds_of_methods = {type(each_method) for each_method in each_of(self.method)}
        self._warns = any(k.step_warning is not Method.step_warning for k in kinds_of_methods)
        self._plain = not (  # is there nothing to do but to step, by one clock?
            of_each or self.events or self.fictive or self.recorder is not None or options.progress
        )

    def _require_jumps(self) -> None:
        """Raise IncompatibleSystem where the state cannot jump."""
        why = "steps in fictive time" if self.fictive else "noise, which knows no state inside of a step"
        if self.options.precision != "double":
            why = "double-double numbers, for the times of events are found in doubles"
        elif not (self.fictive or self._first_of("method").noisy):
            return
        raise IncompatibleSystem(f"integrate: {self._first_of('method')!r} with a Jump: there are no jumps under {why}")

    def _first_of(self, name: str) -> Any:
        """The value of an option for the first body, or for all."""
        values = self.of_each.get(name)
        if values is None:
            return self._given[name]
        return values[0] if isinstance(values, OfBodies) else arguments.first(values, name)

    def replace(self, **changed: Any) -> Plan:
        """This plan with other arguments: another `system`, another `h`, ...

        Native code is shared as far as it depends on numbers only: another inertia costs no
        compilation.
        """
        values = [changed.pop(name, None) for name in ("control", "save")]
        changed = words_of(*values) | changed
        unknown = sorted(set(changed) - set(self._given))
        if unknown:
            raise InvalidInput(f"Plan.replace: there is no {unknown[0]}; there are {', '.join(self._given)}")
        system = changed.get("system")
        if (
            len(changed) == 1
            and isinstance(system, System)
            and not isinstance(self.system, OfBodies)
            and layout_of(system) == layout_of(self._given["system"])
        ):
            return self.of_system(system)
        return Plan(**self._given | changed)

    def of_system(self, system: System) -> Plan:
        """This plan of one system for another of the same layout, that is, with other numbers only:
        what is prepared is shared.
        """
        arguments.matching(system, of_body(self.method, 0))
        options, steps = self._given | {"system": system}, self._steps.of_system(system)
        other: Plan = like(self, system=system, _one=system, _given=options, _steps=steps)
        if self._sites is not None:
            other._sites = other._of_sites()
        return other

    def _of_sites(self) -> Any:
        """The runs of a system of many sites; None for all others."""
        site = self._one.site_form
        return None if site is None else site.runs_by_sites.of(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the arguments; layouts and native code are made or found again where the plan arrives."""
        return functools.partial(Plan, **self._given), ()

    # ---------------------------------------------------------------- whole runs

    @spelt
    def run(
        self,
        start: State,
        *,
        steps: int | None = None,
        t_end: Any = None,
        t0: float = 0.0,
        t_eval: Any = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float | str | timedelta = 60.0,
        executor: Any = None,
    ) -> Trajectory:
        """Follow the motion from a start at time t0, in so many steps or to the time t_end.

        start : `system.state(...)`; with a leading axis an ensemble.
        t_end : of fixed steps it is the end of one.  steps : of adaptive ones the largest
        number.
        t_eval : (n,) times at which to keep the state, instead of the ends of steps.
        In an ensemble with adaptive steps t_end may be (bodies,), and t_eval (n, bodies): then
        run.t is (n, bodies), too.
        checkpoint : a file to which the run is saved as far as it has come, every
        `checkpoint_every`: 30.0 seconds, or "10_000 steps".

        executor : of concurrent.futures, dask.distributed, ...: the bodies of an ensemble are
        divided among its workers.

        Returns and raises what `integrate` does.
        """
        if executor is not None:
            from ..rooms.at_work.spread import spread

            if checkpoint is not None:
                raise InvalidInput("integrate: checkpoint is for runs without executor")
            return spread(self, start, executor, steps=steps, t_end=t_end, t0=t0, t_eval=t_eval)
        try:
            if checkpoint is None:
                return self._run(start, steps, t_end, t0, t_eval, None)
            with self._kept(checkpoint, checkpoint_every) as saving:
                return saving.end(self._run(start, steps, t_end, t0, t_eval, saving))
        except IntegrationInterrupted:
            raise
        except KeyboardInterrupt:
            raise self._not_begun(lambda plan: plan._standing(start, t0)) from None

    def _by_sites(
        self, start: Any, steps: Any, t_end: Any, t0: Any, t_eval: Any, checkpoint: Checkpoint | None
    ) -> Trajectory | None:
        """A run of a system of many sites, site by site; None if it is to be written out."""
        sites = self._sites
        if sites.knows(start):
            t0 = arguments.real(t0, "t0")
            start = sites.started(self, start, t0)
            if sites.takes(start):
                self._warn_of(start)
        return sites.trajectory(start, steps, t_end, t0, checkpoint, t_eval)

    def _standing(self, start: Any, t0: float) -> Trajectory:
        """A run of no steps, whose only sample is the start."""
        return self.run(start, t0=t0, **{"t_end": t0} if self.adaptive else {"steps": 0})

    @contextmanager
    def _beginning(self, start: Any, t0: float) -> Iterator[None]:
        """Around what begins at a start, and may make native code for it: Ctrl-C leaves the start."""
        try:
            yield
        except IntegrationInterrupted:
            raise
        except KeyboardInterrupt:
            plain = {"record": None, "events": ()}
            raise self._not_begun(lambda plan: plan.replace(**plain)._standing(start, t0)) from None

    def _not_begun(self, standing: Callable[[Plan], Trajectory]) -> IntegrationInterrupted:
        """The interruption of a run before its steps.  standing : makes of a plan the run of no step."""
        stopped = IntegrationInterrupted(
            "integrate: interrupted before the steps, as while native code is made; where they were to "
            "begin is in `.trajectory`"
        )
        stopped.trajectory = standing(self.replace(compiled=False, progress=False))
        return stopped

    def _run(
        self, start: Any, steps: Any, t_end: Any, t0: Any, t_eval: Any, checkpoint: Checkpoint | None
    ) -> Trajectory:
        """A run of a start: site by site, a short one if that is enough, else one in pieces."""
        if self._sites is not None:
            trajectory = self._by_sites(start, steps, t_end, t0, t_eval, checkpoint)
            if trajectory is not None:
                return trajectory
        if checkpoint is None and self._plain:
            trajectory = short_run(self, start, steps, t_end, t0, t_eval)
            if trajectory is not None:
                return trajectory
        t0 = arguments.real(t0, "t0")
        start = self._started(start, t0)
        if self.fictive and steps is None and t_end is None:
            raise InvalidInput("integrate: give h, the step in fictive time, and steps or t_end")
        if self.fictive and t_end is None and t_eval is not None:
            raise InvalidInput("integrate: t_eval needs t_end, the time up to which the run goes")
        if not (self.adaptive or self.fictive or self._apart(start, t_end, t_eval)):
            self._count(steps, t_end, t0)
        self._warn_of(start)
        return self._in_pieces(start, t0, steps, t_end, t_eval, checkpoint)

    def _warn_of(self, start: Any) -> None:
        """Warn of what a run from this start would lose, or refuse it; of every layout alike."""
        if self.events:
            arguments.events(self.events)  # whose attributes may have changed
        if self.adaptive and self.options.atol is None:
            arguments.large_enough(start)
        doubt = None if self.adaptive or self.fictive else self._doubt(start)
        if doubt:
            warn(doubt, StepWarning)

    def _apart(self, start: Any, t_end: Any, t_eval: Any) -> bool:
        """Whether every body has a clock and a goal of its own. Otherwise they make the same steps."""
        inner = getattr(start, "inner", start)
        if self.events or getattr(start, "here", None) is not None:
            return True
        if isinstance(inner, Carry) and inner.bodies and not inner.together:
            return True
        is_ensemble = start.bodies is not None
        if self.fictive:
            differ = any(name in self.of_each for name in ("system", "method", "h"))
            return t_end is not None or (is_ensemble and differ)
        if not is_ensemble:
            return False
        of_each = "h" in self.of_each and (t_end is not None or t_eval is not None)
        axes = arguments.axes(t_end, "t_end") > 0 or arguments.axes(t_eval, "t_eval") > 1
        return of_each or axes

    def kind_of_run(self, start: Any, t_end: Any, t_eval: Any) -> Any:
        """The class of the run from such a start."""
        if self.adaptive:
            return ToleranceRun
        separate = self._apart(start, t_end, t_eval)
        if not self.fictive:
            return EqualRun if separate else StraightRun
        from ..rooms.fictive_time.runs import FictiveRun, StraightFictiveRun

        return FictiveRun if separate else StraightFictiveRun

    def _in_pieces(
        self, start: Any, t0: float, steps: Any, t_end: Any, t_eval: Any, checkpoint: Checkpoint | None
    ) -> Trajectory:
        """A run of the class for this start, made in pieces."""
        kind: Any = self.kind_of_run(start, t_end, t_eval)
        return kind(self, start, t0, steps, t_end, t_eval, checkpoint).trajectory()

    def _started(self, start: Any, t0: float = 0.0) -> Any:
        """The start, checked, with the parts that the run needs."""
        return started(self, start, t0)

    def _kept(self, path: Any, seconds: Any) -> Checkpoint:
        """The checkpoint to which a run is saved; refuses at once what cannot be saved."""
        checkpoint = arguments.checkpoint(path, seconds)
        for name, value in (("system", self._one), ("method", of_body(self.method, 0))):
            try:
                require_savable(value)
            except InvalidInput as error:
                raise InvalidInput(f"integrate: checkpoint: the {name} cannot be saved. {error}") from None
        return checkpoint

    def _doubt(self, start: State) -> str | None:
        """The warning of the method about its step, if it has one; of several systems the first."""
        if not self._warns:
            return None
        steps: Steps = self._steps
        start = start if self._sites is None else self._sites.as_one(start)
        if not self.of_each:
            return self.method.step_warning(self.system, start, steps.h)
        bodies = range(start.bodies or 0)
        doubts = (steps.method_of(i).step_warning(steps.system_of(i), member(start, i), steps.h_of(i)) for i in bodies)
        return next((doubt for doubt in doubts if doubt), None)

    @spelt
    def resume(
        self,
        run: Trajectory | Stepper,
        *,
        steps: int | None = None,
        t_end: Any = None,
        t_eval: Any = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float | str | timedelta = 60.0,
    ) -> Trajectory:
        """Go on where a run of this plan, or of an equal one, has ended: bit for bit as if it had
        not.

        The first sample is where the run came to; `every` goes on counting.  steps, t_end, t_eval,
        checkpoint : of what is to come.  `run.then(...)` makes one of both.
        Raises InvalidInput if the run was of another system, method or step, which it names, or if
        it was interrupted.
        """
        try:
            if checkpoint is None:
                return self._gone_on(run, steps, t_end, t_eval, None)
            with self._kept(checkpoint, checkpoint_every) as saving:
                return saving.end(self._gone_on(run, steps, t_end, t_eval, saving))
        except IntegrationInterrupted:
            raise
        except KeyboardInterrupt:
            end: Any = {"t_end": run.carry.t} if self.adaptive else {"steps": 0}
            raise self._not_begun(lambda plan: plan.resume(run, **end)) from None

    def _gone_on(self, run: Any, steps: Any, t_end: Any, t_eval: Any, checkpoint: Checkpoint | None) -> Trajectory:
        """The run from where another one ended, a short one if that is enough."""
        carry = carry_of(self, run, "resume")
        if isinstance(carry, SiteCarry):
            return self._sites.trajectory(carry, steps, t_end, 0.0, checkpoint, t_eval)
        plain = self._plain and not self.adaptive and t_eval is checkpoint is None
        if plain and type(carry) is Carry and carry.bodies is None:
            shape: Any = carry.shape
            count = self._count(steps, t_end, carry.t0, carry.step)
            if self._steps.owns(shape):
                trajectory = short_steps(self._steps, shape, carry, count, carry.t0)
                if trajectory is not None:
                    return trajectory
        return self._in_pieces(carry, 0.0, steps, t_end, t_eval, checkpoint)

    @property
    def _bound(self) -> Any:
        """The systems of bodies that have one each, if it depends on their parameters which states there are."""
        if self._one is self.system or self.fictive or not self._one.bounded:
            return None
        return self.system

    @property
    def _inner(self) -> Any:
        """The system whose states runs begin from; in fictive time the system inside of the transformed one."""
        return self._one.system if self._one.fictive else self._one

    def _count(self, steps: int | None, t_end: float | None, t0: float, before: int = 0) -> int:
        """The number of fixed steps, checked together with the times they lead to."""
        return arguments.fixed_steps(steps, t_end, t0, before, self._steps.h)

    def tangent(
        self,
        start: State,
        *,
        steps: int | None = None,
        t_end: float | None = None,
        t0: float = 0.0,
        by: str | Sequence[str] = "start",
        along: Any = None,
        against: Any = None,
    ) -> TangentTrajectory:
        """A run with its tangent map: the exact derivative of the discrete motion.

        by : "start", parameters of the system such as "inertia" or "hamiltonian.rotor", those of
        the method such as "method.sigma.power", the step "h" (at the same number of steps), or a
        list of these.  The derivative by parameters is as exact as that of what system and method
        compute of them when they are made, about 1e-13.
        With adaptive steps it is the derivative of the steps that were accepted, their lengths held
        fixed; t_end is needed.  In fictive time it is the derivative at the same fictive time, with
        the row of physical time behind the others, and steps are needed.

        along, against : (N,) or (N, k), for products with the map J by the start instead of J itself:
        J v as `tangent["along"]` and J^T w as `tangent["against"]`, (n, N) or (n, N, k).  Runs of many
        sites go site by site, once for each v; for J^T w they are gone through backwards, once for each w
        and each sample, where the method has a way back, else once for each of the N directions.

        With events the samples are those at ends of steps, a jump takes tangents to Xi = D then + (f+ - D then f- - then_t)
        grad w / (w_t + grad w . f-), w its event and f-+ the rates before and behind it, and `time_tangents` has the
        derivatives of the times of events.

        Returns a TangentTrajectory, whose `tangent["start"]` is (n, N, N): derivatives of the state at each sample,
        group elements left-trivialised, dg = g hat(eta).  Of an ensemble of m bodies, one after another, (n, m, N, N).
        Of many sites the N components are the momenta of all sites, then the eta of all. Raises what `integrate` does,
        for a body of an ensemble too; InvalidInput for what is no parameter, and for an event that grazes its zero;
        IncompatibleSystem for classical Hamilton-Jacobi methods, whose power series cannot carry a derivative, and for a
        jump whose `then` cannot be made beside the state in which it is.
        Source: di Bernardo, Budd, Champneys and Kowalczyk, Piecewise-smooth Dynamical Systems (2008), section 2.5.
        """
        from ..rooms.derivatives.tangent_runs import tangent_of

        return tangent_of(self, start, steps, t_end, t0, by, along=along, against=against)

    def gradient(
        self,
        loss: Any,
        start: State,
        *,
        steps: int | None = None,
        t_end: float | None = None,
        t0: float = 0.0,
        by: str | Sequence[str] = "start",
        along: Any = None,
        every: int | None = None,
    ) -> Gradient:
        """A loss and its exact derivative by the start and by parameters, in one pass backwards through
        the discrete motion, in memory that does not grow with the number of steps.

        loss : a formula of the last state, `lambda state: lm.dot(state.mu, state.mu)`, or of time and
        state; of an ensemble the value is the sum over its bodies, and a list has one formula for each.
        by : "start"; parameters of the system, such as "inertia" or "torque.values", also by the end of
        a longer name, those of the method, "method.theta", and the step "h".  Of a table, values are those
        of steps and of straight lines, "torque.coefficients" those of any piecewise polynomial.
        along : a running cost: a formula like `loss`, of which the values at the samples are added to it.
        every : steps between these samples, the start and the end among them; left out, that of the plan.

        Returns a Gradient: `value`, `gradient["inertia"]` in the shape of the parameter, the last state
        `run.last`, and `growth`, the norm of the tangent map.  gradient["start"] is (N,) in the frames
        of `tangent`.  With a list of systems parameters have a leading axis of bodies, else they are summed.
        With adaptive steps it is the derivative of the steps that were accepted, their lengths held fixed.
        With events it is by the last state alone, without along and every.
        Warns by a GradientWarning where the motion is so sensitive that few digits are left.
        Raises what `integrate` and `tangent` do.
        """
        from ..rooms.derivatives.gradient import backwards
        from ..rooms.derivatives.losses import Asked

        return backwards(self, "gradient", start, steps, t_end, t0, by, Asked(every, loss, along))

    def pullback(
        self,
        cotangent: Any,
        start: State,
        *,
        steps: int | None = None,
        t_end: float | None = None,
        t0: float = 0.0,
        by: str | Sequence[str] = "start",
        every: int | None = None,
    ) -> Gradient:
        """The products of a cotangent with the derivatives of the last state, or of all samples:
        `gradient` of a loss whose derivative by the states is known.

        cotangent : by the last state: a dict with arrays in the shapes of its parts, {"mu": (3,), "g": (3,
        3)}, or (N,) in the frames of `tangent`; with a leading axis of bodies for an ensemble.
        every : left out, of the last state; else of the samples after so many steps each, the start and the
        end among them, with a leading axis for these.
        by, and what is returned and raised : as of `gradient`; `value` is None.
        """
        from ..rooms.derivatives.gradient import backwards
        from ..rooms.derivatives.losses import Asked

        return backwards(self, "pullback", start, steps, t_end, t0, by, Asked(every, cotangent=cotangent))

    def _of_body(self, i: int) -> Plan:
        """The plan of body i alone, with its own parameters."""
        parameters = {name: values[i] for name, values in self.of_each.items()}
        dense = False if self.adaptive else None
        changed = {"progress": False, "workers": 1, "record": None, "dense": dense}
        return Plan(**self._given | changed | parameters)

    # ---------------------------------------------------------------- step by step

    def begin(self, start: State, t0: float = 0.0) -> Carry:
        """The carry at the start, from which `step` goes on."""
        self._one_length("begin")
        if self._sites is not None and self._sites.takes(start):
            return self.run(start, steps=0, t0=t0).carry
        if self.fictive:
            return like(self, events=()).run(start, steps=0, t0=t0).carry
        t0 = arguments.real(t0, "t0")
        start = self._started(start, t0)
        self._warn_of(start)
        with self._beginning(start, t0):
            return StraightRun(like(self, events=(), recorder=None), start, t0, 0, None, None).trajectory().carry

    def step(self, carry: Carry, steps: int = 1) -> Carry:
        """The carry after some more steps: its `t` and `state` are those of `run`, to the bit.

        For control loops and live pictures.
        Raises what `integrate` raises.
        """
        if type(steps) is not int or steps < 1:
            steps = arguments.count(steps, "steps", 1)
        current: Any = carry
        if type(current) is Carry and self._steps.owns(current.shape) and not self.jumps:
            return self._advanced(current, steps)
        current = carry_of(self, current, "step")
        if isinstance(current, SiteCarry):
            run = self._sites.by_hand(current)
            run.advance(steps)
            return run.carry
        if current.fictive:
            return current.moved(self.in_fictive_time(current.origin)._advanced(current.inner, steps))
        return self._advanced(current, steps)

    def in_fictive_time(self, origin: Any) -> Plan:
        """The plan of the system with its clock that began there."""
        return like(self, system=origin.whole, _steps=origin.steps(self._steps), of_each={})

    def _advanced(self, carry: Carry, steps: int) -> Carry:
        """The carry `steps` steps later, without samples between."""
        reached = advanced(self._steps, carry, steps)
        if reached is not None:
            return reached
        # of a failing step it says why
        sparse = dataclasses.replace(self._steps, every=steps)
        run = Advance(like(self, _steps=sparse, events=(), recorder=None), carry, 0.0, steps, None, None).trajectory()
        if run.carry is None:  # all bodies have stopped
            raise run.stopped[min(run.stopped)].error
        run.carry.met.update(carry.met)
        return run.carry

    def stepper(self, start: Any, t0: float | None = None) -> Stepper:
        """A run that is advanced by hand, a step or some at a time, at a cost of a microsecond.

        start : a state at the time t0, 0 by default; or a run, a stepper, or what `begin` and
        `step` gave, to go on from there.

            body = plan.stepper(start)
            body.step()
            print(body.t, body.mu)

        What formulas read counts as it is now, until `body.refresh()`.
        Raises what `step` and `resume` raise.
        """
        from ..rooms.at_work.stepper import Stepper

        self._one_length("stepper")
        if isinstance(start, State):
            return Stepper(self, self.begin(start, 0.0 if t0 is None else t0))
        if t0 is not None:
            raise InvalidInput(f"Plan.stepper: t0 = {t0!r} is for a state; what goes on has its time")
        return Stepper(self, carry_of(self, start, "stepper"))

    def export(
        self,
        path: str | os.PathLike[str],
        start: State | None = None,
        *,
        inputs: Sequence[str] | None = None,
        target: str | None = None,
    ) -> Any:
        """Write the steps as C code that needs no Python: "attitude" makes the object file
        attitude.o, the header attitude.h, which says how the state lies in memory, and
        attitude_example.c, a program that makes the run.

        start : a state, which says what the state in C has; left out, that of former runs.
        inputs : names of fields of the system that are arguments of the C function, as those of
        `stepper.step`.
        target : the processor: None is the simplest one of this platform, "native" this one; other
        platforms in LLVM's words, such as "aarch64-linux-gnu:cortex-a72".

        Returns what was written, with a bound on what a step does.  The numbers are those of
        `stepper`, to the bit, with the same C library.
        Raises NotCompilable for formulas that ask Python, IncompatibleSystem for steps that are not
        fixed ones of one body, InvalidInput for a name that C does not allow and for inputs of which
        other numbers are made.
        """
        from ..rooms.at_work.export import export

        return export(self, path, start, inputs, target)

    def _one_length(self, what: str) -> None:
        if self.jumps:
            raise InvalidInput(f"Plan.{what} looks for no events, so that no Jump would be made; use plan.run")
        if self.adaptive:
            raise InvalidInput(f"Plan.{what} is for fixed steps; give the plan an h, no tolerances, and no time scale")

    def __repr__(self) -> str:
        defaults = inspect.signature(Plan).parameters
        options = [
            f"{n}={x!r}"
            for n, x in self._given.items()
            if n not in ("system", "method") and x is not defaults[n].default
        ]
        return f"Plan({', '.join([repr(self.system), repr(self.method), *options])})"
