"""What a translation reads from outside: names, attributes, code.  All of it is written down, and
compared before it counts again.

A read has a path: from an argument of the driver, or the driver itself, over attributes, classes,
globals and closures to a value.  In this process the values are compared with the present ones by
identity, which takes microseconds.  In another process the paths are followed anew and the tokens
of what is found there are compared.
"""

from __future__ import annotations

import abc
import collections
import dataclasses
import decimal
import enum
import functools
import inspect
import keyword
import operator
import types
import typing
from collections.abc import Callable, Sequence
from typing import Any

from ..errors import NotCompilable
from ..formulas.numbers import StandIn
from ..formulas.records import Record
from ..formulas.signatures import bare
from . import content_hashes
from .content_hashes import ATOMS, Known, digest, inner, is_mutable, is_own, of_python, parts, same
from .source import Source

Step = tuple[int, str, Any]
"""The number of the read that leads to the holder (-1: none), how it is asked, and for what."""

_MISSING = object()


class Reads:
    """The reads of one translation."""

    def __init__(self, entry: Callable[..., Any]) -> None:
        self.entry = entry
        self.steps: list[Step] = []
        self.values: list[Any] = []
        self.tokens: list[str] = []  # empty for a part of something that has one
        self._numbers: dict[Step, int] = {}
        self._led: dict[int, int] = {}  # by the identity of a value, the read that led to it
        # by the identity of a value: its holder, and how it is reached
        self._origins: dict[int, tuple[Any, str, Any]] = {}
        # by the identity of the compiler's copy of an argument: the argument
        self._given: dict[int, Any] = {}
        # by the identity of a record with parts exchanged: the record as it was read
        self._before: dict[int, Any] = {}
        self._twice: set[int] = set()  # what several paths lead to, by identity
        self._alive: list[Any] = [entry]
        self.known: Known = {}
        self._spaces: dict[int, Any] = {}  # a function for each module
        self._guard: Guard | None = None
        self._origins[id(entry)] = None, "entry", 0

    def argument(self, index: int, copy: Any, value: Any) -> None:
        """The compiler computes with a copy of an argument, whose numbers are those of native code."""
        self._admit(copy, value, None, "argument", index)

    def exchanged(self, made: Any, before: Any) -> None:
        """A record is another one with parts exchanged: what that one has beside its fields, and
        constants that Python computes of them, are its own too.
        """
        if made is not before:
            self._before[id(made)] = before
            self._alive.append(made)

    # -------------------------------------------------------------- questions of the translation

    def source(self, function: types.FunctionType) -> Source:
        """The source of a function, without the checks that a method makes of its arguments."""
        formula = (
            self._read(function, "attribute", "__formula__")
            if bare(function) is not function
            else function
        )
        for name in ("__code__", "__defaults__", "__kwdefaults__"):
            if getattr(formula, name) is not None:
                self._read(formula, "attribute", name)
        return Source(formula, self)

    def outer(self, function: types.FunctionType, name: str) -> Any:
        """The value of a name that is not local to the function."""
        if name in function.__code__.co_freevars:
            return self._read(function, "cell", name)
        return self._read(
            self._spaces.setdefault(id(function.__globals__), function), "global", name
        )

    def class_of(self, value: Any) -> type:
        """The class of an object, which may get another one."""
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
        """The method of the user's own that runs when a record of this class is made; '' if there is
        none.
        """
        for name in ("__new__", "__init__", "__post_init__"):
            home = next(c for c in cls.__mro__ if name in vars(c))
            made = self._read(cls, "attribute", name)
            code = getattr(made, "__code__", None)
            theirs = of_python(home) and not home.__module__.startswith(_LIBRARY)
            if theirs and code is not None and code.co_filename != "<string>":  # of `dataclass`
                return name
        return ""

    def sets_fields(self, cls: type) -> bool:
        """Do the library's own checks of a record set fields that were left out?"""
        checks = [vars(c).get("__post_init__") for c in cls.__mro__]
        return any("__setattr__" in inspect.unwrap(c).__code__.co_names for c in checks if c)

    def has(self, value: Any, name: str) -> bool:
        """What `hasattr` says."""
        if id(value) in self._given or (
            isinstance(value, Record) and id(value) not in self._origins
        ):
            return name in vars(value) or self._read(type(value), "has", name)
        outside = of_python(type(value)) or isinstance(
            value, (type, types.ModuleType, types.FunctionType)
        )
        if not outside and (id(value) not in self._origins or content_hashes.known(value, False)):
            return hasattr(value, name)  # what is there does not change, or the token tells
        return self._read(value, "has", name)

    def of_class(self, value: Any, name: str) -> bool:
        """Has the class of an object this member?"""
        cls = type(value)
        if of_python(cls) and id(cls) in self._origins:
            return bool(self._read(cls, "defines", name))
        return _member(cls, 0, name) is not _MISSING

    def identical(self, left: Any, right: Any) -> bool:
        """`left is right`.  Of records and containers it is written down: nothing else tells that
        two names have one.
        """
        pair, kinds = (left, right), (type(left), type(right))
        if any(x is None or isinstance(x, _OF_ONE_NAME) for x in pair) or kinds[0] is not kinds[1]:
            return left is right
        paths = [id(x) in self._origins for x in pair]
        if left is right and id(left) not in self._twice:
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
        """`isinstance(value, kinds)`.  Of classes that decide it themselves (abstract ones, protocols)
        it is written down.
        """
        self.class_of(value)
        found = False
        for kind in kinds if isinstance(kinds, tuple) else typing.get_args(kinds) or (kinds,):
            decides = isinstance(kind, type) and type(kind) is not type
            if decides and self.from_outside(value) and self.from_outside(kind):
                found = found or self._related(value, "isinstance", kind)
            else:
                found = found or isinstance(value, kind)
        return found

    def _related(self, left: Any, how: str, right: Any) -> bool:
        """The relation of two things from outside, written down."""
        step = self._number(left), how, self._number(right)
        if step not in self._numbers:
            value = _RELATIONS[how](self.values[step[0]], self.values[step[2]])
            self._note(step, value, digest(value, self.known))
        return bool(self.values[self._numbers[step]])

    def settled(self, *values: Any, inside: bool = False) -> None:
        """Refuse to let Python compute with objects (`inside`: or containers of such) whose code or
        content nobody has read.
        """
        for value in values:
            if isinstance(value, StandIn) or type(value) in ATOMS:
                continue
            if isinstance(value, decimal.Decimal):
                self._read(self.entry, "decimals", "")
            foreign = (
                id(value) in self._origins
                or of_python(type(value))
                or isinstance(value, (type, types.FunctionType))
            )
            if foreign and not content_hashes.known(value, inside):
                what = (
                    getattr(value, "__qualname__", None)
                    or f"an object of {type(value).__qualname__}"
                )
                raise NotCompilable(
                    f"Python would have to compute with {what} before the "
                    "run: formulas use attributes and calls; make it a tuple, a dict or a float"
                )
            self._unwritten(value, inside)

    def _unwritten(self, value: Any, inside: bool) -> None:
        """Write down that the class of a value (`inside`: and of its parts) has no operators of its
        own; it may get some.
        """
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
            member = _member(cls, after, name)
            if member is _MISSING or type(cls) not in _PLAIN_CLASSES:
                return self._read(owner, "attribute", name)
            return self._bound(self._read(cls, f"member {after}", name), None, cls, name, call)
        if isinstance(owner, (types.ModuleType, types.FunctionType)):
            return self._read(owner, "attribute", name)
        if not isinstance(owner, Record) and not of_python(cls):
            if (
                id(owner) not in self._origins
                or is_own(owner)
                or content_hashes.known(owner, False)
            ):
                return getattr(value, name)
            return self._read(owner, "attribute", name)
        if name == "__class__":
            return self.class_of(owner) if after == 0 else cls
        member = _member(cls, after, name)
        own = getattr(owner, "__dict__", {}) if after == 0 else {}
        if name in own and not hasattr(type(member), "__set__"):
            copied = id(owner) in self._given or id(owner) not in self._origins
            return own[name] if copied else self._read(owner, "attribute", name)
        if member is _MISSING and id(owner) in self._before:
            return self.attribute(self._before[id(owner)], name, call)
        if member is _MISSING or "__getattribute__" in {
            n for c in cls.__mro__[:-1] for n in vars(c)
        }:
            return self._read(owner, "attribute", name)
        if after == 0 and hasattr(owner, "__dict__") and not isinstance(owner, Record):
            # an attribute of its own would hide that of the class
            self._read(owner, "class", "")
            self._read(owner, "own", name)
        return self._bound(self._read(cls, f"member {after}", name), owner, cls, name, call)

    def _bound(
        self, member: Any, owner: Any, cls: type, name: str, call: Callable[..., Any]
    ) -> Any:
        """What Python makes of a member of a class, asked for through an instance or, if there is
        none, through the class.
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
            made = call(member.fget, owner)
            # a constant of the owner
            if isinstance(made, Record) and id(owner) in self._origins and not varies(made):
                self._admit(made, made, owner, "property", name)
            return made
        if isinstance(member, functools.cached_property):
            return self._cached(member, owner, name, call)
        return self._read(owner, "attribute", name)

    def _cached(self, member: Any, owner: Any, name: str, call: Callable[..., Any]) -> Any:
        """A cached property: a constant that Python computes, or a formula where it depends on
        numbers of the run.
        """
        if id(owner) in self._before:
            try:
                value = self.attribute(self._before[id(owner)], name, call)
            except NotCompilable:
                return call(member.func, owner)
            return call(member.func, owner) if varies(value) else value
        if id(owner) not in self._origins:
            return call(member.func, owner)
        if self._is_made(owner):
            self._glance(member.func, type(owner), set())
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
        """Was it there before the formulas?"""
        return id(value) in self._origins

    def made(self, value: Any) -> bool:
        """Did a formula make it, of what it has read?"""
        return id(value) not in self._origins or self._is_made(value)

    def _is_made(self, value: Any) -> bool:
        """Does a property make it anew each time, so that it cannot be looked at again?"""
        holder, how, _ = self._origins.get(id(value), (None, "", ""))
        return how == "property" or (holder is not None and self._is_made(holder))

    def _glance(self, function: Any, cls: type, seen: set[int]) -> None:
        """Write down what a function that Python runs names, and what the functions among that
        name.
        """
        if not isinstance(function, types.FunctionType) or id(function) in seen or is_own(function):
            return
        seen.add(id(function))
        formula = (
            self._read(function, "attribute", "__formula__")
            if bare(function) is not function
            else function
        )
        self._read(formula, "attribute", "__code__")
        for name in content_hashes.names(formula.__code__):
            if name in formula.__globals__:
                self._glance(self.outer(formula, name), cls, seen)
            member = _member(cls, 0, name)
            if member is not _MISSING:
                member = self._read(cls, "member 0", name)
                self._glance(
                    getattr(member, "fget", None) or getattr(member, "func", member), cls, seen
                )

    # -------------------------------------------------------------- the record

    def _read(self, holder: Any, how: str, name: Any) -> Any:
        """The value that the holder gives, written down."""
        step = self._number(holder), how, name
        if step[0] is _OWN:
            return _asked(holder, how, name)
        if step not in self._numbers:
            value = _asked(self.values[step[0]], how, name)
            self._note(step, value, digest(value, self.known))
            self._admit(value, value, holder, how, name)
        return self.values[self._numbers[step]]

    def _note(self, step: Step, value: Any, token: str) -> int:
        number = self._numbers[step] = len(self.steps)
        self.steps.append(step)
        self.values.append(value)
        self.tokens.append(token)
        return number

    def _number(self, value: Any) -> Any:
        """The number of the read that led to a value."""
        if id(value) in self._led:
            return self._led[id(value)]
        origin = self._origins.get(id(value))
        if origin is None:
            if is_own(value):
                return _OWN
            raise NotCompilable(
                f"where `{value!r:.60}` comes from cannot be told, so "
                "that a change of it would not be seen"
            )
        holder, how, name = origin
        step = (-1 if holder is None else self._number(holder)), how, name
        if step not in self._numbers:
            self._note(step, self._given.get(id(value), value), "")
        self._led[id(value)] = self._numbers[step]
        return self._numbers[step]

    def _admit(self, copy: Any, value: Any, holder: Any, how: str, name: Any) -> None:
        """Remember where a value comes from, and the parts of it.  A copy of an argument stands for
        the argument.
        """
        if type(copy) in ATOMS or isinstance(copy, StandIn):
            return
        self._alive.append(copy)
        if copy is not value:
            self._alive.append(value)
            self._given[id(copy)] = value
        if id(copy) in self._origins:
            before = self._origins[id(copy)]
            if before[0] is not holder or before[1:] != (how, name):
                self._twice.add(id(copy))
            return
        self._origins[id(copy)] = holder, how, name
        if copy is value:
            for way, key, part in inner(value):
                self._admit(part, part, value, way, key)
        else:
            for (way, key, part), (_, _, actual) in zip(parts(copy), parts(value), strict=True):
                self._admit(part, actual, copy, way, key)
        cls = type(copy)
        if of_python(cls) and id(cls) not in self._origins:
            self._admit(cls, cls, copy, "class", "")

    def copied(self, copy: Any, value: Any) -> None:
        """A copy with other numbers, those of a native function, comes from where the value does."""
        if id(value) in self._origins and id(copy) not in self._origins:
            self._alive.append(copy)
            self._origins[id(copy)] = self._origins[id(value)]
            self._given[id(copy)] = self._given.get(id(value), value)
        self.made_again(copy, value)

    def made_again(self, copy: Any, value: Any) -> None:
        """A record like one that may have had parts exchanged."""
        if id(value) in self._before and id(copy) not in self._before:
            self.exchanged(copy, self._before[id(value)])

    # -------------------------------------------------------------- comparison

    def manifest(self) -> list[Any]:
        """The paths and the tokens, as another process can read them."""
        return [[*step, token] for step, token in zip(self.steps, self.tokens, strict=True)]

    @classmethod
    def found(
        cls, entry: Callable[..., Any], args: Sequence[Any], manifest: list[Any]
    ) -> Reads | None:
        """These reads, made in this process, if everything is as it was."""
        reads = cls(entry)
        for parent, how, name, token in manifest:
            reads._note((parent, how, name), None, token)
        return reads if reads.follow(args) else None

    def follow(self, args: Sequence[Any]) -> bool:
        """Follow all paths from these arguments: are the tokens of what is there the same?"""
        found = self._found_from(args)
        if found is None:
            return False
        (self.values, self.known), self._guard = found, None
        return True

    def _found_from(self, args: Sequence[Any]) -> tuple[list[Any], Known] | None:
        """What the paths from these arguments lead to; None if some of it is not what was read."""
        values: list[Any] = []
        known: Known = {}
        try:
            for (parent, how, name), token in zip(self.steps, self.tokens, strict=True):
                values.append(
                    _RELATIONS[how](values[parent], values[name])
                    if how in _RELATIONS
                    else _asked(values[parent] if parent >= 0 else (self.entry, args), how, name)
                )
                if token and digest(values[-1], known) != token:
                    return None
        except Exception:  # whatever a path meets that is no longer there
            return None
        return values, known

    @property
    def guard(self) -> Guard:
        """Compares what was read with what is there now."""
        if self._guard is None:
            self._guard = Guard(self.steps, self.values, self.tokens, self.known)
        return self._guard

    def guard_of(self, args: Sequence[Any]) -> Guard | None:
        """A guard of their own for other arguments that lead to the same; None if they do not."""
        found = self._found_from(args)
        return None if found is None else Guard(self.steps, found[0], self.tokens, found[1])

    def unchanged(self, args: Sequence[Any]) -> bool:
        """Is all that was read what it was?  The same objects, in a few microseconds, or others
        with the same tokens.
        """
        verdict = self.guard.verdict(args)
        return self.follow(args) if verdict is None else verdict


class Guard:
    """Compares the values of reads with the present ones: by one expression of all comparisons,
    written and compiled for them.

    Where it does not hold, every read is asked for anew, one after the other, which tells what is
    different.
    """

    def __init__(
        self, steps: list[Step], values: list[Any], all_tokens: list[str], known: Known
    ) -> None:
        self.steps, self.values, self.tokens, self.known = steps, values, all_tokens, known
        # relations: the reads that lead to the two
        self.pairs: list[tuple[tuple[int, int], int]] = []
        self.compared: list[int] = []
        self.others: list[Any] = []  # what the comparisons need beside the values
        self.mutable: list[int] = []
        self.of_arguments: list[tuple[list[tuple[str, Any]], int]] = []
        self.parents = collections.Counter(parent for parent, *_ in steps)
        # from the arguments, of what is a part of them
        self.paths: list[list[tuple[str, Any]] | None] = []
        paths = self.paths
        # by properties: only `_glance` looks at what Python computed from them
        made: set[int] = set()
        for i, (parent, how, name) in enumerate(steps):
            above = [] if how == "argument" else paths[parent] if parent >= 0 else None
            if how in _RELATIONS:
                self.pairs.append(((parent, name), i))
                paths.append(None)
                continue
            named = isinstance(values[i], (type, types.FunctionType))
            if how == "property" or (parent in made and not named):
                made.add(i)
                paths.append(None)
                continue
            part = above is not None and not all_tokens[i] and not named
            paths.append([*above, (how, name)] if part and above is not None else None)
            if all_tokens[i] and above is not None and parent >= 0:
                self.of_arguments.append(([*above, (how, name)], i))
            elif all_tokens[i] or (
                parent >= 0
                and above is None
                and how in ("item", "value")
                and is_mutable(values[parent])
            ):
                self.compared.append(i)
            if all_tokens[i] and name != "__dataclass_fields__" and is_mutable(values[i]):
                self.mutable.append(i)
        self.same = self._expressions()

    def _expressions(self) -> list[Callable[[Sequence[Any], list[Any]], bool]]:
        """One for each module, which sees its names as any function there does, and one for
        everything else.
        """
        general: dict[int, str] = {}
        modules: dict[tuple[int, int], tuple[Any, list[str]]] = {}
        known = {f"v{i}": value for i, value in enumerate(self.values)}
        for i in self.compared:
            parent, how, name = self.steps[i]
            holder = self.values[parent]
            if how == "global" and "__builtins__" in holder.__globals__:
                space = id(holder.__globals__), id(holder.__builtins__)
                modules.setdefault(space, (holder, []))[1].append(f"{name} is _values[{i}]")
            # a method has its formula for ever
            elif name != "__formula__" or parent not in general:
                general[i] = self._comparison(i, holder, how, name)
        found = [*general.values()]
        for path, i in self.of_arguments:
            found.append(f"{self._along(path)} is _values[{i}]")
        for pair, i in self.pairs:
            left, right = [
                f"_values[{k}]" if self.paths[k] is None else self._along(self.paths[k])
                for k in pair
            ]
            related = self._other(_RELATIONS[self.steps[i][1]])
            found.append(f"{related}({left}, {right}) is {self.values[i]}")
        same = [_expression(found, known | {f"o{i}": value for i, value in enumerate(self.others)})]
        for holder, names in modules.values():
            made = _expression(names, holder.__globals__)
            same.append(made if made.__builtins__ is holder.__builtins__ else _never)
        return same

    def _along(self, path: Any) -> str:
        """What a path from the arguments leads to, as a text."""
        now = "_args"
        for how, name in path:
            now = f"{now}[{name}]" if how == "argument" else self._asked(now, how, name)
        return now

    def _comparison(self, i: int, holder: Any, how: str, name: Any) -> str:
        """What read number i asks for is what it was, as a text."""
        now, then = f"v{self.steps[i][0]}", f" is v{i}"
        if how == "cell":
            return f"{self._other(holder.__closure__[holder.__code__.co_freevars.index(name)])}.cell_contents{then}"
        if how.startswith("member"):
            after = int(how.partition(" ")[2])
            # Python code answers for it, and takes its time
            if isinstance(self.values[i], functools.cached_property):
                spaces = [self._other(vars(c)) for c in holder.__mro__[after:]]
                home = next(k for k, c in enumerate(holder.__mro__[after:]) if name in vars(c))
                hidden = [f"{name!r} not in {space} and " for space in spaces[:home]]
                return f"{now}.__mro__ is {self._other(holder.__mro__)} and {''.join(hidden)}{spaces[home]}[{name!r}]{then}"
            seen = super(holder.__mro__[after - 1], holder) if after else holder
            if getattr(seen, name, _MISSING) is self.values[i]:
                return self._asked(self._other(seen) if after else now, "attribute", name) + then
        return self._asked(now, how, name) + then

    def _other(self, value: Any) -> str:
        """A value that is no read, as a text."""
        self.others.append(value)
        return f"o{len(self.others) - 1}"

    def _asked(self, holder: str, how: str, name: Any) -> str:
        """A question to a holder, as a text."""
        if how == "attribute" and name.isidentifier() and not keyword.iskeyword(name):
            return f"{holder}.{name}"
        return f"{self._other(_asked)}({holder}, {how!r}, {name!r})"

    def verdict(self, args: Sequence[Any]) -> bool | None:
        """Is everything the same?  None: there are other objects, and their tokens must tell."""
        try:
            for holds in self.same:
                if not holds(args, self.values):
                    break
            else:
                return not self.mutable or all(
                    digest(self.values[i], self.known) == self.tokens[i] for i in self.mutable
                )
        except Exception:  # something is no longer there; which, does not matter yet
            pass
        try:
            return self._by_parts(args)
        except Exception:
            return False

    def _by_parts(self, args: Sequence[Any]) -> bool | None:
        unknown = False
        for i in self.compared:
            parent, how, name = self.steps[i]
            now, then = _asked(self.values[parent], how, name), self.values[i]
            if now is not then:
                if type(now) in ATOMS and not same(now, then):
                    return False
                unknown = unknown or type(now) not in ATOMS
        if unknown:
            return None
        for i in self.mutable:
            if digest(self.values[i], self.known) != self.tokens[i]:
                return False
        for path, i in self.of_arguments:
            value = self._now(path, args)
            if value is not self.values[i]:
                if i in self.parents or digest(value, self.known) != self.tokens[i]:
                    return None
                self.values[i] = value
        for pair, i in self.pairs:
            left, right = [
                self.values[k] if self.paths[k] is None else self._now(self.paths[k], args)
                for k in pair
            ]
            if _RELATIONS[self.steps[i][1]](left, right) is not self.values[i]:
                return False
        return True

    @staticmethod
    def _now(path: Any, args: Sequence[Any]) -> Any:
        value: Any = (None, args)
        for how, name in path:
            value = _asked(value, how, name)
        return value


def _expression(comparisons: list[str], names: dict[str, Any]) -> Any:
    """A function that says whether all of these hold, where a text sees these names.

    A module that has one of the names of its arguments is compared with them, in vain: then
    everything is asked for anew.
    """
    return eval(f"lambda _args, _values: {' and '.join(comparisons) or True}", names)


def _never(*_: Any) -> bool:
    return False


_OWN: Any = object()
_LIBRARY = f"{__name__.partition('.')[0]}."
_PLAIN_CLASSES = {type, abc.ABCMeta}
_RELATIONS: dict[str, Callable[[Any, Any], bool]] = {"is": operator.is_, "isinstance": isinstance}
"""Reads of two things, each known by its number."""
_OF_ONE_NAME = (
    bool,
    type,
    enum.Enum,
    types.ModuleType,
    types.FunctionType,
    types.BuiltinFunctionType,
)
"""What `is` may compare: their tokens say which object it is."""


def varies(value: Any) -> bool:
    """Is a number of the run in it, in a field of a record too?"""
    return isinstance(value, StandIn) or any(varies(x) for *_, x in inner(value))


def _member(cls: type, after: int, name: str) -> Any:
    """What the classes say about a name, from this one of the resolution order on."""
    for c in cls.__mro__[after:]:
        if name in vars(c):
            return vars(c)[name]
    return _MISSING


def _asked(holder: Any, how: str, name: Any) -> Any:
    """What is there now."""
    match how.partition(" ")[0]:
        case "attribute" | "property":
            return getattr(holder, name)
        case "global":
            for names in (holder.__globals__, holder.__builtins__):
                if name in names:
                    return names[name]
            raise NotCompilable(f"the name `{name}` is not defined")
        case "cell":
            try:
                return holder.__closure__[holder.__code__.co_freevars.index(name)].cell_contents
            except ValueError:
                raise NotCompilable(f"`{name}` has no value yet") from None
        case "member":
            value = _member(holder, int(how.partition(" ")[2]), name)
            if value is _MISSING:
                raise AttributeError(name)
            return value
        case "item":
            return holder[name]
        case "value":
            return list(holder.values())[name]
        case "class":
            return type(holder)
        case "has":
            return hasattr(holder, name)
        case "defines":
            return _member(holder, 0, name) is not _MISSING
        case "plain":
            return not content_hashes.has_operators(holder)
        case "own":
            return name in vars(holder)
        case "argument":
            return holder[1][name]
        case "entry":
            return holder[0]
        case "decimals":  # how they are rounded
            now = decimal.getcontext()
            return f"{now.prec} {now.rounding} {now.Emin} {now.Emax} {now.clamp}"
    raise NotCompilable(f"a read of an unknown kind, {how}")
