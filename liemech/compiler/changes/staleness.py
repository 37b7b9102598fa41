"""Guards: comparisons of what translations have read with the objects of today.

In this process the values are compared with the present ones by identity, which takes microseconds;
where they are other objects, their tokens tell.
"""

from __future__ import annotations

import collections
import decimal
import functools
import keyword
import operator
import threading
import types
from collections.abc import Callable, Collection, Sequence
from typing import Any

from ...errors import NotCompilable
from . import content_hashes
from .content_hashes import ATOMS, Known, digest, is_mutable, same
from .words import Word, Words, words_of

Step = tuple[int, str, Any]
"""A read: the number of the read that led to the holder (-1: none), the kind of the read, and its name."""

Path = list[tuple[str, Any]]
"""The kinds and names of reads, one after the other, from the arguments to a value."""

MISSING = object()

LOOKS = 8
"""How often the words of a read may change for other reasons before they are given up: where a class counts its objects,
or a loop sets names of its module, they always do.  One change costs 0.5 ms, as much as 300 looks at all words of a top;
a class that is edited now and then keeps its words.
"""

_settling = threading.Lock()

RELATIONS: dict[str, Callable[[Any, Any], bool]] = {"is": operator.is_, "isinstance": isinstance}
"""Reads of two things, each known by its number."""


