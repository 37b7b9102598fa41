"""Phi nodes: how the variables of a formula come together where ways of control meet, for one body
or for many in lanes.

In an ensemble a condition may differ from lane to lane; then both ways run under a mask.  Values in
lanes that a piece of code does not run for are arbitrary: where two pieces meet, the value of each
lane is picked.
"""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.classes.layouts import build, layout_of, leaves
from ...formulas.classes.taken_back import back
from ...formulas.numbers.bases import is_any_number
from ...formulas.numbers.compensated import Compensated
from ...formulas.numbers.complex_numbers import Complex
from ...formulas.numbers.dual import at_rest
from ...formulas.numbers.forms import PULLED, LinearForm, factors_of, now, swept
from ...formulas.numbers.pairs import PAIRS, paired
from ...formulas.vectors import Mat, Vec
from ..changes.dependencies import Reads
from ..numbers.ir_numbers import Emitter, Num, Values
from .advice import differing
from .aliases import Aliases
from .iterators import ItemStream
from .scopes import RETURN, CallFrame, Env, Undefined, has
from .state import TranslationState

# lanes still running at this point, where some have left (absent: all for which the code was
# entered)
ACTIVE = "<active>"
BROKEN = "<broken>"  # lanes that left the present loop by `break`
CONTINUED = "<continued>"  # lanes that left the present turn of a written-out loop by `continue`
LEFT = (BROKEN, CONTINUED)
NO_LANE = "no lane is running"  # value of ACTIVE when every lane has left


class Retype(Exception):
    """Raised where a number that a loop carries needs another type (an int becomes a float); None: the loop needs a mask."""

    def __init__(self, number: int | None, kind: str = "b", varying: bool = False, mixed: bool = False) -> None:
        self.number, self.type = number, (kind, varying, mixed)


@dataclasses.dataclass
class Open:
    """A place where control is still to be led on, and the variables there."""

    block: ir.Block
    env: Env
    end: Callable[[ir.Block], Any] | None = None  # emits the terminator, given the block to go to
    made: int = dataclasses.field(default_factory=now)  # before forms that may be unknown on other ways


@dataclasses.dataclass
class Loop:
    """The loop being translated: where `break` and `continue` go."""

    dynamic: bool
    depth: int
    masked: bool = False
    breaks: list[Open] = dataclasses.field(default_factory=list)
    continues: list[Open] = dataclasses.field(default_factory=list)


class Returns(Exception):
    """Raised where a loop turns out to have a `return`.  blank : a value like that it returns."""

    def __init__(self, blank: Any) -> None:
        self.blank = blank


class Promote(Exception):
    """Raised where variables that a loop carries get another structure in it, such as a derivative."""

    def __init__(self, variables: Env) -> None:
        self.variables = variables  # as they are at the end of a turn


class Felt(Exception):
    """Raised where slopes that a loop carries depend on linear forms from before it that are not known there."""

    def __init__(self, forms: list[LinearForm]) -> None:
        self.forms = forms


