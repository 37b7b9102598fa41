"""One run that is advanced by hand: for control loops, filters and live pictures."""

from __future__ import annotations

import ctypes
import dataclasses
import math
import struct
import threading
from typing import Any, NamedTuple

import numpy as np

from ...compiler.kernel import Kernel, Several
from ...errors import IntegrationInterrupted, InvalidInput
from ...formulas.classes.layouts import build, gatherer, layout_of
from ...simulation import arguments
from ...simulation.between.dense import unpacked
from ...simulation.compiled.control import FRESH, MARK, ORIGIN, STEP, STRAIGHT, TAKEN
from ...simulation.compiled.execution import like
from ...simulation.compiled.parameters import Input, full_name, parameter
from ...simulation.compiled.prepared import Steps
from ...simulation.compiled.systems import OfBodies, each_of
from ...simulation.runs import short
from ...simulation.runs.carry import Carry, SiteCarry
from ...simulation.runs.equal import WORTH
from ...simulation.runs.short import ENDLESS, FixedPlaces, place_of
from ...simulation.stopped import Stopped
from ...systems.system import State
from ..fictive_time.origin import FictiveCarry


class Stepper:
    """One run with fixed steps, advanced by hand; `Plan.stepper` makes it.

    It stands at a time and in a state, whose parts are attributes, arrays: `mu`, `g`, ...  All of
    it is what `Plan.run` gives, to the bit.

    Parameters of the system may change between steps, as the inputs of `step`: those steps are what
    they are for a system made with these values, and `plan` is the plan of it.

    What formulas read from outside counts as it is when the run begins, as in any other, and not
    anew at every step, of which it would be the larger part.  `refresh` looks at it again.

    Threads may share it: one steps at a time.  It can be pickled, and goes on where it stood.
    """

    # _first_plan, _first_carry : where it began.  _plan : with the inputs as they were last settled, of which `_held` has
    # values of later.  _carry : from which `_here` goes on, what steps in memory; None for plain Python.  _inputs : those
    # that were given once, by the names that were given.

    def __init__(self, plan: Any, carry: Any) -> None:
        self._first_plan, self._first_carry = plan, carry
        self._plan, self._lock = plan, threading.RLock()
        self._inputs: dict[str, Input] = {}
        self._held: dict[str, Any] = {}
        self._stand(carry)

    def step(self, steps: int = 1, **inputs: Any) -> None:
        """Go on by so many steps.

        inputs : new values of parameters of the system, by their names, `torque=u` or
        `**{"load.torque": u}`; they stay until they are given anew.  Of an ensemble one value for
        all bodies, or (bodies, ...).
        Raises what `integrate` raises.  Then it stands before the step that failed, and after
        Ctrl-C where it has come to.  InvalidInput for an input that is unknown, of another shape or
        not finite; then nothing has changed.
        """
        if type(steps) is not int or steps < 1:
            steps = arguments.count(steps, "steps", 1)
        with self._lock:
            if inputs:
                self._set(inputs)
            body = self._here
            while body is not None and steps:
                count = steps if steps < body.at_once else body.at_once
                try:
                    taken = body.advance(count)
                except KeyboardInterrupt:
                    raise IntegrationInterrupted(
                        f"Stepper.step: interrupted after {body.taken} steps, where it stands now"
                    ) from None
                steps -= taken
                if taken < count:
                    break
            if steps:
                self._slowly(steps)

    def reset(self, start: Any = None, t0: float | None = None, **inputs: Any) -> None:
        """Begin anew, at a state and a time, or where the stepper began; inputs that are not given
        are those of the plan that it was made of.

        Raises InvalidInput as `Plan.stepper` and `step` do.
        """
        with self._lock:
            other = (self._first_carry if start is None and t0 is None
                     else self._first_plan.stepper(self.start if start is None else start, t0).carry)  # fmt: skip
            self._plan, self._first_carry, self._held = self._first_plan, other, {}
            self._stand(other)
            if inputs:
                self._set(inputs)

    def at(self, t: float) -> State:
        """The state at a time in the step to come, from this time to the next one; the stepper stays
        where it is.

        For sensors that read between two steps.  Raises InvalidInput for other times.
        """
        with self._lock:
            if self._fictive or isinstance(self._carry, SiteCarry):
                raise InvalidInput("Stepper.at is for fixed steps in time, and of few sites")
            h, now, t = self._plan._steps.h, self.t, arguments.real(t, "t")
            if not isinstance(h, float) or not min(now, now + h) <= t <= max(now, now + h):
                raise InvalidInput(
                    f"Stepper.at: t = {t!r} is not in the step to come, from {now!r} by {h!r}; step there first"
                )
            if t == now:
                return self.state
            between = self._here.at(now, t - now) if isinstance(self._here, BodyInPlace) else None
            if between is not None:
                return between
            plan = self.plan
            if plan.recorder is not None or plan.record is not None or plan._steps.every != 1:
                plan = plan.replace(record=None, every=1)
            run = plan.resume(self, steps=1, t_eval=[t])
            return run.last

    @property
    def inputs(self) -> dict[str, Any]:
        """The values of all inputs that were given, by their full names."""
        with self._lock:
            systems, values_by_name = each_of(self.plan.system), {}
            for entry in {x.name: x for x in self._inputs.values()}.values():
                values = [parameter(system, entry.name) for system in systems]
                alone = len(values) == 1 or entry.shape is None
                values_by_name[entry.name] = values[0] if alone else np.array(values)
            return values_by_name

    @property
    def start(self) -> State:
        """The state in which it began."""
        return self._first_carry.state

    @property
    def plan(self) -> Any:
        """The plan of the system with the inputs as they are: what `resume` goes on with."""
        with self._lock:
            self._settle()
            return self._plan

    def joint(self, name: str | int) -> Any:
        """A joint of a linkage, by its name or number, in the state at this time: its `angle` and `rate`, `torque`,
        `reaction`, `moment` and `power`, as `Trajectory.joint` has them of each sample.  Angles lie within half a turn of
        zero.

        Raises InvalidInput for systems without joints and for unknown names.
        """
        return self._of_linkage("joint", "motion_at", name)

    def link(self, name: str | int) -> Any:
        """A body of a linkage, by its name or number, in the state at this time: its `pose`, `velocity`, `load` and `power`.

        Raises InvalidInput for systems without links and for unknown names.
        """
        return self._of_linkage("link", "link_at", name)

    def _of_linkage(self, noun: str, method: str, name: str | int) -> Any:
        """A joint or a link in the state at this time."""
        with self._lock:
            plan = self.plan
            motion = getattr(plan._one, method, None)
            if motion is None:
                raise InvalidInput(f"Stepper.{noun}: {plan._one!r} has no {noun}s")
            return motion(AtOneTime(plan.system, np.float64(self.t), self.mu, self.g), name)

    def refresh(self) -> None:
        """Look again at what formulas read from outside: the next steps are made with what is there
        now.
        """
        with self._lock:
            self._stand(self.carry)

    @property
    def carry(self) -> Any:
        """A copy of where it stands, for `Plan.step` of `plan`."""
        with self._lock:
            self._settle()
            return self._standing

    @property
    def _standing(self) -> Any:
        if self._here is None:
            return self._carry
        inner = self._here.carry
        return self._carry.moved(inner) if self._fictive else inner

    @property
    def t(self) -> Any:
        """The time, in s: t0 + n h after n steps; in fictive time the physical one."""
        body = self._here
        if body is None:
            return self._carry.t
        if not self._fictive:
            return float(self._carry.t0 + body.taken * self._carry.h)
        with self._lock:
            whole = self._carry.origin.whole
            times = whole.apart({name: x[None] for name, x in body.parts.items()})[0][0]
            return times if np.ndim(times) else float(times)

    @property
    def steps(self) -> int:
        """The number of steps taken since the start."""
        body = self._here
        return int(self._carry.step) if body is None else body.taken

    @property
    def stopped(self) -> Stopped:
        """The bodies of an ensemble that go no further: after how many steps, and why."""
        return self._standing.inner.stopped

    @property
    def state(self) -> State:
        """The state at this time."""
        with self._lock:
            return self._standing.state

    def __getattr__(self, name: str) -> Any:
        """A part of the state, an array of its own."""
        if name.startswith("_"):
            raise AttributeError(name)
        with self._lock:
            if isinstance(self._here, InPlace) and not self._fictive and name in self._here.parts:
                return self._here.parts[name].copy()
            parts = self.state.parts
        if name not in parts:
            raise AttributeError(f"a Stepper has no {name!r}; its state has {', '.join(parts)}")
        return None if parts[name] is None else np.array(parts[name])

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            raise AttributeError(f"{name} of a Stepper cannot be set; begin anew: plan.stepper(start, t0)")
        object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        with self._lock:
            return _unpickled, (self._first_plan, self._first_carry, self.plan, self.carry, [*self._inputs])

    def __repr__(self) -> str:
        return f"Stepper({self._plan.method!r}: {self.steps} steps to t = {self.t})"

    # ---------------------------------------------------------------- inputs

    def _set(self, inputs: dict[str, Any]) -> None:
        """Give parameters other values, all of them or none."""
        bodies, new = self._carry.bodies, []
        held, body = self._held.copy(), self._here
        for name, value in inputs.items():
            entry = self._inputs.get(name) or self._input(name)
            numbers = entry.numbers(value) if bodies is None else entry.columns(value, bodies)
            new.append(Held(entry, numbers, value))
            held[entry.name] = new[-1]
        try:
            if body is not None and body.take(new, held):
                self._held = held
                return
            self._become(self._plan_with(held), anew=True)
        except BaseException:
            if body is not None and self._here is body:
                body.take([*self._held.values()], self._held)
            raise

    def _input(self, name: str) -> Input:
        """The input of this name, perhaps known by a longer one.  Raises InvalidInput."""
        if self._fictive or (isinstance(self._carry, SiteCarry) and not self._here.takes_inputs):
            kind = "steps in fictive time" if self._fictive else "systems of many sites"
            raise InvalidInput(
                f"Stepper.step: {kind} take no inputs; go on with plan.replace(system=...).stepper(loop.state, loop.t)"
            )
        system = each_of(self._plan.system)[0]
        full = full_name(system, name, "Stepper.step")
        former = next((entry for entry in self._inputs.values() if entry.name == full), None)
        self._inputs[name] = entry = former or Input(system, full, "Stepper.step")
        return entry

    def _plan_with(self, held: dict[str, Held]) -> Any:
        """The plan of the system with these values, or of those of all bodies."""
        systems, bodies = each_of(self._plan.system), self._carry.bodies
        apart = isinstance(self._plan.system, OfBodies)
        if bodies and (apart or any(x.numbers.shape[1] > 1 for x in held.values())):
            apart, systems = True, systems if apart else systems * bodies
        for x in held.values():
            rows = np.reshape(x.numbers, (x.input.width, -1)).T
            systems = [x.input.in_system(s, rows[i % len(rows)]) for i, s in enumerate(systems)]
        return self._plan.replace(system=systems if apart else systems[0])

    def _settle(self) -> None:
        """Let the plan have the values that inputs have."""
        if self._held:
            self._become(self._plan_with(self._held), anew=False)

    def _become(self, plan: Any, anew: bool) -> None:
        """Go on with the plan of another system.

        anew : is what the method carries along beside the state another system's?
        """
        if isinstance(self._carry, SiteCarry):
            self._here.become(plan, anew)
            self._plan, self._held = plan, {}
            return
        carry, old = self._standing, self._plan._steps.shapes
        state = carry.state
        key = next((key for key, shape in [*old.items()] if shape is carry.shape), None)
        shape = plan._steps.shapes.get(key)
        if shape is None or (anew and shape.order is None):
            fresh = plan.begin(state, carry.t0)  # no method begins by the time
            shape = fresh.shape
            if shape.order is None and anew:
                carry = dataclasses.replace(carry, numbers=fresh.numbers)
        carry = dataclasses.replace(carry, shape=shape)
        vars(carry)["state"] = state
        self._plan, self._held = plan, {}
        self._stand(carry)

    # ---------------------------------------------------------------- how it steps

    def _stand(self, carry: Any) -> None:
        """Take over a carry; if there is native code, go on from there in place."""
        self._carry, self._fictive = carry, isinstance(carry, FictiveCarry)
        self._here: Any = None  # bodies `InPlace`, or a run of many sites
        if isinstance(carry, SiteCarry):
            self._here = self._plan._sites.by_hand(carry)
            return
        inner: Carry = carry.inner
        steps = carry.origin.steps(self._plan._steps) if self._fictive else self._plan._steps
        if not steps.owns(inner.shape):
            return
        if inner.bodies is None:
            place = place_of(steps, inner.shape)  # type: ignore[arg-type]
            native = place.native(1)
            if native is not None:
                self._here = BodyInPlace(place, native, inner)
        elif not (self._fictive or inner.ended) and type(inner.h) is float:
            lanes = inner.shape.lanes_of(steps, STRAIGHT, (), inner.shape.side)  # type: ignore[union-attr]
            if lanes.stepping.native is not None:
                self._here = BodiesInPlace(steps, lanes, inner, self._plan.options.workers)

    def _slowly(self, steps: int) -> None:
        """Go on by `Plan.step`, for plain Python and for a step that fails."""
        self._settle()
        while steps:
            carry, count = self.carry, steps
            try:
                reached = self._plan.step(carry, count)
            except (Exception, KeyboardInterrupt) as error:
                run = getattr(error, "trajectory", None)
                if run is None or not 0 < run.steps < steps:
                    raise
                if isinstance(error, KeyboardInterrupt):
                    reached = run.carry
                    if self._fictive and reached is not None:
                        reached = carry.moved(reached)
                    self._stand(reached or carry)
                    raise
                count = run.steps  # to the last one that can be made, and fail there
                reached = self._plan.step(carry, count)
            self._stand(reached)
            steps -= count


