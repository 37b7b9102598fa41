"""Runs as functions that JAX and PyTorch differentiate: their derivatives are those of the discrete
motion, backwards through the run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, InvalidType, MissingExtra
from ...simulation.compiled.parameters import full_name, parameter, with_parameter
from ...simulation.plan import Plan
from ...systems.in_time.tabulated import PiecewisePolynomial
from ...systems.system import State, member
from .frames import Frames, dual_basis

Arrays = dict[str, np.ndarray]

SECOND = "{}: second derivatives of runs are not known; differences of gradients tell them"


def to_jax(
    plan: Plan, *, steps: int | None = None, t_end: float | None = None, t0: float = 0.0, every: int | None = None
) -> Callable[..., dict[str, Any]]:  # fmt: skip
    """A run as a function of JAX, which `jax.grad`, `jax.jit` and `jax.vmap` know: its derivative is that
    of the discrete motion, by `Plan.pullback`.

        move = lm.to_jax(plan, steps=1000)
        end = move({"mu": mu, "g": g}, inertia=J)        # {"mu": (3,), "g": (3, 3)}

    plan : a Plan of one system.  steps, t_end, t0 : as for `run`.  every : steps between the samples that are
    returned, on a first axis, the start among them; left out, only the last state is.
    The function takes the parts of the start by name, and by keyword parameters of the system that replace
    those of the plan, "inertia", "torque.values" as `**{"torque.values": u}`.  `vmap` over starts or
    parameters runs an ensemble, side by side.
    The derivative by an element g is a matrix whose product with every dg = g hat(eta) is right; across the
    group there is none, and that part is zero.  Forward mode (`jax.jvp`) is `Plan.tangent(along=)`; second
    derivatives are refused.
    Raises MissingExtra without JAX, InvalidInput with its numbers of single precision, and what `run` and
    `gradient` do, inside the errors of JAX.
    """
    jax = _needed("jax", "lm.to_jax")
    move = _Move(plan, steps, t_end, t0, every)
    like = jax.ShapeDtypeStruct

    def called(host: Callable[..., Any], wanted: Any, *given: Any) -> Any:
        return jax.pure_callback(host, wanted, *given, vmap_method="expand_dims")

    def forwards(parts: dict[str, Any], parameters: dict[str, Any]) -> dict[str, Any]:
        shapes = _shapes(parts), _shapes(parameters)
        wanted = {n: like((*move.lead, *x.shape), x.dtype) for n, x in parts.items()}
        return called(lambda *arrays: move.value(*arrays, *shapes), wanted, parts, parameters)

    def with_arguments(parts: dict[str, Any], parameters: dict[str, Any]) -> Any:
        return once(parts, parameters), (parts, parameters)

    @jax.custom_jvp
    def backwards(arguments: Any, cotangent: dict[str, Any]) -> Any:
        shapes = tuple(map(_shapes, arguments))
        wanted = tuple({n: like(x.shape, x.dtype) for n, x in arrays.items()} for arrays in arguments)
        return called(lambda *values: move.back(*values, *shapes), wanted, *arguments, cotangent)

    def twice(*_: Any) -> Any:
        raise IncompatibleSystem(SECOND.format("lm.to_jax"))

    once = jax.custom_jvp(forwards)
    once.defjvp(twice)
    backwards.defjvp(twice)
    differentiable = jax.custom_vjp(forwards)
    differentiable.defvjp(with_arguments, backwards)

    def run(start: Mapping[str, Any], **parameters: Any) -> dict[str, Any]:
        both = _mapping(start, "lm.to_jax"), parameters
        if any(jax.numpy.iscomplexobj(x) for named in both for x in named.values()):
            raise InvalidInput("lm.to_jax: derivatives are by real numbers; got complex ones")
        arrays = [{n: jax.numpy.asarray(x, dtype=float) for n, x in named.items()} for named in both]
        if any(x.dtype != np.float64 for named in arrays for x in named.values()):
            raise InvalidInput(
                "lm.to_jax: runs have double precision, and JAX has single unless told otherwise: "
                'jax.config.update("jax_enable_x64", True)'
            )
        return dict(differentiable(*arrays))

    return run


def to_torch(
    plan: Plan, *, steps: int | None = None, t_end: float | None = None, t0: float = 0.0, every: int | None = None
) -> Callable[..., dict[str, Any]]:  # fmt: skip
    """A run as a function of PyTorch, through which `backward` goes: its derivative is that of the
    discrete motion, by `Plan.pullback`.

        move = lm.to_torch(plan, steps=1000)
        end = move({"mu": mu, "g": g}, inertia=J)        # {"mu": (3,), "g": (3, 3)}, tensors of float64
        end["mu"].norm().backward()

    Arguments, what the function takes and returns, and derivatives by elements are those of `to_jax`.
    Raises MissingExtra without PyTorch, InvalidInput for tensors that are not of float64 on the processor,
    and what `run` and `gradient` do.
    """
    torch = _needed("torch", "lm.to_torch")
    move = _Move(plan, steps, t_end, t0, every)

    class TorchRun(torch.autograd.Function):  # type: ignore[name-defined]
        @staticmethod
        def forward(ctx: Any, names: Any, *tensors: Any) -> Any:
            ctx.names = names
            ctx.save_for_backward(*tensors)
            parts, parameters = _split(names, tensors)
            values = move.value(parts, parameters, _shapes(parts), _shapes(parameters))
            return tuple(torch.from_numpy(values[name].copy()) for name in names[0])

        @staticmethod
        def backward(ctx: Any, *cotangents: Any) -> Any:
            if torch.is_grad_enabled():  # with create_graph, which would take it for a constant
                raise IncompatibleSystem(SECOND.format("lm.to_torch"))
            parts, parameters = _split(ctx.names, ctx.saved_tensors)
            by_name = dict(zip(ctx.names[0], (c.detach().numpy() for c in cotangents), strict=True))
            gradients = move.back(parts, parameters, by_name, _shapes(parts), _shapes(parameters))
            return (None, *(torch.from_numpy(np.ascontiguousarray(x)) for part in gradients for x in part.values()))

    def run(start: Mapping[str, Any], **parameters: Any) -> dict[str, Any]:
        both = _mapping(start, "lm.to_torch"), parameters
        tensors = [torch.as_tensor(x) for named in both for x in named.values()]
        for x in tensors:
            if x.dtype != torch.float64 or x.device.type != "cpu":
                raise InvalidInput(
                    "lm.to_torch: runs have double precision on the processor; got a tensor of "
                    f"{x.dtype} on {x.device}: x.double().cpu()"
                )
        names = tuple(map(tuple, both))
        return dict(zip(names[0], TorchRun.apply(names, *tensors), strict=True))

    return run


def _split(names: Any, tensors: Any) -> tuple[Arrays, Arrays]:
    """The arrays of the parts of a start, and of the parameters, by name."""
    arrays, count = [x.detach().numpy() for x in tensors], len(names[0])
    return dict(zip(names[0], arrays[:count])), dict(zip(names[1], arrays[count:]))


def _needed(package: str, caller: str) -> Any:
    try:
        return import_module(package)
    except ImportError as missing:
        raise MissingExtra(f"{caller} needs {package}", extra=package) from missing


def _mapping(start: Any, caller: str) -> dict[str, Any]:
    """The parts of a start by name."""
    parts = start.parts if isinstance(start, State) else start
    if not isinstance(parts, Mapping):
        raise InvalidType(f'{caller}: the start is a state or its parts by name, {{"mu": mu, "g": g}}; got {start!r}')
    return {name: part for name, part in parts.items() if part is not None}


def _shapes(arrays: Mapping[str, Any]) -> dict[str, tuple[int, ...]]:
    return {name: tuple(x.shape) for name, x in arrays.items()}


class _Move:
    """A run of a plan as a function of arrays, with its pullback, for one start or for a batch of starts and
    parameters.

    Arrays of a batch have leading axes before the `shapes` (by name) of one start and one set of parameters; an axis of
    length one is broadcast.
    """

    def __init__(self, plan: Any, steps: Any, t_end: Any, t0: float, every: Any) -> None:
        if not isinstance(plan, Plan) or "system" in plan.of_each:
            raise InvalidType(f"lm.to_jax, lm.to_torch take a Plan of one system; got {plan!r}")
        if plan.adaptive and every is not None:
            raise InvalidInput("lm.to_jax, lm.to_torch: samples are of fixed steps; leave out every")
        self.plan, self.t0, self.every = plan, t0, every
        self.steps = None if plan.adaptive else plan._count(steps, t_end, t0)
        self.times = {"t_end": t_end} if self.steps is None else {"steps": self.steps}
        self.forwards = plan
        self.lead: tuple[int, ...] = ()
        if self.steps is not None:
            self.forwards = plan.replace(every=every or max(1, self.steps))
            self.lead = () if every is None else (1 + math.ceil(self.steps / every),)

    def value(self, parts: Arrays, parameters: Arrays, *shapes: Any) -> Arrays:
        """The last state, or the samples."""
        batch, parts, systems = self._batch(parts, parameters, shapes)
        start = self.plan._one.state(**parts)
        run = self._of(self.forwards, systems).run(start, t0=self.t0, **self.times)
        states = run.states if self.every is not None else run.last.parts
        axis = 1 if self.every is not None else 0
        return {
            name: np.moveaxis(states[name], axis, 0).reshape(*batch, *self.lead, *shapes[0][name])
            if batch
            else np.asarray(states[name])
            for name in parts
        }

    def back(self, parts: Arrays, parameters: Arrays, cotangent: Arrays, *shapes: Any) -> tuple[Arrays, Arrays]:
        """The products of a cotangent with the derivatives of `value`."""
        axes = [np.shape(c)[: np.ndim(c) - len(self.lead) - len(shapes[0][name])] for name, c in cotangent.items()]
        batch, parts, systems = self._batch(parts, parameters, shapes, axes)
        start = self.plan._one.state(**parts)
        by = ["start", *parameters]
        cotangents = {}
        for name, c in cotangent.items():
            whole = np.broadcast_to(c, (*batch, *self.lead, *shapes[0][name]))
            flat = whole.reshape(-1, *whole.shape[len(batch) :]) if batch else whole
            cotangents[name] = np.moveaxis(flat, 0, 1) if batch and self.every is not None else flat
        gradient = self._of(self.plan, systems).pullback(
            cotangents, start, t0=self.t0, by=by, every=self.every, **self.times
        ).gradient  # fmt: skip
        rows, frames = np.atleast_2d(gradient.pop("start")), Frames(self.plan._one, member(start, 0))
        points = {name: np.reshape(start.parts[name], (len(rows), *shapes[0][name])) for name in frames.of}
        numbers = (dual_basis(frames.basis(points)) @ rows[..., None])[..., 0]
        by_parts = dict(zip(frames.of, np.split(numbers, np.cumsum([*frames.widths.values()])[:-1], axis=1)))
        by_parts = {name: x.reshape(*batch, *shapes[0][name]) for name, x in by_parts.items()}
        return by_parts, {n: np.reshape(x, (*batch, *shapes[1][n])) for n, x in gradient.items()}

    def _batch(self, parts: Arrays, parameters: Arrays, shapes: Any, axes: Any = ()) -> Any:
        """The axes of a batch, the parts with one axis in their stead, and the systems: one, or one for each start.
        axes : of further arrays of the batch.
        """
        of_parts, of_parameters = shapes
        arrays = [(np.asarray(x), of_parts[n]) for n, x in parts.items()]
        arrays += [(np.asarray(x), of_parameters[n]) for n, x in parameters.items()]
        batch = np.broadcast_shapes(*(x.shape[: x.ndim - len(shape)] for x, shape in arrays), *axes)
        if batch and self.plan._one.site_form is not None:
            raise InvalidInput("lm.to_jax: of a system of many sites one start is run at a time")

        def laid(x: np.ndarray, shape: Any) -> np.ndarray:
            return np.broadcast_to(x, (*batch, *shape)).reshape(-1, *shape) if batch else np.asarray(x)

        parts = {name: laid(x, of_parts[name]) for name, x in parts.items()}
        values = {name: laid(x, of_parameters[name]) for name, x in parameters.items()}
        if not batch:
            return batch, parts, self._with(values)
        count = math.prod(batch)
        if not values:
            return batch, parts, [self.plan._one] * count
        return batch, parts, [self._with({n: x[k] for n, x in values.items()}) for k in range(count)]

    def _with(self, values: Mapping[str, np.ndarray]) -> Any:
        """The system with these values of parameters."""
        system = self.plan._one
        for name, value in values.items():
            before, _, last = name.rpartition(".")
            if last == "values" and before:
                full = full_name(system, before, "lm.to_jax")
                table = parameter(system, full)
                if isinstance(table, PiecewisePolynomial):
                    system = with_parameter(system, full, table.with_values(value))
                    continue
            full = full_name(system, name, "lm.to_jax")
            system = with_parameter(system, full, value if value.ndim else float(value))
        return system

    def _of(self, plan: Plan, system: Any) -> Plan:
        """A plan of another system, or of one for each body."""
        return plan if system is self.plan._one else plan.replace(system=system)
