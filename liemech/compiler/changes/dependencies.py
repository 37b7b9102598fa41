"""Dependencies: the names, attributes and code that a translation reads from outside.  All of it is
written down, and compared before the native code is used again.

A read has a path: from an argument of the driver, or the driver itself, over attributes, classes,
globals and closures to a value.  In this process the values are compared with the present ones by
identity, which takes microseconds.  In another process the paths are followed anew and the tokens
of what is found there are compared.
"""

from __future__ import annotations

import abc
import dataclasses
import decimal
import enum
import functools
import inspect
import types
import typing
from collections.abc import Callable, Sequence
from typing import Any

from ...errors import NotCompilable
from ...formulas.classes.records import Record
from ...formulas.classes.signatures import bare
from ...formulas.numbers.bases import StandIn
from ..translation.source import Source
from . import content_hashes
from .content_hashes import ATOMS, Known, digest, inner, is_own, of_python, parts
from .staleness import MISSING, RELATIONS, Guard, Step, member_of, value_read


class Reads:
    """The reads of one translation.

    Objects are known by their identity: `_origins` has the holder of each, and how it is reached from there,
    `_numbers_of_values` the number of the read that led to it.
    """

    def __init__(self, entry: Callable[..., Any]) -> None:
        self.entry = entry
        self.steps: list[Step] = []
        self.values: list[Any] = []
        self.tokens: list[str] = []  # empty for a part of something that has one
        self._numbers: dict[Step, int] = {}
        self._numbers_of_values: dict[int, int] = {}
        self._origins: dict[int, tuple[Any, str, Any]] = {}
        self._arguments: dict[int, Any] = {}  # for the compiler's copy of an argument, the argument
        self._unexchanged: dict[int, Any] = {}  # for a record with parts exchanged, the record that was read
        self._of_several_paths: set[int] = set()
        self._references: list[Any] = [entry]  # no other object gets the identity of one of these
        self.known: Known = {}
        self._spaces: dict[int, Any] = {}  # a function for each module
        self._guard: Guard | None = None
        self._origins[id(entry)] = None, "entry", 0

    def argument(self, index: int, copy: Any, value: Any) -> None:
        """Note the copy of an argument with which the compiler computes: its numbers are those of native code."""
        self._note_origin(copy, value, None, "argument", index)

    def exchanged(self, new: Any, before: Any) -> None:
        """Note that a record is `before` with parts exchanged: its attributes beside the fields, and constants that
        Python computes of these, are read from `before`.
        """
        if new is not before:
            self._unexchanged[id(new)] = before
            self._references.append(new)

    # -------------------------------------------------------------- questions of the translation

    def source(self, function: types.FunctionType) -> Source:
        """The source of a function, without the checks that a method makes of its arguments."""
        formula = self._read(function, "attribute", "__formula__") if bare(function) is not function else function
        for name in ("__code__", "__defaults__", "__kwdefaults__"):
            if getattr(formula, name) is not None:
                self._read(formula, "attribute", name)
        return Source(formula, self)

    def outer(self, function: types.FunctionType, name: str) -> Any:
        """The value of a name that is not local to the function."""
        if name in function.__code__.co_freevars:
            return self._read(function, "cell", name)
        return self._read(self._spaces.setdefault(id(function.__globals__), function), "global", name)

    def class_of(self, value: Any) -> type:
        """The class of an object; a read, since `__class__` may be set."""
        if (
            id(value) in self._origins
            and of_python(type(value))
            and not isinstance(value, (Record, type, types.ModuleType, types.FunctionType))
        ):
            self._read(value, "class", "")
        return type(value)

    def fields(self, cls: type) -> Any:
        """The fields of a record class."""
        self._read(cls, "attribute", "__dataclass_fields__")
        return dataclasses.fields(cls)

    def construction(self, cls: type) -> str:
        """The name of a user's method that runs when a record of this class is made; '' if there is none."""
        for name in ("__new__", "__init__", "__post_init__"):
            home = next(c for c in cls.__mro__ if name in vars(c))
            member = self._read(cls, "attribute", name)
            code = getattr(member, "__code__", None)
            by_user = of_python(home) and not home.__module__.startswith(_LIBRARY)
            if by_user and code is not None and code.co_filename != "<string>":  # of `dataclass`
                return name
        return ""

    def sets_fields(self, cls: type) -> bool:
        """Whether the library's own checks of a record set fields that were left out."""
        checks = [vars(c).get("__post_init__") for c in cls.__mro__]
        return any("__setattr__" in inspect.unwrap(c).__code__.co_names for c in checks if c)

    def has(self, value: Any, name: str) -> bool:
        """Whether a value has an attribute: hasattr(value, name)."""
        if id(value) in self._arguments or (isinstance(value, Record) and id(value) not in self._origins):
            return name in vars(value) or self._read(type(value), "has", name)
        outside = of_python(type(value)) or isinstance(value, (type, types.ModuleType, types.FunctionType))
        if not outside and (id(value) not in self._origins or content_hashes.known(value, False)):
            return hasattr(value, name)  # what is there does not change, or the token tells
        return self._read(value, "has", name)

    def of_class(self, value: Any, name: str) -> bool:
        """Whether the class of an object has a member of this name."""
        cls = type(value)
        if of_python(cls) and id(cls) in self._origins:
            return bool(self._read(cls, "defines", name))
        return member_of(cls, 0, name) is not MISSING

    def identical(self, left: Any, right: Any) -> bool:
        """`left is right`; a read, for records and containers."""
        pair, kinds = (left, right), (type(left), type(right))
        if any(x is None or isinstance(x, _OF_ONE_NAME) for x in pair) or kinds[0] is not kinds[1]:
            return left is right
        paths = [id(x) in self._origins for x in pair]
        if left is right and id(left) not in self._of_several_paths:
            return True
        if not content_hashes.has_content(left) and all(paths):
            return left is right  # its token says which object it is
        if not all(paths) or left is right or kinds[0] in ATOMS:
            raise NotCompilable(
                f"`is` between two of {kinds[0].__name__}: native code has values, not objects; "
                "compare a field, a name or an index"
            )
        return self._related(left, "is", right)

    def instance(self, value: Any, kinds: Any) -> bool:
        """`isinstance(value, kinds)`; a read, for classes that decide it themselves (abstract ones, protocols)."""
        self.class_of(value)
        is_instance = False
        for kind in kinds if isinstance(kinds, tuple) else typing.get_args(kinds) or (kinds,):
            decides = isinstance(kind, type) and type(kind) is not type
            if decides and self.from_outside(value) and self.from_outside(kind):
                is_instance = is_instance or self._related(value, "isinstance", kind)
            elif decides and any(
                "__instancecheck__" in vars(c)
                for c in type(kind).__mro__
                if of_python(c) and c.__module__ not in _OF_PYTHON
            ):
                raise NotCompilable(
                    f"`isinstance` of {kind.__qualname__}, whose class decides it itself, of what is "
                    "no object from outside: ask before the run"
                )
            else:
                is_instance = is_instance or isinstance(value, kind)
        return is_instance

    def _related(self, left: Any, how: str, right: Any) -> bool:
        """A relation of two objects from outside, as a read."""
        step = self._number(left), how, self._number(right)
        if step not in self._numbers:
            value = RELATIONS[how](self.values[step[0]], self.values[step[2]])
            self._note(step, value, digest(value, self.known))
        return bool(self.values[self._numbers[step]])

    def settled(self, *values: Any, inside: bool = False) -> None:
        """Raise NotCompilable before Python computes with an object (`inside`: or a container of such) whose code or
        content has not been read.
        """
        for value in values:
            if isinstance(value, StandIn) or type(value) in ATOMS:
                continue
            if isinstance(value, decimal.Decimal):
                self._read(self.entry, "decimals", "")
            foreign = (
                id(value) in self._origins or of_python(type(value)) or isinstance(value, (type, types.FunctionType))
            )
            if foreign and not content_hashes.known(value, inside):
                name = getattr(value, "__qualname__", None) or f"an object of {type(value).__qualname__}"
                raise NotCompilable(
                    f"Python would have to compute with {name} before the "
                    "run: formulas use attributes and calls; make it a tuple, a dict or a float"
                )
            self._unwritten(value, inside)

    def _unwritten(self, value: Any, inside: bool) -> None:
        """Note that the class of a value (`inside`: and of its parts) defines no operators, as it may later."""
        cls = type(value)
        if of_python(cls) and id(cls) in self._origins:
            self._read(cls, "plain", "")
        if inside and cls not in ATOMS:
            for *_, part in inner(value):
                self._unwritten(part, inside)

    def attribute(self, value: Any, name: str, call: Callable[..., Any]) -> Any:
        """`value.name`; properties are formulas, which `call` translates."""
        owner, cls, after = value, type(value), 0
        if isinstance(value, super):
            owner, cls = value.__self__, value.__self_class__  # type: ignore[attr-defined]
            after = cls.__mro__.index(value.__thisclass__) + 1  # type: ignore[attr-defined]
        elif isinstance(value, type):
            cls = value
        if isinstance(owner, type) and is_own(owner):
            return getattr(value, name)
        if isinstance(owner, type):
            member = member_of(cls, after, name)
            if member is MISSING or type(cls) not in _PLAIN_CLASSES:
                return self._read(owner, "attribute", name)
            return self._bound(self._read(cls, f"member {after}", name), None, cls, name, call)
        if isinstance(owner, (types.ModuleType, types.FunctionType)):
            return self._read(owner, "attribute", name)
        if not isinstance(owner, Record) and not of_python(cls):
            if id(owner) not in self._origins or is_own(owner) or content_hashes.known(owner, False):
                return getattr(value, name)
            return self._read(owner, "attribute", name)
        if name == "__class__":
            return self.class_of(owner) if after == 0 else cls
        member = member_of(cls, after, name)
        attributes = getattr(owner, "__dict__", {}) if after == 0 else {}
        if name in attributes and not hasattr(type(member), "__set__"):
            copied = id(owner) in self._arguments or id(owner) not in self._origins
            return attributes[name] if copied else self._read(owner, "attribute", name)
        if member is MISSING and id(owner) in self._unexchanged:
            return self.attribute(self._unexchanged[id(owner)], name, call)
        if member is MISSING or "__getattribute__" in {n for c in cls.__mro__[:-1] for n in vars(c)}:
            return self._read(owner, "attribute", name)
        if after == 0 and hasattr(owner, "__dict__") and not isinstance(owner, Record):
            # an attribute of its own would hide that of the class
            self._read(owner, "class", "")
            self._read(owner, "own", name)
        return self._bound(self._read(cls, f"member {after}", name), owner, cls, name, call)

    def _bound(self, member: Any, owner: Any, cls: type, name: str, call: Callable[..., Any]) -> Any:
        """The attribute that a member of a class becomes, through an instance or, if there is none,
        through the class.
        """
        if isinstance(member, types.FunctionType):
            return member if owner is None else types.MethodType(member, owner)
        if isinstance(member, staticmethod):
            return member.__func__
        if isinstance(member, classmethod):
            return types.MethodType(member.__func__, cls)
        if owner is None or not hasattr(type(member), "__get__"):
            return member
        if isinstance(member, property) and member.fget is not None:
            computed = call(member.fget, owner)
            # a constant of the owner
            if isinstance(computed, Record) and id(owner) in self._origins and not varies(computed):
                self._note_origin(computed, computed, owner, "property", name)
            return computed
        if isinstance(member, functools.cached_property):
            return self._cached(member, owner, name, call)
        return self._read(owner, "attribute", name)

    def _cached(self, member: Any, owner: Any, name: str, call: Callable[..., Any]) -> Any:
        """The value of a cached property: computed by Python, or by a formula if it depends on numbers of the run."""
        if id(owner) in self._unexchanged:
            try:
                value = self.attribute(self._unexchanged[id(owner)], name, call)
            except NotCompilable:
                return call(member.func, owner)
            return call(member.func, owner) if varies(value) else value
        if id(owner) not in self._origins:
            return call(member.func, owner)
        if self._is_made(owner):
            self._note_names(member.func, type(owner), set())
        if varies(owner):
            try:
                value = getattr(owner, name)
            except NotCompilable:  # Python cannot compute it of numbers of the run
                return call(member.func, owner)
            vars(owner).pop(name, None)
            if varies(value):
                return call(member.func, owner)
        return self._read(owner, "attribute", name)

    def from_outside(self, value: Any) -> bool:
        """Whether a value was there before the formulas, so that its reads are written down."""
        return id(value) in self._origins

    def made(self, value: Any) -> bool:
        """Whether a value was created during the translation, so that it needs no check of its own."""
        return id(value) not in self._origins or self._is_made(value)

    def _is_made(self, value: Any) -> bool:
        """Whether a property makes the value, or its holder, anew at every read."""
        holder, how, _ = self._origins.get(id(value), (None, "", ""))
        return how == "property" or (holder is not None and self._is_made(holder))

    def _note_names(self, function: Any, cls: type, visited: set[int]) -> None:
        """Note the code, the globals and the members that a function which Python runs names, and the functions among
        them in turn.
        """
        if not isinstance(function, types.FunctionType) or id(function) in visited or is_own(function):
            return
        visited.add(id(function))
        formula = self._read(function, "attribute", "__formula__") if bare(function) is not function else function
        self._read(formula, "attribute", "__code__")
        for name in content_hashes.names(formula.__code__):
            if name in formula.__globals__:
                self._note_names(self.outer(formula, name), cls, visited)
            member = member_of(cls, 0, name)
            if member is not MISSING:
                member = self._read(cls, "member 0", name)
                self._note_names(getattr(member, "fget", None) or getattr(member, "func", member), cls, visited)

    # -------------------------------------------------------------- the record

    def _read(self, holder: Any, how: str, name: Any) -> Any:
        """The value of a read, which is noted."""
        step = self._number(holder), how, name
        if step[0] is _OWN:
            return value_read(holder, how, name)
        if step not in self._numbers:
            value = value_read(self.values[step[0]], how, name)
            self._note(step, value, digest(value, self.known))
            self._note_origin(value, value, holder, how, name)
        return self.values[self._numbers[step]]

    def _note(self, step: Step, value: Any, token: str) -> int:
        """Add a read; its number."""
        number = self._numbers[step] = len(self.steps)
        self.steps.append(step)
        self.values.append(value)
        self.tokens.append(token)
        return number

    def _number(self, value: Any) -> Any:
        """The number of the read that led to a value."""
        if id(value) in self._numbers_of_values:
            return self._numbers_of_values[id(value)]
        origin = self._origins.get(id(value))
        if origin is None:
            if is_own(value):
                return _OWN
            raise NotCompilable(
                f"where `{value!r:.60}` comes from cannot be told, so that a change of it would not be seen"
            )
        holder, how, name = origin
        step = (-1 if holder is None else self._number(holder)), how, name
        if step not in self._numbers:
            self._note(step, self._arguments.get(id(value), value), "")
        self._numbers_of_values[id(value)] = self._numbers[step]
        return self._numbers[step]

    def _note_origin(self, copy: Any, value: Any, holder: Any, how: str, name: Any) -> None:
        """Note where a value and its parts come from.  copy : of an argument, in its place; else the value."""
        if type(copy) in ATOMS or isinstance(copy, StandIn):
            return
        self._references.append(copy)
        if copy is not value:
            self._references.append(value)
            self._arguments[id(copy)] = value
        if id(copy) in self._origins:
            before = self._origins[id(copy)]
            if before[0] is not holder or before[1:] != (how, name):
                self._of_several_paths.add(id(copy))
            return
        self._origins[id(copy)] = holder, how, name
        if copy is value:
            for relation, key, part in inner(value):
                self._note_origin(part, part, value, relation, key)
        else:
            for (relation, key, part), (_, _, actual) in zip(parts(copy), parts(value), strict=True):
                self._note_origin(part, actual, copy, relation, key)
        cls = type(copy)
        if of_python(cls) and id(cls) not in self._origins:
            self._note_origin(cls, cls, copy, "class", "")

    def copied(self, copy: Any, value: Any) -> None:
        """Note a copy with the numbers of a native function: its origin is that of the value."""
        if id(value) in self._origins and id(copy) not in self._origins:
            self._references.append(copy)
            self._origins[id(copy)] = self._origins[id(value)]
            self._arguments[id(copy)] = self._arguments.get(id(value), value)
        self.made_again(copy, value)

    def made_again(self, copy: Any, value: Any) -> None:
        """Note a record made like another, in which parts may have been exchanged."""
        if id(value) in self._unexchanged and id(copy) not in self._unexchanged:
            self.exchanged(copy, self._unexchanged[id(value)])

    # -------------------------------------------------------------- comparison

    def alone(self) -> Reads:
        """These reads without what the translation knew of objects, which keeps it, and its arguments, alive."""
        reads = Reads(self.entry)
        reads.steps, reads.values, reads.tokens, reads.known = self.steps, self.values, self.tokens, self.known
        return reads

    def manifest(self) -> list[Any]:
        """The paths and the tokens, as another process can read them."""
        return [[*step, token] for step, token in zip(self.steps, self.tokens, strict=True)]

    @classmethod
    def from_manifest(cls, entry: Callable[..., Any], args: Sequence[Any], manifest: list[Any]) -> Reads | None:
        """The reads of a manifest, followed from these arguments; None if a token has changed."""
        reads = cls(entry)
        for parent, how, name, token in manifest:
            reads._note((parent, how, name), None, token)
        return reads if reads.follow(args) else None

    def follow(self, args: Sequence[Any]) -> bool:
        """Follow all paths from these arguments; True if the tokens of the values there are those written down."""
        followed = self._values_from(args)
        if followed is None:
            return False
        (self.values, self.known), self._guard = followed, None
        return True

    def _values_from(self, args: Sequence[Any]) -> tuple[list[Any], Known] | None:
        """The values of all reads from these arguments, and their namesakes; None if one has another token."""
        values: list[Any] = []
        namesakes: Known = {}
        try:
            for (parent, how, name), token in zip(self.steps, self.tokens, strict=True):
                values.append(
                    RELATIONS[how](values[parent], values[name])
                    if how in RELATIONS
                    else value_read(values[parent] if parent >= 0 else (self.entry, args), how, name)
                )
                if token and digest(values[-1], namesakes) != token:
                    return None
        except Exception:  # whatever a path meets that is no longer there
            return None
        return values, namesakes

    @property
    def guard(self) -> Guard:
        """The guard of this translation, which compares its reads with the objects of today."""
        if self._guard is None:
            self._guard = Guard(self.steps, self.values, self.tokens, self.known)
        return self._guard

    def guard_of(self, args: Sequence[Any]) -> Guard | None:
        """A guard for other arguments, from which the paths lead to the same tokens; None if they do not."""
        followed = self._values_from(args)
        return None if followed is None else Guard(self.steps, followed[0], self.tokens, followed[1])

    def unchanged(self, args: Sequence[Any]) -> bool:
        """Whether all reads give the values that they gave: in microseconds by identity, else by tokens."""
        verdict = self.guard.verdict(args)
        return self.follow(args) if verdict is None else verdict


_OWN: Any = object()
_LIBRARY = f"{__name__.partition('.')[0]}."
_PLAIN_CLASSES = {type, abc.ABCMeta}
_OF_PYTHON = {"abc", "typing"}
_OF_ONE_NAME = (bool, type, enum.Enum, types.ModuleType, types.FunctionType, types.BuiltinFunctionType)
"""Types that `is` may compare: their tokens say which object it is."""


def varies(value: Any) -> bool:
    """Whether a value holds a number of the run, in a field of a record too."""
    return isinstance(value, StandIn) or any(varies(x) for *_, x in inner(value))