def _unpickled(first_plan: Any, first_carry: Any, plan: Any, carry: Any, names: list[str]) -> Stepper:
    """A stepper from a file or another process, at this carry, with these inputs known."""
    stepper = Stepper(first_plan, first_carry)
    stepper._plan = plan
    stepper._stand(carry)
    for name in names:
        stepper._input(name)
    return stepper


class AtOneTime(NamedTuple):
    """The state of a linkage at one time, where `JointMotion` and `LinkMotion` have the samples of a run.

    t : 0-d.  mu, g : of one linkage, (dim,) and (16 N,), or of an ensemble, with an axis before.
    """

    system: Any
    t: Any
    mu: np.ndarray
    g: np.ndarray
    bodies: None = None

    def of_body(self, i: int) -> AtOneTime:
        """The state of one of several linkages."""
        return AtOneTime(self.system[i], self.t, self.mu[i], self.g[i])

    @property
    def multipliers(self) -> Any:
        """The multipliers of the joints' conditions."""
        return self.system.multipliers(self.mu, self.g, float(self.t))


class Held(NamedTuple):
    """The value of an input that steps hold."""

    input: Input
    numbers: Any  # (width,) or, of an ensemble, (width, 1) or (width, bodies)
    value: Any  # the value given by the user; its tables stay in memory as long as this record