class Joins:
    """The state of a translation, and where branches meet; subclasses translate statements."""

    def __init__(self, emitter: Emitter, reads: Reads) -> None:
        self.emitter, self.builder, self.reads = emitter, emitter.builder, reads
        self.outliner: Any = None  # makes functions of formulas
        # of loops met before: whether they are masked, and the types that changed
        self.loop_forms: dict[Any, Any] = {}
        # `while` loops met before whose number of turns the run decides
        self.lasting: set[Any] = set()
        # `and` and `or` met before whose second operand needs a branch
        self.branching: set[ast.expr] = set()
        # of more than two operands, those after the first
        self.others: dict[ast.BoolOp, ast.expr] = {}
        self.frames: list[CallFrame] = []
        self.aliases = Aliases(self.frames, reads)
        self.state = TranslationState()
        self.regions = 0
        # of branches and loops that have ended, when linear forms were made there
        self.ended: list[tuple[int, int]] = []
        self.streams: list[ItemStream] = []
        self.worked = 0  # expressions so far, with those that were taken back

    def block(self, statements: list[ast.stmt], env: Env) -> bool:
        raise NotImplementedError

    # -------------------------------------------------------------- values

    def blend(self, mask: Any, new: Any, old: Any) -> Any:
        """`new` in the lanes of the mask, `old` elsewhere, number by number."""
        if isinstance(mask, bool):
            return new if mask else old
        return self._numberwise([new, old], lambda x, y: self.emitter.select(mask, x, y))

    def blended(self, name: str, mask: Any, new: tuple[Any, Env], old: tuple[Any, Env]) -> Any:
        """`blend` of two values of a variable, each with the variables around it, of which some may
        hold the same lists.
        """
        parts = [self.settled(value, self.state.since) for value, _ in (new, old)]
        result = self.blend(mask, *parts)
        if not isinstance(mask, bool):
            self.aliases.meet(name, result, (new, old))
        return result

    def blank(self, value: Any) -> Any:
        """The value with undefined numbers in place of those of the run."""
        e = self.emitter

        def arbitrary(x: Any) -> Any:
            if not isinstance(x, Num):
                return x
            return e.each(lambda v: ir.Constant(v.type, ir.Undefined), x.values)

        if isinstance(value, Undefined):
            return value
        layout = layout_of(value, is_any_number)
        if "place" not in layout.kinds:
            return self._numberwise([value], arbitrary)
        numbers = zip(leaves(value, layout), layout.kinds, strict=True)
        return build(layout, iter([e.large.anywhere() if kind == "place" else arbitrary(x) for x, kind in numbers]))

    def zeros(self, value: Any) -> Any:
        """The value with 0 in place of the numbers of the run."""
        return self._numberwise(
            [value], lambda x: self.emitter.constant(0, x.kind, x.varying) if isinstance(x, Num) else x
        )

    def _numberwise(self, items: list[Any], combine: Callable[..., Any]) -> Any:
        """A value of one structure, combined number by number; equal numbers are taken once."""
        if len(items) > 1 and all(v is items[0] for v in items):
            return items[0]
        for v in items:
            if isinstance(v, Undefined):
                return v
        items = leveled(items)
        layouts = [layout_of(v, is_any_number) for v in items]
        if any(layout != layouts[0] for layout in layouts):
            return Undefined(f"it is one thing on one way and another on the other: {differing([*map(repr, layouts)])}")

        def one(row: tuple[Any, ...]) -> Any:
            if len(row) > 1 and _alike(row):
                return row[0]
            if not any(isinstance(x, LinearForm) for x in row):
                return combine(*row)
            ways = [factors_of(x) for x in row]
            forms = dict.fromkeys(form for terms in ways for form in terms)
            return LinearForm(*[(one(tuple([terms.get(form, 0.0) for terms in ways])), form) for form in forms])

        rows = zip(*(leaves(v, layouts[0]) for v in items), strict=True)
        return build(layouts[0], iter([one(row) for row in rows]))

    def settled(self, value: Any, before: float = math.inf, given: Any = ()) -> Any:
        """The value with linear forms that are sums of given ones, and of those which are known wherever control comes
        from: that were made before, and in no branch or loop that has ended.
        """
        if not PULLED.get() or isinstance(value, Undefined):
            return value
        layout = layout_of(value, is_any_number)
        numbers = leaves(value, layout)
        if not any(isinstance(x, LinearForm) for x in numbers):
            return value

        def known(form: LinearForm) -> bool:
            return form in given or (form.made < before and not any(a <= form.made <= b for a, b in self.ended))

        return build(layout, iter([self._of_known(x, known) if isinstance(x, LinearForm) else x for x in numbers]))

    def _of_known(self, form: LinearForm, known: Callable[[LinearForm], bool]) -> LinearForm:
        """A form as the sum of forms that are known; not as itself, which lanes that rest may not have."""
        felt, notes = swept([(x, k) for k, x in form.terms] or [(form, 1.0)], known)
        if notes:
            raise NotCompilable(
                "on the way back a velocity, a force or a load is asked for in a branch or a loop: ask before, outside of it"
            )
        return LinearForm(*[(k, x) for x, k in felt.items() if known(x)])

    def active(self, env: Env) -> Any:
        """The mask of lanes running here; None for all."""
        live = env.get(ACTIVE)
        return self.emitter.constant(False, "b", True) if live is NO_LANE else self.state.base if live is None else live

    @contextlib.contextmanager
    def apart(self, loop: bool = False) -> Iterator[None]:
        """Code that control may pass by, or pass several times."""
        outer = self.state.region
        self.regions += 1
        self.state.region = (*outer, (self.regions, loop))
        take_back, entered = back(), now()  # what is first computed here is not there elsewhere
        yield
        take_back()
        self.state.region = outer
        if PULLED.get():
            self.ended = [*[x for x in self.ended if x[0] < entered], (entered, now())]

    def fail_if(self, condition: Any, everywhere: bool = False) -> None:
        """Python raises here if the condition holds: the attempt has failed, in the lanes that run
        or `everywhere`.  Outside of attempts numbers go on as they are.
        """
        if condition is False or not self.state.escapes:
            return
        self.state.raises, self.state.marks = self.state.raises + 1, self.state.marks + 1
        mask = None if everywhere else self.active(self.frames[-1].env)
        lanes = self.emitter.logic("and_", condition, self.everyone(mask))
        self.emitter.store(self.emitter.logic("or_", self.emitter.load(self.state.failed), lanes), self.state.failed)

    def everyone(self, mask: Any) -> Any:
        return True if mask is None else mask

    # -------------------------------------------------------------- where ways meet

    def join(self, opens: list[Open], env: Env, into: ir.Block | None = None) -> bool:
        """Lead control from all open places to one, leaving there in `env` what the variables may
        be; False if none is open.
        """
        if not opens:
            return False
        if len(opens) == 1 and into is None and opens[0].end is None:
            self.builder.position_at_end(opens[0].block)
            replace(env, opens[0].env)
            return True
        into = into or self.builder.append_basic_block()
        self._align_masks(opens)
        self._settle(opens)
        merged: Env = {}
        blocks = [o.block for o in opens]
        for name in dict.fromkeys(name for o in opens for name in o.env if not name.startswith("<has ")):
            values = [o.env[name] for o in opens if name in o.env]
            certain = [o.env.get(has(name), name in o.env) for o in opens]
            if len(values) < len(opens):
                if name.startswith("<"):
                    continue
                blank = next((v for v in values if isinstance(v, Undefined)), None) or self.blank(values[0])
                values = [o.env.get(name, blank) for o in opens]
            merged[name] = self._together(into, blocks, values)
            if any(v is not merged[name] for v in values):
                variants = [(o.env[name], o.env) for o in opens if name in o.env]
                self.aliases.meet(name, merged[name], variants)
            if not all(c is True for c in certain):
                merged[has(name)] = self._together(into, blocks, certain)
        for o in opens:
            self.builder.position_at_end(o.block)
            (o.end or self.builder.branch)(into)
        self.builder.position_at_end(into)
        replace(env, merged)
        return True

    def _settle(self, opens: list[Open]) -> None:
        """Let the linear forms of variables that differ be settled where each of the ways ends."""
        if not PULLED.get():
            return
        before = min(o.made for o in opens)
        for o in opens:
            self.builder.position_at_end(o.block)
            differing_ones = {n: v for n, v in o.env.items() if any(other.env.get(n) is not v for other in opens)}
            o.env.update({n: self.settled(v, before) for n, v in differing_ones.items()})
            o.block = self.builder.block

    def _together(self, into: ir.Block, blocks: list[ir.Block], items: list[Any]) -> Any:
        """The value of a variable behind the blocks, of which each ends with one of the items."""
        return (
            items[0] if len(items) == 1 else self._numberwise(items, lambda *numbers: self._phi(into, blocks, numbers))
        )

    def _phi(self, into: ir.Block, blocks: list[ir.Block], numbers: Iterable[Any]) -> Num:
        lifted = [self.emitter.lift(x) for x in numbers]
        kind = max((x.kind for x in lifted), key="bif".index)
        varying = any(x.varying for x in lifted)
        incoming = []
        for block, x in zip(blocks, lifted, strict=True):
            self.builder.position_at_end(block)
            self.fail_if(self.emitter.rounded(x, kind), everywhere=True)
            incoming.append((self.emitter.cast(x, kind, varying), block))
        self.builder.position_at_end(into)
        phi = self.phi(kind, varying)
        phi.mixed = kind == "f" and any(x.kind != "f" or x.mixed for x in lifted)
        for values, block in incoming:
            come_from(phi, values, block)
        return phi

    def phi(self, kind: str, varying: bool) -> Num:
        """A number whose value depends on where control comes from; `come_from` says how."""
        e = self.emitter
        return e.num([self.builder.phi(e.type(kind, varying)) for _ in range(e.registers(varying))])

    def _align_masks(self, opens: list[Open]) -> None:
        """Give every open place the masks that any of them has."""
        if any(ACTIVE in o.env for o in opens) and not all(o.env.get(ACTIVE) is NO_LANE for o in opens):
            for o in opens:
                mask = self.active(o.env)
                o.env[ACTIVE] = self.emitter.constant(True, "b", True) if mask is None else mask
        for name in LEFT:
            if any(name in o.env for o in opens):
                for o in opens:
                    o.env.setdefault(name, False)
        returned = next((o.env[RETURN] for o in opens if RETURN in o.env), None)
        if returned is not None:
            for o in opens:
                o.env.setdefault(RETURN, self.blank(returned))


