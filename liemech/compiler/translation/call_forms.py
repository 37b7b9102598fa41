"""Forms of calls: the arguments without the numbers of the run among them.

Calls of one form share a native function.  The numbers of vectors, records, lists, ... are passed
and returned; the caller puts the result together again.
"""

from __future__ import annotations

import dataclasses
import struct
import types
from typing import Any

import numpy as np
from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.classes.layouts import Layout, layout_of
from ...formulas.classes.records import Record, of_parts, parts_of
from ...formulas.numbers.pairs import PAIRS
from ...formulas.tables import Table
from ...formulas.vectors import Mat, Vec
from ..buffers import SiteRows
from ..numbers.ir_numbers import F64, I64, Num
from .aliases import lists


class UnknownForm(Exception):
    """Raised for an argument that has no form to compare calls by: the call is written out."""


@dataclasses.dataclass(eq=False)
class Call:
    """The arguments of a call, taken apart: two keys of its form, and the numbers among them."""

    known: tuple[Any, ...]  # the key of the form in which every constant is built in
    general: tuple[Any, ...]  # of that in which constants inside vectors, matrices and pairs are passed as numbers
    numbers: list[Num]  # passed in the first form: each once, and none of the kernel's arguments
    all_numbers: list[Num]  # passed in the general form
    constants: list[int]  # the places of constants among `all_numbers`
    parts: list[Any]  # the vectors, records, ... among the arguments and in them

    def passed(self, general: bool) -> list[Num]:
        """The numbers passed to a function of the general form, or of the other one."""
        return self.all_numbers if general else self.numbers


