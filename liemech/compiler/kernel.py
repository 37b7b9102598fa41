"""Native kernels: a driver and the layouts of its arguments become machine code, kept on disk for the next process.

The only place that knows LLVM's binding.  Without llvmlite, or with LIEMECH_COMPILE=0 or NUMBA_DISABLE_JIT=1 in the environment,
nothing here is used and every driver runs in plain Python.
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import os
import threading
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import NotCompilable
from ..formulas.functions import LIBM
from ..formulas.pytree import Layout, layout_of, leaves
from . import callbacks, driver

Kind = Layout | str  # of an argument: the layout of a value, "integer", "array" or "rows"

_lock = threading.RLock()
_kernels: dict[Any, Kernel] = {}


@dataclasses.dataclass(frozen=True, eq=False)
class Rows:
    """An array, real or complex, of which each body has a row: they need not be next to each other, and may be all the same."""

    array: np.ndarray

    @property
    def step(self) -> int:
        """How many numbers lie from one row to the next."""
        return self.array.strides[0] // 8


def available() -> str | None:
    """None if native code can be made here, else the reason why not."""
    if os.environ.get("LIEMECH_COMPILE") == "0" or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return "compilation is switched off in the environment (LIEMECH_COMPILE=0 or NUMBA_DISABLE_JIT=1)"
    try:
        import llvmlite.binding  # noqa: F401
    except ImportError:
        return "llvmlite is not installed"
    return None


class Kernel:
    """Machine code of one driver for arguments of one layout, for one body (lanes = 1) or several at once."""

    def __init__(self, entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int) -> None:
        from . import cache
        from .source import fingerprint

        self.entry, self.kinds, self.lanes = entry, kinds, lanes
        key = fingerprint(entry, *kinds, lanes, *_machine())
        object_code = cache.load(key)
        self.cached = object_code is not None
        if object_code is None:
            object_code = _compile(entry, kinds, lanes)
            cache.store(key, object_code)
        self._engine, address = _link(object_code)
        pointer = ctypes.c_void_p
        self._call = ctypes.CFUNCTYPE(None, pointer, pointer, pointer, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(address)

    def __call__(self, *args: Any, bodies: int = 1, begin: int = 0, end: int = 1) -> None:
        """Run on these arguments, for the bodies from begin to end (whole lanes); arrays hold a column for each of `bodies`."""
        numbers: list[float] = []
        integers: list[int] = []
        arrays: list[np.ndarray] = []
        for value, kind in zip(args, self.kinds, strict=True):
            if isinstance(kind, Layout):
                numbers += leaves(value, kind)
            elif isinstance(value, Rows):
                arrays.append(value.array)
                integers.append(value.step)
            else:
                (integers if kind == "integer" else arrays).append(value)
        packed = array("d", numbers), array("q", integers), array("q", [a.ctypes.data for a in arrays])
        self._call(*(a.buffer_info()[0] for a in packed), bodies, begin, end)

    def assembly(self) -> str:
        """The machine code as text, for those who want to see what became of a formula."""
        return _target().emit_assembly(_optimised(self.entry, self.kinds, self.lanes))


def kernel(entry: Callable[..., Any], *args: Any, lanes: int = 1) -> Kernel:
    """The kernel for a driver and arguments like these.

    An int among the arguments is a run-time integer, arrays and rows are read and written in place; a layout describes everything
    else.  Raises NotCompilable.
    """
    kinds = tuple(map(_kind, args))
    key = entry, kinds, lanes
    with _lock:
        if key not in _kernels:
            try:
                _kernels[key] = Kernel(entry, kinds, lanes)
            except RuntimeError as error:  # of LLVM: an unknown processor, a broken installation
                raise NotCompilable(f"native code cannot be made here: {error}") from error
        return _kernels[key]


def known(entry: Callable[..., Any], *args: Any, lanes: int = 1) -> Kernel | None:
    """Such a kernel, if this process has it already."""
    return _kernels.get((entry, tuple(map(_kind, args)), lanes))


def _kind(value: Any) -> Kind:
    if isinstance(value, Rows):
        return "rows"
    return "array" if isinstance(value, np.ndarray) else "integer" if type(value) is int else layout_of(value)


# ------------------------------------------------------------------ translation


def _compile(entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int) -> bytes:
    return _target().emit_object(_optimised(entry, kinds, lanes))


def _optimised(entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int) -> Any:
    import llvmlite.binding as llvm

    module = llvm.parse_assembly(str(_translated(entry, kinds, lanes)))
    module.verify()
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = tuning.slp_vectorization = False  # lanes are explicit; formulas are scalar on purpose
    passes = llvm.create_pass_builder(_target(), tuning)
    passes.getModulePassManager().run(module, passes)
    return module


def _translated(entry: Callable[..., Any], kinds: tuple[Kind, ...], lanes: int) -> Any:
    """The kernel in LLVM's language: a loop over bodies around the driver, inlined."""
    import llvmlite.binding as llvm
    from llvmlite import ir

    from .buffers import Array, arguments
    from .ir_numbers import F64, I64, Emitter
    from .outlined import Builder
    from .translation import Interpreter

    module = ir.Module("liemech")
    module.triple = llvm.get_process_triple()
    signature = ir.FunctionType(ir.VoidType(), [F64.as_pointer(), I64.as_pointer(), F64.as_pointer().as_pointer(), I64, I64, I64])
    function = ir.Function(module, signature, "kernel")
    for pointer in function.args[:3]:
        pointer.add_attribute("noalias")
    function.attributes.add("nounwind")
    if lanes > 1:
        function.attributes.alignstack = 8 * width()  # else every register kept on the stack straddles two cache lines
    builder = Builder(function.append_basic_block("entry"))
    head, body, done = (function.append_basic_block(n) for n in ("head", "body", "done"))
    emitter = Emitter(builder, lanes, width())
    args = arguments(emitter, kinds, function)
    start = builder.block
    builder.branch(head)
    builder.position_at_end(head)
    index = builder.phi(I64)
    index.add_incoming(function.args[4], start)
    builder.cbranch(builder.icmp_signed("<", index, function.args[5]), body, done)
    builder.position_at_end(body)
    for a in args:
        if isinstance(a, Array):
            a.body = index
    interpreter = Interpreter(emitter)
    interpreter.intrinsics |= {
        driver.read: lambda array, at, layout: array.read(at, layout),
        driver.write: lambda array, at, value, layout=None: array.write(at, value),
        driver.attempt: interpreter.attempt,
        driver.accepted: interpreter.accepted,
        driver.any_body: emitter.any,
    }
    try:
        interpreter.call(entry, *args)
    except Exception as error:
        located = _located(error, interpreter)
        if located is error:
            raise
        raise located from (None if isinstance(error, NotCompilable) else error)
    index.add_incoming(builder.add(index, ir.Constant(I64, lanes)), builder.block)
    builder.branch(head)
    builder.position_at_end(done)
    builder.ret_void()
    return module