class InPlace:
    """Bodies in memory that native code advances in place; abstract.

    begun : the carry from which they go on.  numbers, sample : views of what is carried along, and of the sample.
    parts : arrays of the state by name.  at_once : so many steps come back in milliseconds.
    beginning : who begins, if the method carries more than the state, as formulas are read by this stepper.
    """

    begun: Any
    numbers: Any
    sample: Any
    parts: Any
    at_once: int
    beginning: Any

    @property
    def taken(self) -> int:
        """The number of steps taken, from the start on."""
        raise NotImplementedError

    def advance(self, steps: int) -> int:
        """Go on by at most `steps` steps; returns how many could be made."""
        raise NotImplementedError

    def take(self, new: list[Held], held: dict[str, Held]) -> bool:
        """Take over new inputs, beside all that are held; False if more would change than numbers in place."""
        raise NotImplementedError

    def _begin_natively(self) -> bool:
        """Let native code begin with the states here; False if a body cannot."""
        raise NotImplementedError

    def _begin_again(self) -> bool:
        """Let the method begin with the states here, as far as it carries more along."""
        beginning, shape = self.beginning, self.begun.shape
        if beginning is None:
            return True
        if beginning.native is None:
            beginning.compile()  # commands come often
        return beginning.native is not None and shape.given == shape.shown and self._begin_natively()

    @property
    def carry(self) -> Carry:
        """The carry of the bodies, a copy."""
        start = self.begun
        standing = start.shape, start.t0, start.h, self.taken, self.numbers.copy(), self.sample.copy()
        return Carry.quickly(*standing, start.met, start.bodies)


