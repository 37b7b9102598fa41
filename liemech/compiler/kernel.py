"""Native kernels: a driver and the layouts of its arguments become machine code, kept on disk for
the next process.

A kernel is used again while everything that its formulas read from outside is what it was; else it
is made anew, and the former one kept for the time when things are as before.  Without llvmlite, or
with LIEMECH_COMPILE=0 or NUMBA_DISABLE_JIT=1 in the environment, nothing here is used and every
driver runs in plain Python.
"""

from __future__ import annotations

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
from ..formulas.classes.frozen import frozen
from ..formulas.classes.layouts import Layout, gatherer, layout_of
from .driver import Kind, layout_of_kind
from .kept import KERNELS, Variants
from .machine import guard_words, interrupts
from .machine.gc_pause import gc_paused
from .sites.planes import Planes


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
            a if isinstance(layout_of_kind(k), Layout) else None
            for a, k in zip(examples(args or kinds), kinds, strict=True)
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

    def run(self, numbers: bytes, integers: Sequence[int], arrays: Sequence[Any], *bodies: int) -> None:
        """Run on arguments that are laid out already: the numbers of all values in turn, the integers, the arrays.

        bodies : their number, the first one and the one after the last; left out, one body alone.
        """
        self.on_memory(self.block(numbers, integers, arrays, *bodies), arrays)

    def block(self, numbers: bytes, integers: Sequence[int], arrays: Sequence[Any], *bodies: int) -> bytes:
        """The block of memory of a call: bodies, begin and end, integers, addresses of the arrays, numbers."""
        words = *(bodies or (1, 0, 1)), *integers, *map(address, arrays)
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
    variants, call_examples = KERNELS.setdefault(key, Variants()), examples(args)
    kernel: Kernel | None = variants.find(call_examples)
    if kernel is None:
        with variants.lock:
            kernel = variants.find(call_examples)  # made by another thread meanwhile
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
    """The kernel for arguments like these, if this process has it or finds it on disk; nothing is compiled."""
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
    """The reads of a translation, and the kernel in LLVM's language."""
    with _importing:
        from .translation import module

    with gc_paused():
        return module.translated(entry, kinds, lanes, arguments)
