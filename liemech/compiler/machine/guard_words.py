"""LIEMECH_GUARD=1: every buffer that native code gets lies between guard words, which are looked at
after every call.

For tests: each call copies its buffers, there and back.
"""

from __future__ import annotations

import ctypes
import inspect
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import BufferOverrun

ON = os.environ.get("LIEMECH_GUARD", "0") not in ("", "0")

WORD = 0x7FF0DEADBEEF0001
"""A guard word; read as a float it is no number, so that what is read there shows, too."""

LEAST, MOST = 2**7, 2**14
"""Guard words on each side: as many as the buffer has, but no fewer and no more than these."""

Buffer = np.ndarray | tuple[int, int]
"""An array, or the address and the number of floats."""


def checked(kernel: Any, block: bytes, buffers: Sequence[Buffer]) -> None:
    """Call a kernel once, on this block of memory, which names these buffers, with fences around all of them.  Raises
    BufferOverrun.
    """
    before, names = _buffers_of(kernel)
    fences = [Fence(x) for x in buffers]
    words = np.frombuffer(block, np.int64).copy()
    words[before : before + len(fences)] = [fence.place for fence in fences]
    block_fence, original = Fence(words), words.copy()
    kernel.call(ctypes.c_char_p(block_fence.place))
    if not block_fence.copy_back() or not np.array_equal(words, original):
        raise BufferOverrun(_message(kernel, "arguments"))
    for name, fence in zip(names, fences, strict=True):
        if not fence.copy_back():
            raise BufferOverrun(_message(kernel, f"buffer `{name}`"))


def _message(kernel: Any, what: str) -> str:
    """The message of a BufferOverrun."""
    kinds = ", ".join(map(repr, kernel.kinds[:2]))
    return (
        f"native code of {kernel.entry.__name__}, for {kinds[:300]}, has written outside of its {what}: "
        "please report this with the program that did it"
    )


def _buffers_of(kernel: Any) -> tuple[int, list[str]]:
    """The number of words before the addresses in the block of a kernel, and the names of its buffers."""
    names = iter(inspect.signature(kernel.entry).parameters.values())
    before, buffers, name = 3, [], ""
    for kind in kernel.kinds:
        parameter = next(names, None)
        name = name if parameter is None else parameter.name  # of *rows the last one stays
        before += kind in ("integer", "rows", "planes")
        if isinstance(kind, tuple) or kind in ("columns", "shared", "rows", "planes"):
            buffers.append(name)
    return before, buffers + ["scratch memory", "notes", "crew"] * ("planes" in kernel.kinds)


class Fence:
    """A copy of a buffer between guard words.

    inside : the copy, with the strides of the buffer.  memory : all words around it.
    """

    def __init__(self, buffer: Buffer) -> None:
        if isinstance(buffer, tuple):
            place, count = buffer
            buffer = np.ctypeslib.as_array((ctypes.c_double * count).from_address(place))
        elif np.iscomplexobj(buffer):
            buffer = _parts(buffer)
        self.buffer = buffer
        low, high = self._bounds()
        margin = min(max(LEAST, (high - low) // 8), MOST)
        self.memory = np.full((high - low) // 8 + 2 * margin, WORD, np.int64)
        self.at = 8 * margin + buffer.ctypes.data - low
        self.inside = self._in(self.memory)
        self.inside[...] = _words(buffer)
        self.before = self.memory.copy()

    @property
    def place(self) -> int:
        """The address of the copy."""
        return self.memory.ctypes.data + self.at

    def _in(self, memory: np.ndarray) -> np.ndarray:
        """The words of the buffer's numbers in a memory laid out like `memory`."""
        shape, strides = self.buffer.shape, self.buffer.strides
        return np.ndarray(shape, np.int64, memory.data, self.at, strides)

    def _bounds(self) -> tuple[int, int]:
        """The first address of the buffer, and the one after its last."""
        low = high = self.buffer.ctypes.data
        if not self.buffer.size:
            return low, high
        for n, stride in zip(self.buffer.shape, self.buffer.strides, strict=True):
            low, high = low + min(0, (n - 1) * stride), high + max(0, (n - 1) * stride)
        return low, high + 8

    def copy_back(self) -> bool:
        """Copy back the words that have changed, as other threads write to others; False if a guard word has changed, or
        a word of a buffer that is not to be written to.
        """
        then = self._in(self.before)
        changed = self.inside != then
        if changed.any():
            if not self.buffer.flags.writeable:
                return False
            _words(self.buffer)[changed] = self.inside[changed]
            self.inside[...] = then
        return np.array_equal(self.memory, self.before)


def _words(numbers: np.ndarray) -> np.ndarray:
    """Floats as words of 64 bits, in place."""
    return numbers.view(np.int64)


def _parts(numbers: np.ndarray) -> np.ndarray:
    """The real and imaginary parts of complex numbers, in place."""
    shape, strides = (*numbers.shape, 2), (*numbers.strides, 8)
    return np.lib.stride_tricks.as_strided(numbers.real, shape, strides)