class BodyInPlace(InPlace):
    """One body, in the memory of a short run, whose last numbers are the sample.

    block : the arguments of native code.  again : those of the code that begins, and its buffers.  blocks : both, and where
    the numbers of the system begin.  system : as it was last made.
    """

    def __init__(self, place: FixedPlaces, native: Kernel, carry: Carry) -> None:
        self.place, self.native, self.begun = place, native, carry
        self.beginning = None if place.beginning is None else place.beginning.of_a_run()
        self.memory = np.empty(place.kept + place.sampled)
        place.go_on(carry, self.memory)
        self.numbers, self.sample = self.memory[: place.carried], self.memory[place.kept :]
        self.parts = unpacked(place.shape.shown, self.sample)
        self.at_once = short.LONGEST // place.carried**2
        self.buffers = place.buffers(self.memory, 1, place.kept)
        self.system: Any = place.lanes.arguments[1]
        begin = 8 * layout_of(place.lanes.arguments[0]).width
        self.block = changing(place.block(self.buffers, 1, 1))
        self.blocks = [(self.block, place.words + begin)]
        if self.beginning is not None:
            _, (states, _), (clock, _), rows = self.buffers
            words = 1, 0, 1, rows[0], clock, states, rows[0]
            block = changing(struct.pack(f"7q{len(place.constants)}s", *words, place.constants))
            self.again = block, (rows, self.buffers[2], self.buffers[1], rows)
            self.blocks.append((block, 8 * len(words) + begin))

    @property
    def taken(self) -> int:
        return int(self.memory.item(self.place.taken))

    def advance(self, steps: int) -> int:
        taken, at = self.memory.item, self.place.taken
        before = taken(at)
        _STEPS(self.block, _AT_STEPS, steps)
        self.native.on_memory(self.block, self.buffers)
        return int(taken(at) - before)

    def at(self, now: float, length: float) -> State | None:
        """The state after a step of this length from now on, made in a copy of the memory; None if the method begins with
        more than the state, or fails.
        """
        if self.beginning is not None:
            return None
        place, memory, block = self.place, self.memory.copy(), changing(bytes(self.block))
        memory[place.clock + STEP], memory[place.taken] = length, 0.0
        memory[place.goal + ORIGIN] = now
        buffers = place.buffers(memory, 1, place.kept)
        goal, states, clock, rows = [begin for begin, _ in buffers]
        struct.pack_into("5q", block, _AT_STEPS, 1, goal, states, clock, rows)
        self.native.on_memory(block, buffers)
        if memory.item(place.taken) != 1.0:
            return None
        return build(place.shape.shown, iter(memory[place.kept :].tolist()))

    def take(self, new: list[Held], held: dict[str, Held]) -> bool:
        system = self.system
        for entry, numbers, _ in new:
            if entry.places is None:
                system = entry.in_system(system, numbers)
        if system is not self.system:
            numbers = gatherer(layout_of(system))(system)
            for block, at in self.blocks:
                struct.pack_into(f"{len(numbers)}d", block, at, *numbers)
            self.system, new = system, [*held.values()]
        for entry, numbers, _ in new:
            for place in entry.places or ():
                for block, at in self.blocks:
                    entry.pack(block, at + 8 * place, *numbers)
        return self._begin_again()

    def _begin_natively(self) -> bool:
        memory, mark = self.memory, self.place.clock + MARK
        self.beginning.native.on_memory(*self.again)
        good = memory.item(mark) == 0.0
        memory[mark] = 0.0
        return good


