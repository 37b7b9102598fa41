"""`integrate`: a motion in one call, by a plan that is kept for the next call."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from datetime import timedelta
from typing import Any

from ..errors import InvalidInput, NotCompilable
from ..formulas.classes.exact_keys import exact_key
from ..formulas.classes.layouts import layout_of, leaves
from ..formulas.classes.signatures import spelt
from ..integrators.method import Method
from ..systems.system import State, System
from . import arguments
from .compiled.systems import methods_of, systems_of
from .options import EQUAL, TOLERANCE, ErrorControl, FixedSteps, Options, Save, times_of
from .plan import Plan
from .trajectory import Trajectory

KEPT = 32
"""Plans that are kept."""

_plans: dict[Any, Plan] = {}


@spelt
def integrate(
    system: System | Sequence[System],
    method: Method | Sequence[Method],
    start: State,
    *,
    control: FixedSteps | ErrorControl | None = None,
    save: Save | None = None,
    h: Any = None,
    steps: int | None = None,
    every: int = 1,
    t_end: Any = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    breaks: Any = (),
    t_eval: Any = None,
    events: Any = (),
    dense: bool | None = None,
    record: Iterable[str] | None = None,
    t0: float = 0.0,
    compensated: bool | None = None,
    precision: str = "double",
    compiled: bool | None = None,
    progress: bool | None = None,
    workers: int = 1,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: float | str | timedelta = 60.0,
    executor: Any = None,
) -> Trajectory:
    """Follow a motion, in `steps` steps of length h, or adaptively to the time `t_end`.

    control, save : FixedSteps(h), ErrorControl(rtol, atol) and Save(every=..., at=..., record=...) say
    by values what the words below say; with FixedSteps steps are fixed up to t_end too, whatever the
    method.

    system : a list of systems of one kind, one for each body of an ensemble, gives every body its
    own parameters; so does a list of methods of one kind.
    start : `system.state(...)`; with a leading axis an ensemble, which runs in SIMD lanes.
    record : the parts of the state to keep, such as ("mu",) or ("mu", "g"); what is not recorded is
    not computed.  Or functions of it, kept instead: methods of the system by name, ("energy",),
    functions of t and state, and pairs [(name, function), ...].  Of many sites a function whose
    second argument is called `site` is summed over all of them, and [("mu", [0, 17])] keeps these sites only.
    t_eval : (n,) times at which to keep the state; default: at the ends of steps.
    breaks : times at which the velocity jumps; no step goes across one: of a step of length h they
    make several.  Where a PiecewisePolynomial in a field of the system jumps is known.
    events : functions of t and state whose zeros are looked for; their attributes `terminal` (True:
    the first zero ends the run; 3: the third one) and `direction` (+1 only rising, -1 only falling
    zeros) mean what they do in SciPy; at those of a `Jump` the state jumps.  Of an ensemble
    run.events[k][i] is what body i has met.  Of many sites one whose second argument is called
    `total` is of the totals that `record` names.
    compiled : True for native code, False for plain Python, None for native code as soon as it is
    there or pays; same bits.
    progress : True or False; None shows a bar when a run takes longer than a second.
    checkpoint : a file to which the run is saved as far as it has come, every `checkpoint_every`:
    30.0 seconds, or "10_000 steps"; Trajectory.load reads it.

    Fixed steps: kept are the start, every `every`-th state after it, and the last one.
    h : the step, in s; negative runs backwards.  Times are t0 + n h.  An array, (bodies,), gives
    every body of an ensemble its own, and run.t is (n, bodies).  A method without an error estimate,
    or one that keeps the structure, may be given h and t_end instead of steps; t_end is then the end
    of a step, of every body.
    compensated : whether the increments of the steps are summed up in compensated numbers: True for
    all parts of the state, False for none, None for those that the motion depends on, if the method
    is symmetric or symplectic and adds to them.
    precision : "double", or "double-double" for steps in numbers of two doubles: 31 digits, of
    which the samples show 16.
    workers : threads among which the bodies of an ensemble are divided.
    executor : of concurrent.futures, dask.distributed, ...: the same for its workers, which may be
    processes and machines.  Between the ends of steps t_eval and events take a shorter step of the
    method.

    Adaptive steps, for a method with an error estimate; in an ensemble every body chooses its own,
    and t_eval says what is kept:
    t_end : the last time, before or after t0; (bodies,) gives every body its own, as t_eval of
    shape (n, bodies) does.
    h, steps : the first step and the largest number of steps, if given.
    rtol, atol : the error of a step is kept below atol + rtol |state| (1e-6 and 1e-9); (bodies,)
    gives every body its own, as for h and max_step.  As with
    every local error control, the error of the motion grows along it.
    max_step : the longest step.
    dense : keep the way between the steps too, for `Trajectory.at`; default: unless t_eval is
    given, and then nothing else is kept.

    For many runs of one kind, runs that go on, and single steps, prepare a `Plan`.

    Returns a Trajectory.  Raises InvalidInput, InvalidType, IncompatibleSystem, or an
    IntegrationFailure whose `.trajectory` has every sample recorded before the step that failed; so
    has the IntegrationInterrupted of a Ctrl-C.  A mistake in a formula (NameError, TypeError,
    IndexError, ...) is raised as it is, with such a `.trajectory`.  Warns with a StepWarning of a
    step that may have no solution, where the method can tell.
    In an ensemble a body that fails stays where it came to (at its last sample, if the bodies go each
    its own way), is found in `Trajectory.stopped` with its reason, and in a warning, and disturbs no
    other.
    """
    options = Options(
        h, rtol, atol, max_step, breaks, every, record, events, dense, compensated, precision,
        compiled, progress, workers,
    )  # fmt: skip
    fixed = False
    if control is not None or save is not None:
        fixed = isinstance(control, FixedSteps)
        options, t_eval = options.with_values(control, save), times_of(save, t_eval)
    key: Any = None
    if isinstance(system, System) and isinstance(method, Method):
        layout = layout_of(method)
        numbers = exact_key(tuple(leaves(method, layout))) if layout.width else ()
        key = (layout_of(system), layout, numbers, t_end is None, fixed, *map(type, options), *options)
    try:
        plan = _plans.get(key)
    except TypeError:  # a list or an array among them
        plan = key = None
    if plan is not None and plan.system is not system:
        plan = _plans[key] = plan.of_system(system)  # type: ignore[arg-type]  # with a key it is one system
    if plan is None:
        several, kinds = systems_of(system), methods_of(method)
        first_system: Any = system if several is None else several[0]
        first_method: Any = method if kinds is None else kinds[0]
        arguments.matching(first_system, first_method)
        if first_method.fictive or first_system.fictive:
            pass
        elif t_end is None or fixed:
            options._replace(dense=None).require(EQUAL, first_method)
            if options.h is None or (steps is None and t_end is None):
                raise InvalidInput("integrate: give h and steps, for fixed steps, or t_end, for adaptive ones")
        elif options.asks_for_tolerance or arguments.chooses_steps(first_method):
            options.require(TOLERANCE, first_method)
            options = options._replace(rtol=arguments.RTOL if options.rtol is None else options.rtol)
        plan = Plan(system, method, **options._asdict())
        if key is not None:
            if len(_plans) >= KEPT:
                _plans.pop(next(iter([*_plans])), None)
            _plans[key] = plan
    keywords: dict[str, Any] = (
        {} if checkpoint is None else {"checkpoint": checkpoint, "checkpoint_every": checkpoint_every}
    )
    if executor is not None:
        keywords["executor"] = executor
    try:
        return plan.run(start, steps=steps, t_end=t_end, t0=t0, t_eval=t_eval, **keywords)
    except NotCompilable as error:
        raise error.with_traceback(None)  # noqa: B904 - it names the formula and its line; the way through the compiler tells nothing