def _located(error: Exception, interpreter: Any) -> Exception:
    """The error with the class, method and line of the formula that could not be translated."""
    if not interpreter.frames:
        return error
    frame = interpreter.frames[-1]
    line = getattr(frame.node, "lineno", frame.source.function.__code__.co_firstlineno)
    reason = str(error) if isinstance(error, NotCompilable) else f"{type(error).__name__}: {error}"
    return NotCompilable(f"{frame.source.name} ({os.path.basename(frame.source.file)}, line {line}) cannot be compiled: {reason}")


# ------------------------------------------------------------------ LLVM


def _machine() -> tuple[str, ...]:
    """What else the object code depends on: this package, LLVM and the processor."""
    import llvmlite
    import llvmlite.binding as llvm

    from . import cache

    features = ",".join(f"{k}={v}" for k, v in sorted(llvm.get_host_cpu_features().items()))
    return cache.own_source(), llvmlite.__version__, llvm.get_process_triple(), llvm.get_host_cpu_name(), features


@functools.cache
def _target() -> Any:
    """The processor that code is made for."""
    return _target_machine()


def _target_machine() -> Any:
    import llvmlite.binding as llvm

    _prepare()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=3, jit=True
    )


@functools.cache
def _prepare() -> None:
    """Once in a process: LLVM for this processor, and the functions of the C library that plain Python uses too."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = _c_library()
    for f in (*LIBM, pow):  # under names that LLVM does not know, so that it changes nothing about them
        llvm.add_symbol(f"liemech_{f.__name__}", ctypes.cast(getattr(library, f.__name__), ctypes.c_void_p).value)
    for symbol, address in callbacks.addresses().items():
        llvm.add_symbol(symbol, address)


def _c_library() -> ctypes.CDLL:
    if os.name == "nt":
        return ctypes.CDLL("ucrtbase")
    process = ctypes.CDLL(None)
    if hasattr(process, "sin"):
        return process
    from ctypes.util import find_library

    return ctypes.CDLL(find_library("m"))


def _link(object_code: bytes) -> tuple[Any, int]:
    import llvmlite.binding as llvm

    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target_machine())  # which it owns and frees
    engine.add_object_file(llvm.ObjectFileRef.from_data(object_code))
    engine.finalize_object()
    return engine, engine.get_function_address("kernel")


@functools.cache
def width() -> int:
    """How many doubles a vector register of this processor holds."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    return 8 if features.get("avx512f") else 4 if features.get("avx2") else 2


def lanes() -> int:
    """How many bodies run side by side: as many registers for each number as can work while one waits for a result."""
    return 2 * width()