_STEPS, _AT_STEPS = struct.Struct("q").pack_into, 8 * 4
"""Where the block has the number of steps."""


def changing(block: bytes) -> Any:
    """Arguments of native code that may be written over."""
    return (ctypes.c_char * len(block)).from_buffer_copy(block)


class BodiesInPlace(InPlace):
    """The bodies of an ensemble, in memory that native code advances in place.

    table : a column for each, as of a run.  rows : two samples, of which number `now` is here.
    before : the table before a call of native code, to which it goes back if a body fails, and after
    Ctrl-C.
    """

    def __init__(self, steps: Steps, lanes: Any, carry: Carry, workers: int) -> None:
        shape: Any = carry.shape
        self.begun, self.lanes, self.workers, self.count = carry, lanes, workers, carry.bodies or 1
        self.beginning = None if shape.order is not None else shape.beginning(steps, lanes).of_a_run()
        columns, self.whole = shape.columns(self.count), shape.whole(self.count)
        self.table, self.now = np.zeros((lanes.height, columns)), 0
        self.rows = np.zeros((2, 1, shape.shown.width, columns))
        self.at_once = max(1, short.LONGEST // (lanes.layout.width**2 * columns))
        self.all_numbers, self.clocks, goals, *self.own = lanes.parts(self.table)
        self.numbers = self.all_numbers[:, : self.count]
        self.numbers[:] = carry.numbers
        self.rows[0, 0, :, : self.count] = carry.last
        self.clocks[:] = np.array([carry.t, carry.h, *FRESH])[:, None]
        self.clocks[TAKEN] = carry.step
        goals[:] = np.array([math.inf, 0.0, 0.0, 0.0, ENDLESS, carry.t0])[:, None]
        for rows, parameters in zip(self.own, lanes.own, strict=True):
            rows[:, : self.count] = parameters[:, : self.count]
        self._fill(self.table)
        self.before = self.table.copy()

    def _fill(self, table: np.ndarray) -> None:
        """Repeat the last body in the lanes that are left over."""
        table[:, self.count :] = table[:, self.count - 1 : self.count]

    @property
    def taken(self) -> int:
        return int(self.clocks.item(TAKEN, 0))

    sample: Any = property(lambda self: self.rows[self.now, 0, :, : self.count])
    parts: Any = property(lambda self: unpacked(self.begun.shape.shown, self.sample.T))

    def advance(self, steps: int) -> int:
        """Go on by `steps` steps, or by none if a body cannot make them."""
        reached, was = self.taken + steps, self.now
        np.copyto(self.before, self.table)
        try:
            call = self.table, self.rows[1 - was], 1, self.workers, steps, range(self.whole)
            self.lanes.natively(*call, worth=WORTH)
            if (self.clocks[TAKEN, : self.whole] == reached).all():
                self.now = 1 - was
                return steps
        except BaseException:
            self.table[:], self.now = self.before, was
            raise
        self.table[:] = self.before
        return 0

    def take(self, new: list[Held], held: dict[str, Held]) -> bool:
        if any(x.input.places is None for x in new):
            return False
        if isinstance(self.lanes.arguments[1], Several):
            for x in new:
                for place in x.input.places:  # type: ignore[union-attr]
                    self.own[-1][place : place + x.input.width, : self.count] = x.numbers
            self._fill(self.own[-1])
            return self._begin_again()
        if any(x.numbers.shape[1] > 1 for x in new):
            return False
        constants = bytearray(self.lanes.constants)
        method = self.lanes.arguments[0]
        begin = 0 if isinstance(method, Several) else 8 * layout_of(method).width
        for x in new:
            for place in x.input.places:  # type: ignore[union-attr]
                x.input.pack(constants, begin + 8 * place, *x.numbers[:, 0])
        self.lanes = like(self.lanes, constants=bytes(constants))
        return self._begin_again()

    def _begin_natively(self) -> bool:
        states, before = self.rows[self.now, 0], self.table.copy()
        arrays = *self.own, states, self.clocks, self.all_numbers, states
        self.beginning.run(self.lanes.constants, (), arrays, states.shape[1], 0, self.whole)
        if self.clocks[MARK, : self.whole].any():
            self.table[:] = before
            return False
        return True