class Guard:
    """Compares the values of reads with the present ones: some by words of memory that change with them, all others by
    one expression, which is written and compiled for them.

    Where that does not hold, the reads are made again one by one, which shows what has changed.
    """

    def __init__(self, steps: list[Step], values: list[Any], tokens: list[str], namesakes: Known) -> None:
        self.steps, self.values, self.tokens, self.known = steps, values, tokens, namesakes
        self.parents = collections.Counter(parent for parent, *_ in steps)
        # the numbers of reads that are compared by identity, and of values whose content can change
        self.compared: list[int] = []
        self.mutable: list[int] = []
        # reads of parts of the arguments, each with its path; relations, with the reads that lead to the two
        self.of_arguments: list[tuple[Path, int]] = []
        self.pairs: list[tuple[tuple[int, int], int]] = []
        # of every read that is a part of the arguments without a token the path; None for others
        self.paths: list[Path | None] = []
        computed: set[int] = set()  # by properties: only an expression looks at what Python computed from them
        for i, (parent, how, name) in enumerate(steps):
            above = [] if how == "argument" else self.paths[parent] if parent >= 0 else None
            path = None if above is None else [*above, (how, name)]
            named = isinstance(values[i], (type, types.FunctionType))
            if how in RELATIONS:
                self.pairs.append(((parent, name), i))
            elif how == "property" or (parent in computed and not named):
                computed.add(i)
            else:
                self._compare(i, path)
            self.paths.append(None if tokens[i] or named or how in RELATIONS or i in computed else path)
        # words, and expressions for the reads that have no words
        self.glance: tuple[Words, list[Callable[[Sequence[Any], list[Any]], bool]]] | None = None
        self.words: dict[int, list[Word]] = {}
        self.restless: collections.Counter[int] = collections.Counter()
        self.literals: list[Any] = []  # objects in expressions that are values of no read

    def _compare(self, i: int, path: Path | None) -> None:
        """Put a read into the lists by which it is compared.  path : from the arguments."""
        parent, how, name = self.steps[i]
        holder_changes = parent >= 0 and how in ("item", "value") and is_mutable(self.values[parent])
        if self.tokens[i] and path is not None and parent >= 0:
            self.of_arguments.append((path, i))
        elif self.tokens[i] or (path is None and holder_changes):
            self.compared.append(i)
        if self.tokens[i] and name != "__dataclass_fields__" and is_mutable(self.values[i]):
            self.mutable.append(i)

    def _words(self) -> dict[int, list[Word]]:
        """The present words of the reads; none for reads whose words often change for other reasons."""
        shown = {}
        for i in self.compared:
            parent, how, name = self.steps[i]
            if parent >= 0 and self.restless[i] <= LOOKS:
                words = words_of(self.values[parent], how, name, self.values[i])
                if words:
                    shown[i] = words
        return shown

    def _expressions(self, shown: Collection[int]) -> list[Callable[[Sequence[Any], list[Any]], bool]]:
        """The comparisons of all reads: an expression for each module, which sees its names as any function there does,
        and one for everything else.

        shown : reads that are compared by words.
        """
        general: dict[int, str] = {}
        modules: dict[tuple[int, int], tuple[Any, list[str]]] = {}
        namespace = {f"v{i}": value for i, value in enumerate(self.values)}
        for i in self.compared:
            if i in shown:
                continue
            parent, how, name = self.steps[i]
            holder = self.values[parent]
            if how == "global" and "__builtins__" in holder.__globals__:
                space = id(holder.__globals__), id(holder.__builtins__)
                modules.setdefault(space, (holder, []))[1].append(f"{name} is _values[{i}]")
            # a method has its formula for ever
            elif name != "__formula__" or not (parent in general or parent in shown):
                general[i] = self._comparison(i, holder, how, name)
        comparisons = [*general.values()]
        for path, i in self.of_arguments:
            comparisons.append(f"{self._along(path)} is _values[{i}]")
        for pair, i in self.pairs:
            left, right = [f"_values[{k}]" if (part := self.paths[k]) is None else self._along(part) for k in pair]
            related = self._literal(RELATIONS[self.steps[i][1]])
            comparisons.append(f"{related}({left}, {right}) is {self.values[i]}")
        expressions = [_expression(comparisons, namespace | {f"o{i}": value for i, value in enumerate(self.literals)})]
        for holder, names in modules.values():
            expression = _expression(names, holder.__globals__)
            expressions.append(expression if expression.__builtins__ is holder.__builtins__ else lambda *_: False)
        return expressions

    def _along(self, path: Path) -> str:
        """An expression for the value at the end of a path from the arguments."""
        expression = "_args"
        for how, name in path:
            expression = f"{expression}[{name}]" if how == "argument" else self._read_expression(expression, how, name)
        return expression

    def _comparison(self, i: int, holder: Any, how: str, name: Any) -> str:
        """An expression that is true while read number i gives what it gave."""
        now, then = f"v{self.steps[i][0]}", f" is v{i}"
        if how == "cell":
            return f"{self._literal(holder.__closure__[holder.__code__.co_freevars.index(name)])}.cell_contents{then}"
        if how.startswith("member"):
            after = int(how.partition(" ")[2])
            # Python code answers for it, and takes its time
            if isinstance(self.values[i], functools.cached_property):
                spaces = [self._literal(vars(c)) for c in holder.__mro__[after:]]
                home = next(k for k, c in enumerate(holder.__mro__[after:]) if name in vars(c))
                hidden = [f"{name!r} not in {space} and " for space in spaces[:home]]
                return f"{now}.__mro__ is {self._literal(holder.__mro__)} and {''.join(hidden)}{spaces[home]}[{name!r}]{then}"
            view = super(holder.__mro__[after - 1], holder) if after else holder
            if getattr(view, name, MISSING) is self.values[i]:
                return self._read_expression(self._literal(view) if after else now, "attribute", name) + then
        return self._read_expression(now, how, name) + then

    def _literal(self, value: Any) -> str:
        """The name, in an expression, of an object that is the value of no read."""
        self.literals.append(value)
        return f"o{len(self.literals) - 1}"

    def _read_expression(self, holder: str, how: str, name: Any) -> str:
        """An expression that makes a read."""
        if how == "attribute" and name.isidentifier() and not keyword.iskeyword(name):
            return f"{holder}.{name}"
        return f"{self._literal(value_read)}({holder}, {how!r}, {name!r})"

    def verdict(self, args: Sequence[Any]) -> bool | None:
        """True if every read gives the value that it gave, False if one does not; None if some give other objects, which
        only tokens can compare.
        """
        glance, words = self.glance, None
        if glance is None or not glance[0].same():
            words = self._words()  # before they can change
        else:
            try:
                for holds in glance[1]:
                    if not holds(args, self.values):
                        break
                else:
                    return not self.mutable or self._content()
            except Exception:  # something is no longer there; which, does not matter yet
                pass
        try:
            verdict = self._by_parts(args)
        except Exception:
            return False
        if verdict and words is not None:
            self._settle(words)
        return verdict

    def _settle(self, words: dict[int, list[Word]]) -> None:
        """Compare by these words from now on, and the other reads by expressions."""
        with _settling:
            before, self.words = self.words, words
            self.restless.update([i for i in before if before[i] != words.get(i)])
            if self.glance is None or before.keys() != words.keys():
                self.literals = []
                expressions = self._expressions(words)
            else:
                expressions = self.glance[1]
            self.glance = Words([x for group in words.values() for x in group]), expressions

    def _content(self) -> bool:
        """Whether the values that can change in place still have their tokens."""
        return all(digest(self.values[i], self.known) == self.tokens[i] for i in self.mutable)

    def _by_parts(self, args: Sequence[Any]) -> bool | None:
        """The verdict, read by read."""
        unknown = False
        for i in self.compared:
            parent, how, name = self.steps[i]
            now, then = value_read(self.values[parent], how, name), self.values[i]
            if now is not then:
                if type(now) in ATOMS and not same(now, then):
                    return False
                unknown = unknown or type(now) not in ATOMS
        if unknown:
            return None
        if not self._content():
            return False
        for path, i in self.of_arguments:
            value = self._now(path, args)
            if value is not self.values[i]:
                if i in self.parents or digest(value, self.known) != self.tokens[i]:
                    return None
                self.values[i] = value
        for pair, i in self.pairs:
            left, right = [self.values[k] if (part := self.paths[k]) is None else self._now(part, args) for k in pair]
            if RELATIONS[self.steps[i][1]](left, right) is not self.values[i]:
                return False
        return True

    @staticmethod
    def _now(path: Path, args: Sequence[Any]) -> Any:
        """The present value at the end of a path from the arguments."""
        value: Any = (None, args)
        for how, name in path:
            value = value_read(value, how, name)
        return value


def _expression(comparisons: list[str], names: dict[str, Any]) -> Any:
    """The function of arguments and values that is true if all comparisons hold; they see these names.

    A module with a global `_args` or `_values` is compared wrongly, and seems to have changed: then reads are made again.
    """
    return eval(f"lambda _args, _values: {' and '.join(comparisons) or True}", names)


def member_of(cls: type, after: int, name: str) -> Any:
    """The member of a class, or of its bases, from this one of the resolution order on."""
    return next((vars(c)[name] for c in cls.__mro__[after:] if name in vars(c)), MISSING)


def value_read(holder: Any, how: str, name: Any) -> Any:
    """The present value of a read.  how : its kind.  name : the attribute, the index, ... that is read."""
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
            value = member_of(holder, int(how.partition(" ")[2]), name)
            if value is MISSING:
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
            return member_of(holder, 0, name) is not MISSING
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