class CallForms:
    """Takes the arguments and results of calls apart and puts them together again."""

    def __init__(self, translator: Any) -> None:
        self.translator, self.emitter = translator, translator.emitter
        # by its identity, a constant and its key
        self.keys_of_constants: dict[int, tuple[Any, Any]] = {}

    def call_of(self, function: Any, env: dict[str, Any]) -> Call | None:
        """The call of a function with these arguments; None if one of them has no form that could be compared."""
        active = self.translator.active(self.translator.frames[-1].env) if self.translator.frames else None
        numbered: dict[Any, int] = {}
        numbers: list[Num] = []
        constants: list[int] = []
        parts: list[Any] = []
        places: dict[int, int] = {}

        def form(x: Any, inside: bool, general: bool) -> Any:
            if isinstance(x, Num):
                place = self._parameter(x)
                if place is not None:
                    return "parameter", place
                if x.values not in numbered:
                    numbered[x.values] = len(numbers)
                    numbers.append(x)
                return x.kind, x.varying, x.mixed, numbered[x.values]
            if type(x) is float:
                if general and inside:
                    constants.append(len(numbers))
                    numbers.append(self.emitter.constant(x))
                    return "f", False, False, constants[-1]
                return self._key_of_constant(x)
            if x is None or isinstance(x, (bool, int, str, bytes)) or self._is_constant(x):
                return self._key_of_constant(x)
            if not isinstance(x, _STRUCTURES):
                raise UnknownForm
            if id(x) in places:
                return "again", places[id(x)]
            places[id(x)] = len(parts)
            parts.append(x)
            inside = inside or isinstance(x, (Vec, Mat, *PAIRS))
            kind = x.form if isinstance(x, PAIRS) else type(x)
            return kind, tuple([form(y, inside, general) for y in parts_of(x)])

        try:
            items = [*env.items(), ("<mask>", active)]
            specific = tuple([(name, form(x, False, False)) for name, x in items])
            of_known, all_parts = [*numbers], [*parts]
            for container in (numbers, numbered, places, parts):
                container.clear()
            general = tuple([(name, form(x, False, True)) for name, x in items])
        except UnknownForm:
            return None
        context = function, self.emitter.lanes, bool(self.translator.state.escapes)
        return Call((*context, specific), (*context, general), of_known, numbers, constants, all_parts)

    def _key_of_constant(self, x: Any) -> Any:
        """The key of a constant: the content of a record or tuple that a formula made, else the identity."""
        if x is None or isinstance(x, (bool, int, str, bytes)):
            return type(x), x
        if type(x) is float:
            return "float", struct.pack("<d", x)
        if id(x) not in self.keys_of_constants:
            key: Any = "object", id(x)
            if (type(x) is tuple or isinstance(x, Record)) and self.translator.reads.made(x):
                key = type(x), tuple([self._key_of_constant(y) for y in parts_of(x)])
            self.keys_of_constants[id(x)] = x, key
        return self.keys_of_constants[id(x)][1]

    def _is_constant(self, x: Any) -> bool:
        """Whether a value is a constant as a whole: a function, an array, a record or tuple of constants alone."""
        if (
            id(x) in self.keys_of_constants
            or isinstance(x, _OBJECTS)
            or (isinstance(x, Table) and x.content is not None)
        ):
            return True
        if type(x) is tuple:
            return all(
                y is None or isinstance(y, (bool, int, float, str)) or (type(y) is tuple and self._is_constant(y))
                for y in x
            )
        return isinstance(x, Record) and not layout_of(x).width

    def _parameter(self, x: Num) -> int | None:
        """The place of a number that the present function loaded from the kernel's arguments; None for any other number.
        Native functions load such numbers themselves.
        """
        v = x.values[0]
        place = self._parameter_of(x)
        return place if place is not None and v.operands[0].pointer is self.emitter.builder.function.args[0] else None

    def _parameter_of(self, x: Num) -> int | None:
        """The place of a number that any function loaded from the kernel's arguments."""
        v = x.values[0]
        if isinstance(v, ir.LoadInstr) and isinstance(v.operands[0], ir.GEPInstr) and v.type == F64:
            pointer = v.operands[0]
            if isinstance(pointer.pointer, ir.Argument) and isinstance(pointer.indices[0], ir.Constant):
                return pointer.indices[0].constant
        return None

    def _loaded(self, place: int) -> Num:
        """A number of the kernel's arguments, loaded in the present function."""
        b = self.emitter.builder
        return self.emitter.num(
            [b.load(b.gep(b.function.args[0], [ir.Constant(I64, place)], source_etype=F64), typ=F64)]
        )

    def parameters(
        self, env: dict[str, Any], active: Any, call: Call, inner: list[Num], general: bool, has_sites: bool
    ) -> tuple[dict[str, Any], list[Any]]:
        """The arguments as the function sees them, and their parts.  has_sites : does it loop over sites?"""
        of = {x.values: y for x, y in zip(call.passed(general), inner)}
        constants = iter([inner[i] for i in call.constants] if general else [])
        loaded: dict[int, Num] = {}
        parts: list[Any] = []
        places: dict[int, int] = {}

        def seen(x: Any, inside: bool) -> Any:
            if isinstance(x, Num):
                if x.values in of:
                    return of[x.values]
                place = self._parameter_of(x)
                assert place is not None
                if place not in loaded:
                    loaded[place] = self._loaded(place)
                return loaded[place]
            if type(x) is float:
                return next(constants) if general and inside else x
            if isinstance(x, SiteRows) and has_sites:
                return SiteRows(self.emitter, *x.numbers)
            if self._is_constant(x) or not isinstance(x, _STRUCTURES):
                return x
            if id(x) in places:
                return parts[places[id(x)]]
            place = places[id(x)] = len(parts)
            parts.append(None)
            inside = inside or isinstance(x, (Vec, Mat, *PAIRS))
            parts[place] = of_parts(x, [seen(y, inside) for y in parts_of(x)])
            self.translator.reads.copied(parts[place], x)
            if isinstance(x, list):  # the caller has it too
                self.translator.aliases.share([parts[place]])
            return parts[place]

        return {name: seen(x, False) for name, x in [*env.items(), ("<mask>", active)]}, parts

    def recipe(self, result: Any, inner: list[Num], parts: list[Any]) -> tuple[tuple[str, Any], list[Num]]:
        """How a caller puts a result together, from arguments, constants and numbers that the function returns; and these
        numbers.  inner, parts : the arguments as the function sees them.
        """
        arguments = {x.values: i for i, x in enumerate(inner)}
        whole_arguments = {id(x): i for i, x in enumerate(parts)}
        numbers: list[Num] = []
        at: dict[Any, int] = {}
        listed: list[list[Any]] = []  # lists in the result

        def of_part(x: Any) -> tuple[str, Any]:
            if isinstance(x, Num):
                place = self._parameter(x)
                if place is not None:
                    return "parameter", place
                if x.values in arguments:
                    return "argument", arguments[x.values]
                if x.values not in at:
                    at[x.values] = len(numbers)
                    numbers.append(x)
                return "result", at[x.values]
            if x is None or isinstance(x, (bool, int, float, str, bytes)) or self._is_constant(x):
                return "constant", x
            if id(x) in whole_arguments:
                return "part", whole_arguments[id(x)]
            if isinstance(x, list):
                if self.translator.reads.from_outside(x) or any(x is y for y in listed):
                    raise NotCompilable("a list that has another name")
                listed.append(x)
            if not isinstance(x, _STRUCTURES):
                raise NotCompilable(f"a result that holds {type(x).__name__}")
            return "structure", (x, [of_part(y) for y in parts_of(x)])

        return of_part(result), numbers

    def restored(self, recipe: tuple[str, Any], call: Call, passed: list[Num], numbers: list[Num]) -> Any:
        """The result of a call, put together by its recipe."""
        kind, x = recipe
        match kind:
            case "structure":
                whole = of_parts(x[0], [self.restored(y, call, passed, numbers) for y in x[1]])
                self.translator.reads.made_again(whole, x[0])
                if id(x[0]) in self.translator.aliases.shared:
                    self.translator.aliases.share([whole, *lists(call.parts)])
                return whole
            case "parameter":
                return self._loaded(x)
            case "argument":
                return passed[x]
            case "part":
                return call.parts[x]
            case "result":
                return numbers[x]
        return x


_STRUCTURES = (Vec, Mat, *PAIRS, tuple, list, Record, Table)
_OBJECTS = (types.FunctionType, types.BuiltinFunctionType, type, np.ndarray, np.generic, range, Layout, SiteRows)
