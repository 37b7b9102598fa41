"""Native kernels: a driver and the layouts of its arguments become machine code, kept on disk for
the next process.

A kernel is used again while everything that its formulas read from outside is what it was; else it
is made anew, and the former one kept for the time when things are as before.  Without llvmlite, or
with LIEMECH_COMPILE=0 or NUMBA_DISABLE_JIT=1 in the environment, nothing here is used and every
driver runs in plain Python.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import struct
import sys
import threading
from array import array
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import NotCompilable
from ..formulas.blas import on_one_thread
from ..formulas.classes.flattening import gatherer
from ..formulas.classes.frozen import frozen
from ..formulas.classes.layouts import Layout, layout_of
from . import driver
from .kept import KERNELS, Variants
from .machine import guard_words, interrupts
from .machine.gc_pause import gc_paused
from .sites.planes import Planes

Kind = Layout | str | tuple[str, Layout]
"""The kind of an argument: the layout of a value, ("several", layout) if every body has its own, "integer",
"columns", "shared", "rows" or "planes".
"""


@frozen(eq=False)
class Columns:
    """An array of numbers, (..., bodies), with a column for each body; a bare array is one, too."""

    array: np.ndarray


@frozen(eq=False)
class Shared:
    """An array of numbers that all bodies share."""

    array: np.ndarray


@frozen(eq=False)
class Rows:
    """An array, real or complex, with a row for each body; rows may have gaps between them, or be all the same one."""

    array: np.ndarray

    @property
    def step(self) -> int:
        """The numbers from the beginning of one row to that of the next."""
        return self.array.strides[0] // 8


@frozen(eq=False)
class Several:
    """An argument of which every body has its own value.

    values : of one layout, one for each body.  columns : (width, bodies) their numbers.
    """

    values: tuple[Any, ...]
    columns: np.ndarray

    @classmethod
    def of(cls, values: Sequence[Any], columns: int) -> Several:
        """Values for a number of columns; the last value is repeated."""
        numbers = np.array([*map(gatherer(layout_of(values[0])), values)], dtype=float).T
        return cls(tuple(values), np.ascontiguousarray(numbers[:, np.minimum(np.arange(columns), len(values) - 1)]))


def examples(args: Sequence[Any]) -> list[Any]:
    """The arguments, of `Several` values the first."""
    return [a.values[0] if isinstance(a, Several) else a for a in args]


def available() -> str | None:
    """The reason why native code cannot be made here; None if it can.  Raises InvalidInput for a wrong $LIEMECH_CPU."""
    if os.environ.get("LIEMECH_COMPILE") == "0" or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return "compilation is switched off in the environment (LIEMECH_COMPILE=0 or NUMBA_DISABLE_JIT=1)"
    try:
        import llvmlite  # noqa: F401  # where it is missing, no half of a module is left for other threads

        from .machine import llvm

        llvm.processor()
    except ImportError:
        return "llvmlite is not installed"
    except RuntimeError as error:
        return f"LLVM does not know this processor: {error}"
    return None


class Kernel:
    """Machine code of one driver for arguments of one layout, for one body (lanes = 1) or several
    at once.

    call : runs it, on one block of memory (bytes): the number of bodies, the first of them and the
    one after the last, the integers, the addresses of the arrays, of 64 bits each, and the numbers
    of all values in turn.
    """

    def __init__(
        self,
        entry: Callable[..., Any],
        kinds: tuple[Kind, ...],
        lanes: int,
        args: Sequence[Any] | None = None,
        make: bool = True,
    ) -> None:
        from .changes import cache
        from .changes.dependencies import Reads
        from .machine import llvm

        self.entry, self.kinds, self.lanes = entry, kinds, lanes
        key = _key(entry, kinds, lanes)
        arguments = [
            a if isinstance(_layout(k), Layout) else None for a, k in zip(examples(args or kinds), kinds, strict=True)
        ]
        stored = (
            cache.load(key, lambda manifest: Reads.from_manifest(entry, arguments, manifest)) if key and args else None
        )
        self.cached = stored is not None
        if stored is not None:
            self.reads, code = stored
        elif not make:
            raise NotCompilable("there is no such kernel on disk")
        else:
            reads, text = _translated(entry, kinds, lanes, arguments if args else None)
            self.reads = reads.alone()
            code = llvm.object_code(text)
            if key and args and self.reads.follow(arguments):  # nothing has changed meanwhile
                cache.store(key, self.reads.manifest(), code)
        self._engine, self.call = llvm.linked(code)
        if b"liemech_dge" in code or b"liemech_zge" in code:
            self.call = on_one_thread(self.call)

    def __call__(self, *args: Any, bodies: int = 1, begin: int = 0, end: int = 1) -> None:
        """Run on these arguments, for the bodies from begin to end (whole lanes); arrays hold a
        column for each of `bodies`.
        """
        self.on(*args, bodies=bodies)(begin, end)

    def on(self, *args: Any, bodies: int = 1) -> Callable[[int, int], None]:
        """Lay the arguments out once, to run on any of the bodies."""
        numbers: list[float] = []
        integers: list[int] = []
        arrays: list[np.ndarray] = []
        for value, kind in zip(args, self.kinds, strict=True):
            if isinstance(kind, Layout):
                if kind.width:
                    numbers.extend(gatherer(kind)(value))
            elif isinstance(value, Several):
                arrays.append(value.columns)
            elif isinstance(value, Rows):
                arrays.append(value.array)
                integers.append(value.step)
            elif isinstance(value, Planes):
                arrays.append(value.array)
                integers.append(value.count)
            elif kind == "integer":
                integers.append(value)
            else:
                arrays.append(value if isinstance(value, np.ndarray) else value.array)
        laid_out = array("d", numbers).tobytes(), integers, arrays, bodies
        return functools.partial(self.run, *laid_out)

    def run(
        self,
        numbers: bytes,
        integers: Sequence[int],
        arrays: Sequence[Any],
        bodies: int = 1,
        begin: int = 0,
        end: int = 1,
    ) -> None:
        """Run on arguments that are laid out already: the numbers of all values in turn, the
        integers, the arrays.
        """
        self.on_memory(self.block(numbers, integers, arrays, bodies, begin, end), arrays)

    def block(
        self,
        numbers: bytes,
        integers: Sequence[int],
        arrays: Sequence[Any],
        bodies: int = 1,
        begin: int = 0,
        end: int = 1,
    ) -> bytes:
        """The block of memory of a call: bodies, begin and end, integers, addresses of the arrays, numbers."""
        words = bodies, begin, end, *integers, *map(address, arrays)
        return struct.pack(f"{len(words)}q", *words) + numbers

    def on_memory(self, block: bytes, buffers: Sequence[guard_words.Buffer]) -> None:
        """Run on one block, which holds the addresses of these buffers."""
        try:
            if guard_words.ON:
                guard_words.checked(self, block, buffers)
            else:
                self.call(block)
        finally:
            if _raised[3] or _stopped[0]:
                interrupts.stop_if_asked()

    def assembly(self) -> str:
        """The machine code as text, for those who want to see what became of a formula."""
        from .machine import llvm

        return llvm.assembly(_translated(self.entry, self.kinds, self.lanes)[1])


_raised, _stopped = interrupts.pending
_addressof, _byte_in = ctypes.addressof, ctypes.c_char.from_buffer


def address(values: Any) -> int:
    """The address of the first number of an array."""
    try:
        return _addressof(_byte_in(values))  # a quarter of the time of the other way
    except (TypeError, ValueError, BufferError):  # not to be written to, empty, or with gaps
        return values.ctypes.data


_importing = threading.RLock()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_importing.acquire, after_in_parent=_importing.release, after_in_child=_importing.release
    )


@functools.cache
def _imported() -> None:
    """Import the modules that kernels need under a lock: a child forked while another thread imports them would wait for
    ever.
    """
    with _importing:
        from .machine import llvm  # noqa: F401


def kernel(entry: Callable[..., Any], *args: Any, lanes: int = 1) -> Kernel:
    """The kernel for a driver and arguments like these.

    An int among the arguments is a run-time integer, arrays and rows are read and written in place;
    a layout describes everything else.  Raises NotCompilable.
    """
    return _get(entry, args, lanes, make=True)


def _get(entry: Callable[..., Any], args: tuple[Any, ...], lanes: int, make: bool) -> Kernel:
    """The kernel: kept, on disk or, with `make`, compiled.  Raises NotCompilable."""
    _imported()
    key = entry, tuple(map(kind_of, args)), lanes
    variants, given = KERNELS.setdefault(key, Variants()), examples(args)
    kernel: Kernel | None = variants.find(given)
    if kernel is None:
        with variants.lock:
            kernel = variants.find(given)  # made by another thread meanwhile
            if kernel is None:
                try:
                    kernel = Kernel(*key, args, make)
                # of LLVM: an unknown processor, a broken installation
                except RuntimeError as error:
                    raise NotCompilable(f"native code cannot be made here: {error}") from error
                variants.add(kernel)
    KERNELS.use(key)
    return kernel


def known(entry: Callable[..., Any], *args: Any, lanes: int = 1) -> Kernel | None:
    """The kernel for arguments like these, if this process has it already."""
    variants = KERNELS.get((entry, tuple(map(kind_of, args)), lanes))
    return variants.find(examples(args)) if variants else None


def alive() -> list[Kernel]:
    """All kernels that this process keeps."""
    return [k for variants in [*KERNELS.values()] for k in variants.kernels]


def forget() -> None:
    """Keep none of the kernels."""
    KERNELS.clear()


def stored(entry: Callable[..., Any], *args: Any, lanes: int = 1) -> Kernel | None:
    """The kernel for arguments like these, if this process has it or finds it on disk; nothing is
    compiled.
    """
    try:
        return _get(entry, args, lanes, make=False)
    except NotCompilable:
        return None


def kind_of(value: Any) -> Kind:
    """The kind of an argument of native code."""
    if isinstance(value, Rows):
        return "rows"
    if isinstance(value, Planes):
        return "planes"
    if isinstance(value, Several):
        return "several", layout_of(value.values[0])
    if isinstance(value, (np.ndarray, Columns)):
        return "columns"
    if isinstance(value, Shared):
        return "shared"
    return "integer" if type(value) is int else layout_of(value)


def _in_memory(layout: Layout) -> bool:
    """Whether a value of this layout, or the layout that is itself the value, has parts in memory."""
    described = layout.detail if layout.kind == "static" else None
    return layout.in_memory or (isinstance(described, Layout) and described.in_memory)


def _layout(kind: Kind) -> Any:
    """The layout of an argument that has one."""
    return kind[1] if isinstance(kind, tuple) else kind


def _directions(kinds: tuple[Kind, ...]) -> int:
    """The largest number of directions along which numbers of a driver carry derivatives."""
    layouts = [x for x in map(_layout, kinds) if isinstance(x, Layout)]
    carried = [x.detail for x in layouts if x.kind == "static" and isinstance(x.detail, Layout)]
    return max([x.directions for x in [*layouts, *carried]], default=0)


def _key(entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int) -> str | None:
    """The name of a kernel on disk: a digest of what it is made for, of the compiler, Python and the processor; None if
    the compiler was edited since its import.
    """
    import hashlib

    from .changes import cache, content_hashes
    from .machine import llvm

    compiler = cache.own_source()
    if compiler is None:
        return None
    python = sys.implementation.cache_tag, np.__version__, compiler, *llvm.machine()
    return hashlib.sha256(repr((content_hashes.digest((entry, *kinds)), lanes, python)).encode()).hexdigest()[:32]


def width() -> int:
    """The number of doubles that a vector register of this processor holds."""
    from .machine import llvm

    return llvm.width()


def lanes() -> int:
    """The number of bodies that run side by side: as many registers for each number as can work while one waits for a
    result.
    """
    return 2 * width()


def side_by_side(bodies: int | None) -> int:
    """The lanes for a number of bodies: one register for a few, such as the directions of a tangent map; 0 for a single
    body, None.
    """
    if bodies is None:
        return 0
    if available() is not None:
        return 1
    return width() if bodies <= width() else lanes()


# ------------------------------------------------------------------ translation


def translated(entry: Callable[..., Any], *args: Any) -> str:
    """A driver for one body and arguments like these, in LLVM's language.  Raises NotCompilable."""
    _imported()
    kinds = tuple(map(kind_of, args))
    return _translated(entry, kinds, 1)[1]


