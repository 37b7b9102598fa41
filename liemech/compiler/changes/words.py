"""Words of memory in which CPython shows that a function has other code now, a class other members, or a
module other names: native code looks at hundreds of them in the time in which Python compares one.

A function keeps the addresses of its code and its defaults.  A class keeps the number of its version:
whatever is set in it or in one of its bases, it gets another, which no class ever had; so does a dict, up to
Python 3.13.  Where these words lie is found by trying; what an interpreter does not show, Python compares.
"""

from __future__ import annotations

import abc
import ctypes
import functools
import struct
import sys
import sysconfig
import types
from collections.abc import Callable, Iterable
from typing import Any

SLOTS = "__code__", "__defaults__", "__kwdefaults__"
CLASSES = type, abc.ABCMeta
"""Classes of classes that leave the search for members to Python."""

ADDRESS, VERSION = struct.Struct("Q"), struct.Struct("I")
WHOLE = 2**64 - 1


Word = tuple[Any, int, int, int]
"""The object that has it, its address, the bits that count, and what they are."""


class Words:
    """Words of memory with the values that they had when this object was made."""

    def __init__(self, words: Iterable[Word]) -> None:
        by_address = {word[1]: word for word in words}.values()
        self.alive = [word[0] for word in by_address]  # nothing else gets their addresses
        numbers = [x for _, *fields in by_address for x in fields]
        self.block = struct.pack(f"{1 + len(numbers)}Q", len(self.alive), *numbers)
        self.differs = _comparison() if self.alive else None

    def same(self) -> bool:
        """Whether every word still has its value."""
        return self.differs is None or not self.differs(self.block)


def words_of(holder: Any, how: str, name: Any, value: Any) -> list[Word]:
    """Words of which one changes when a read of a holder gives another value; none where such words are not known."""
    places, function = _places(), type(holder) is types.FunctionType
    if function and how == "attribute" and name in places:
        return [(holder, id(holder) + places[name], WHOLE, id(value))]
    if function and how == "global" and "names" in places:
        spaces = [holder.__globals__, holder.__builtins__]
        searched = spaces[:1] if name in spaces[0] else spaces
        return [_version(space, places["names"], ADDRESS) for space in searched]
    if type(holder) not in CLASSES or "members" not in places:
        return []
    of_members = how.startswith("member") or how in ("defines", "plain")
    if not of_members and (how != "attribute" or hasattr(type(vars(type).get(name)), "__set__")):
        return []
    holder.__sizeof__  # noqa: B018 - it has no version until something is looked up
    word = _version(holder, places["members"], VERSION)
    return [word] if word[3] else []


def _version(holder: Any, at: int, size: struct.Struct) -> Word:
    """The word with the version of a class, or of a dict."""
    (version,) = size.unpack(ctypes.string_at(id(holder) + at, size.size))
    return holder, id(holder) + at, WHOLE >> (64 - 8 * size.size), version


@functools.cache
def _places() -> dict[str, int]:
    """The offsets in bytes of the parts of a function, and of the versions of a class and of a dict, by name; only those
    that were found.
    """
    supported = sys.implementation.name == "cpython" and sys.byteorder == "little"
    if not supported or sysconfig.get_config_var("Py_GIL_DISABLED") or ADDRESS.size != 8:
        return {}
    function, other = _example(), _example()
    offsets = {}
    for name, after in [(name, getattr(other, name)) for name in SLOTS]:
        matches: list[set[int]] = []
        for value in (getattr(function, name), after):
            setattr(function, name, value)
            words = enumerate(_words(function, function.__sizeof__(), ADDRESS))
            matches.append({i for i, word in words if word == id(value)})
        if len(matches[0]) == 1 and matches[0] == matches[1]:
            offsets[name] = ADDRESS.size * matches[0].pop()
    base: Any = type("Base", (), {"member": 0})
    derived: Any = type("Derived", (base,), {})
    names: dict[str, Any] = {"member": 0}
    of_class, of_dict = [], []
    for k in range(8):
        base.member = names["member"] = object()
        if k < 7:  # without a look the version is none, not the one before
            derived.member  # noqa: B018
        of_class.append(_words(derived, type(derived).__basicsize__, VERSION))
        of_dict.append(_words(names, dict.__basicsize__, ADDRESS))
    for what, snapshots, size in (("members", of_class, VERSION), ("names", of_dict, ADDRESS)):
        moving = [i for i, words in enumerate(zip(*snapshots)) if len({*words}) == len(snapshots)]
        if len(moving) == 1 and (what == "names" or snapshots[-1][moving[0]] == 0):
            offsets[what] = size.size * moving[0]
    return offsets


def _words(holder: Any, size: int, word: struct.Struct) -> list[int]:
    """The words of the first `size` bytes of an object."""
    content = ctypes.string_at(id(holder), size // word.size * word.size)
    return [number for (number,) in word.iter_unpack(content)]


def _example() -> Any:
    """A function with code and defaults that no other function has."""

    def example(x: Any, *, y: Any) -> Any:
        return x, y

    example.__code__ = example.__code__.replace(co_name="another")
    example.__defaults__, example.__kwdefaults__ = (object(),), {"y": object()}
    return example


@functools.cache
def _comparison() -> Callable[[bytes], int]:
    """Native code that compares words and returns 0 if all are equal.  Its argument: their number, and of each word the
    address, the mask and the value.
    """
    from llvmlite import ir

    from ..machine import llvm

    word = ir.IntType(64)
    module = ir.Module("words", ir.Context())
    module.triple = llvm.triple()
    function = ir.Function(module, ir.FunctionType(word, [word.as_pointer()]), "kernel")
    block, b = function.args[0], ir.IRBuilder(function.append_basic_block("entry"))
    loop, turn, end = map(function.append_basic_block, ("loop", "turn", "end"))

    def number(at: Any) -> Any:
        return b.load(b.gep(block, [at], source_etype=word), typ=word)

    count = number(word(0))
    last = b.mul(count, word(3))
    b.branch(loop)
    b.position_at_end(loop)
    at = b.phi(word)
    at.add_incoming(word(0), function.entry_basic_block)
    b.cbranch(b.icmp_unsigned("<", at, last), turn, end)
    b.position_at_end(turn)
    address, mask, content = [number(b.add(at, word(k))) for k in (1, 2, 3)]
    word_now = b.and_(b.load(b.inttoptr(address, word.as_pointer()), typ=word), mask)
    at.add_incoming(b.add(at, word(3)), turn)
    b.cbranch(b.icmp_unsigned("==", word_now, content), loop, end)
    b.position_at_end(end)
    left = b.phi(word)
    left.add_incoming(word(0), loop)
    left.add_incoming(word(1), turn)
    b.ret(left)
    owner, compare = llvm.linked(llvm.object_code(f"; 20 instructions\n{module}"), _SIGNATURE)
    compare.owner = owner
    return compare


_SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_char_p)
