"""A driver as a module of LLVM: a loop over bodies, or the step of one system with all its sites."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.classes.layouts import Layout
from ...formulas.classes.taken_back import journal
from .. import driver
from ..buffers import NativeArray, SiteRows, arguments, arrays_of, entrance, unchanged
from ..changes.dependencies import Reads
from ..driver import Kind, layout_of_kind
from ..machine import llvm
from ..numbers.ir_numbers import F64, I64, Emitter
from ..numbers.large_arrays import LargeArrays
from ..numbers.rows_in_lanes import RowsInLanes
from ..sites.loops_over_sites import SiteLoops
from . import instructions
from .instructions import Builder, Names, TooLong, drop_unused
from .translator import Interpreter


def translated(
    entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int, arguments: Sequence[Any] | None
) -> tuple[Reads, str]:
    """The reads of a translation, and the kernel in LLVM's language.

    In lanes each number gets a register, and two if the kernel is short.  One that is long is made
    in half the time, and is the faster one too, because the others would not find room beside each
    other.
    """
    width = llvm.width()
    slopes = getattr(entry, "goes_back", False) or _directions(kinds) == 1
    limit = instructions.LIMIT * (instructions.WITH_SLOPES if slopes else 1)
    if "planes" in kinds:
        return _translation(entry, kinds, lanes, arguments, limit)
    translation = _translation(entry, kinds, min(lanes, width), arguments, limit)
    if lanes > width and llvm.size(translation[1]) <= instructions.SHORT:
        with contextlib.suppress(TooLong):
            return _translation(entry, kinds, lanes, arguments, instructions.SIDE_BY_SIDE)
    return translation


def _translation(
    entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int, values: Sequence[Any] | None, limit: int
) -> tuple[Reads, str]:
    """The reads, and in LLVM's language the driver in a loop over bodies, of `limit` instructions at most."""
    width = llvm.width()
    module = ir.Module("liemech", ir.Context())
    module.triple = llvm.triple()
    signature = ir.FunctionType(
        ir.VoidType(), [F64.as_pointer(), I64.as_pointer(), F64.as_pointer().as_pointer(), I64, I64, I64]
    )
    function = ir.Function(module, signature, "loop")
    function.scope = Names(function)
    for pointer in function.args[:3]:
        pointer.add_attribute("noalias")
    function.attributes.add("nounwind")
    if lanes > 1:
        # else every register kept on the stack straddles two cache lines
        function.attributes.alignstack = 8 * width
    builder = Builder(function.append_basic_block("entry"), limit)
    head, body, after = (function.append_basic_block(n) for n in ("head", "body", "done"))
    of_sites = "planes" in kinds  # one system, whose sites have the lanes
    emitter = Emitter(builder, 1 if of_sites else lanes, width)
    emitter.few = of_sites and 1 < lanes < width
    in_memory = any(isinstance(k, Layout) and _in_memory(k) for k in map(layout_of_kind, kinds))
    if in_memory:
        if lanes > 1:
            raise NotCompilable("what lies in memory runs one body after the other")
        emitter.large = LargeArrays(emitter)
    args = arguments(emitter, kinds, function)
    start = builder.block
    begin, end = function.args[4:] if not of_sites else map(I64, (0, 1))
    builder.branch(head)
    builder.position_at_end(head)
    index = builder.phi(I64)
    index.add_incoming(begin, start)
    builder.cbranch(builder.icmp_signed("<", index, end), body, after)
    builder.position_at_end(body)
    reads = Reads(entry)
    for i, (a, kind) in enumerate(zip(args, kinds, strict=True)):
        if isinstance(a, NativeArray):
            a.body = index
        if isinstance(kind, tuple):
            args[i] = a = a.read(0, kind[1])
        if isinstance(layout_of_kind(kind), Layout):
            reads.argument(i, a, values[i] if values else a)
    interpreter = Interpreter(emitter, reads)
    interpreter.intrinsics |= {
        driver.read: lambda array, at, layout: array.read(at, interpreter.outliner.fitting(layout)),
        driver.write: lambda array, at, value, layout: array.write(at, value, layout),
        driver.unchanged: unchanged,
        driver.attempt: interpreter.attempt,
        driver.accepted: interpreter.accepted,
        driver.any_body: emitter.any,
    }
    sites = SiteLoops(interpreter, lanes, width)
    interpreter.intrinsics |= sites.intrinsics | RowsInLanes(interpreter, width).intrinsics
    if of_sites:
        _, integer = next(a.numbers for a in args if isinstance(a, SiteRows))
        sites.enter(arrays_of(kinds), integer)
    try:
        with journal():
            interpreter.call(entry, *args)
    except Exception as error:
        located = _located(error, interpreter)
        if located is error:
            raise
        raise located from (None if isinstance(error, NotCompilable) else error)
    index.add_incoming(builder.add(index, I64(emitter.lanes)), builder.block)
    builder.branch(head)
    builder.position_at_end(after)
    if in_memory:
        emitter.large.finish()
    builder.ret_void()
    size = drop_unused(module, function)
    entrance(module, function, kinds, sites.needs)
    return reads, f"; {size} instructions\n{module}"


def _directions(kinds: tuple[Kind, ...]) -> int:
    """The largest number of directions along which numbers of a driver carry derivatives."""
    layouts = [x for x in map(layout_of_kind, kinds) if isinstance(x, Layout)]
    carried = [x.detail for x in layouts if x.kind == "static" and isinstance(x.detail, Layout)]
    return max([x.directions for x in [*layouts, *carried]], default=0)


def _in_memory(layout: Layout) -> bool:
    """Whether a value of this layout, or the layout that is itself the value, has parts in memory."""
    described = layout.detail if layout.kind == "static" else None
    return layout.in_memory or (isinstance(described, Layout) and described.in_memory)


def _located(error: Exception, interpreter: Any) -> Exception:
    """The error with the class, method and line of the formula that could not be translated."""
    if not interpreter.frames:
        return error
    frame = interpreter.frames[-1]
    line = getattr(frame.node, "lineno", frame.source.function.__code__.co_firstlineno)
    reason = str(error) if isinstance(error, NotCompilable) else f"{type(error).__name__}: {error}"
    kind = type(error) if isinstance(error, NotCompilable) else NotCompilable
    return kind(
        f"{frame.source.name} ({os.path.basename(frame.source.file)}, line {line}) cannot be compiled: {reason}"
    )