def _translated(
    entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int, arguments: Sequence[Any] | None = None
) -> tuple[Any, str]:
    """The reads of a translation, and the kernel in LLVM's language.

    In lanes each number gets a register, and two if the kernel is short.  One that is long is made
    in half the time, and is the faster one too, because the others would not find room beside each
    other.
    """
    with _importing:
        from .machine import llvm
        from .translation.instructions import LIMIT, SHORT, SIDE_BY_SIDE, WITH_SLOPES, TooLong

    with gc_paused():
        if "planes" in kinds:
            return _translation(entry, kinds, lanes, arguments, LIMIT)
        limit = LIMIT * (WITH_SLOPES if _directions(kinds) == 1 else 1)
        translation = _translation(entry, kinds, min(lanes, width()), arguments, limit)
        if lanes > width() and llvm.size(translation[1]) <= SHORT:
            with contextlib.suppress(TooLong):
                return _translation(entry, kinds, lanes, arguments, SIDE_BY_SIDE)
        return translation


def _translation(
    entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int, values: Sequence[Any] | None, limit: int
) -> tuple[Any, str]:
    """The reads, and in LLVM's language the driver in a loop over bodies, of `limit` instructions at most."""
    with _importing:
        from llvmlite import ir

        from ..formulas.classes.taken_back import journal
        from .buffers import NativeArray, arguments, entrance, hidden, unchanged
        from .changes.dependencies import Reads
        from .machine import llvm
        from .numbers.ir_numbers import F64, I64, Emitter
        from .numbers.large_arrays import LargeArrays
        from .numbers.rows_in_lanes import RowsInLanes
        from .sites.loops_over_sites import SiteLoops
        from .translation.instructions import Builder, Names, drop_unused
        from .translation.translator import Interpreter

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
        function.attributes.alignstack = 8 * width()
    builder = Builder(function.append_basic_block("entry"), limit)
    head, body, done = (function.append_basic_block(n) for n in ("head", "body", "done"))
    of_sites = "planes" in kinds  # one system, whose sites have the lanes
    emitter = Emitter(builder, 1 if of_sites else lanes, width())
    emitter.few = of_sites and 1 < lanes < width()
    in_memory = any(isinstance(k, Layout) and _in_memory(k) for k in map(_layout, kinds))
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
    builder.cbranch(builder.icmp_signed("<", index, end), body, done)
    builder.position_at_end(body)
    reads = Reads(entry)
    for i, (a, kind) in enumerate(zip(args, kinds, strict=True)):
        if isinstance(a, NativeArray):
            a.body = index
        if isinstance(kind, tuple):
            args[i] = a = a.read(0, kind[1])
        if isinstance(_layout(kind), Layout):
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
    sites = SiteLoops(interpreter, lanes, width())
    interpreter.intrinsics |= sites.intrinsics | RowsInLanes(interpreter, width()).intrinsics
    if of_sites:
        sites.scratch, sites.notes, sites.crew = hidden(emitter, kinds, args, function)
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
    builder.position_at_end(done)
    if in_memory:
        emitter.large.finish()
    builder.ret_void()
    size = drop_unused(module, function)
    entrance(module, function, kinds, sites.rows + sites.lasting, bool(sites.paired))
    return reads, f"; {size} instructions\n{module}"


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