def leveled(items: list[Any]) -> list[Any]:
    """The values at one level: a number becomes a pair (of derivative, of what it remembers, zero) where it meets one."""
    makers: dict[Any, Any] = {Vec: lambda v: Vec(*v), Mat: lambda v: Mat(*v), tuple: tuple, list: list}
    kind = type(items[0])
    if kind in makers and len(items[0]) and all(type(v) is kind and len(v) == len(items[0]) for v in items):
        return [makers[kind](v) for v in zip(*map(leveled, map(list, zip(*items, strict=True))), strict=True)]
    pairs = [v for v in items if isinstance(v, PAIRS)]
    if pairs and all(isinstance(v, PAIRS) or is_any_number(v) for v in items):
        form = max(pairs, key=lambda v: v.level).form
        if form[0] is Complex and any(form != getattr(v, "form", None) for v in items):
            return items  # its quotients round otherwise than a float's
        parts = [v.parts if isinstance(v, PAIRS) and v.form == form else (v, 0) for v in items]
        # a slope on one way at least; what is remembered on one way only stays 0 on the other
        if form[0] is not Compensated and not all(type(second) is int for _, second in parts):
            zero_slope = at_rest(next(second for _, second in parts if type(second) is not int))
            parts = [(first, zero_slope if type(second) is int else second) for first, second in parts]
        return [paired(form, p) for p in zip(*map(leveled, map(list, zip(*parts, strict=True))), strict=True)]
    return items


def come_from(phi: Num, values: Values, block: ir.Block) -> None:
    """Add the values of a phi for control that comes from this block."""
    for register, value in zip(phi.values, values, strict=True):
        register.add_incoming(value, block)


def _alike(numbers: tuple[Any, ...]) -> bool:
    first = numbers[0]
    return all(
        x is first or (type(x) is type(first) and not isinstance(x, Num) and repr(x) == repr(first)) for x in numbers
    )


def replace(env: Env, new: Env) -> None:
    if new is not env:
        new = dict(new)
        env.clear()
        env.update(new)
