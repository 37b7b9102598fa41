"""Which calls of formulas are written out, and which call a native function made of the formula.

Small kernels are written out whole.  Once a native function has grown long, a formula that has cost
much in it, called again with arguments of the same form, becomes a function of its own: what is
known while translating (classes, integers, texts, tableaus) is built into it, numbers are passed.
Both ways give the same bits.

The thresholds were tried out on the table of `tests/benchmarks/compile_time.py`: the shortest compilation whose steps are
not longer.  What half and twice of each would do, `tests/benchmarks/thresholds.py` measures and
docs/proof/measured/compile_time.md has.
"""

from __future__ import annotations

import contextlib
import inspect
import math
from collections.abc import Iterator
from typing import Any

from ...errors import NotCompilable
from ...formulas.classes.layouts import Layout
from ..numbers.large_arrays import spans
from . import state
from .call_forms import Call, CallForms
from .instructions import Growing, TooLong
from .native_functions import NativeFunction, NativeFunctions, Small
from .scopes import CallFrame, bound
from .state import Snapshot

LONG = 2500
"""Instructions up to which everything is written out, in each native function."""

WORTH = 600
"""Instructions that calls of one form must have cost in a native function before the formula becomes a function."""

LARGE = 120
"""Formulas of fewer instructions are always written out."""

SLACK = 1.25
"""Writing out is given up at SLACK times HUGE instructions, some of which might have been taken back later; the
innermost formula of HUGE/SLACK becomes a function.
"""

ALONE = 5
"""The factor by which the kernel of a single body, not the functions that it calls, may write out more: there a call
costs most.
"""

WHOLE = 3
"""The factor by which formulas may be larger that the kernel of an ensemble writes out."""

COPIED = 60
"""Instructions from which a formula that is written out is translated once for all calls of one
form: LLVM copies it.
"""

PER_NUMBER = 4
"""More instructions for each number that the formula is given."""

WIDE = 64
"""Numbers of a state from which ALONE and WHOLE are 1.  Without it steps of LieRATTLE (three links) take 1.4 times as long,
the median of three, those of RKMK4 (SO(7), SO(8), 40 masses in a row) 0.94 to 1.01 of their time.
"""

WIDEST = 1000
"""Numbers of a state from which nothing is compiled: RKMK4 has 60 (40 masses in a row) to 330 (SO(7)) instructions a
number, so that hardly any method would stay below LIMIT, and to find that takes seconds.
"""


class Outliner:
    """Decides which calls are written out and which call a native function."""

    def __init__(self, translator: Any) -> None:
        self.translator, self.emitter = translator, translator.emitter
        self.forms = CallForms(translator)
        self.functions = NativeFunctions(translator, self.forms)
        # by the form of the call: its native function; None: it must be written out
        self.natives: dict[Any, NativeFunction | None] = {}
        # by the form of the call: the function that LLVM copies; None after the first call; False: it cannot be copied
        self.copies: dict[Any, NativeFunction | bool | None] = {}
        # formulas: those of which a call had LARGE instructions, and more than COPIED beside its numbers; those that
        # are never written out, and those that always are, for sites meet in them
        self.costly: set[Any] = set()
        self.worth_copying: set[Any] = set()
        self.too_large: set[Any] = set()
        self.with_meetings: set[Any] = set()
        # in lanes a formula has as many instructions more as its numbers take registers
        single = self.emitter.lanes == 1
        translator.state.patience = ALONE if single else self.emitter.registers(True)
        translator.state.huge = (ALONE if single else WHOLE) * state.HUGE

    def fitting(self, layout: Layout) -> Layout:
        """The layout of a state, refused if it is too wide.  Raises TooLong."""
        width = sum(kind != "large" for kind, *_ in spans(layout))
        if width > WIDEST:
            raise TooLong(
                f"the native code would be too long: a state of {layout.width} numbers, more than "
                f"{WIDEST}, takes more than about ten seconds to make. Take a smaller group, leave "
                "out what is not needed (the element g), or compiled=False"
            )
        if width > WIDE:
            self.translator.state.patience, self.translator.state.huge = 1, state.HUGE
        return layout

    def enter(self, frame: CallFrame) -> Any:
        """The value of a call, as a native function or written out."""
        t = self.translator
        if not t.frames:
            return t.enter(frame)
        function, env = frame.source.function, dict(frame.env)
        if function in self.with_meetings:
            return self._written_out(frame, env)
        often = function in self.costly and self.emitter.builder.emitted >= LONG * t.state.patience
        call = self.forms.call_of(function, env) if often or function in self.too_large else None
        if call and not often:
            return self._as_function(call, frame, env)
        key, general = self._form_of_function(call) if call else (None, False)
        if call and key:
            native = self.natives.get(key) or self.make(key, call, frame, env, general)
            if native is not None:
                return self.functions.emit(native, call, general)
        return self._within_limit(frame, env)

    def divide(self) -> None:
        """Write out all formulas around this place, however large: sites meet here."""
        t = self.translator
        self.with_meetings |= {frame.source.function for frame in t.frames}
        t.state.begun[:] = [math.inf for _ in t.state.begun]
        self.emitter.builder.room = math.inf

    def of_all_sites(self, formula: Any, args: tuple[Any, ...], within: Any) -> None:
        """A call of the native function of a formula that runs once for all sites, made at its first call of this form."""
        source = self.translator.reads.source(formula)
        env = bound(inspect.signature(formula), source.name, args, {})
        call = self.forms.call_of(formula, env)
        if call is None:
            raise NotCompilable(
                "what runs once for all sites, of an argument that is no number, record or place of sites"
            )
        native = self.natives.get(call.known)
        if native is None:
            name, frame = f"{formula.__name__}.{len(self.natives)}", CallFrame(source, source.node, env)
            native = self.natives[call.known] = self.functions.make(name, call, frame, env, False, 0, False, within)
        self.functions.emit(native, call, False)  # type: ignore[arg-type]

    def _within_limit(self, frame: CallFrame, env: dict[str, Any]) -> Any:
        """The value of a call, written out unless the formula turns out to be too large, else as a native function."""
        t, b, function = self.translator, self.emitter.builder, frame.source.function
        snapshot, before, spent = Snapshot(t, t.frames[-1].env), b.emitted, t.state.spent
        counted = [before]
        try:
            with self._limit(counted):
                result = self._copy(frame, env)
            large = b.emitted - counted[0] >= t.state.huge
        except Growing:
            large = b.emitted - counted[0] >= t.state.huge / SLACK
            if not large:
                raise
        cost = b.emitted - before
        if function in self.with_meetings:
            return result
        if large:  # it becomes a function
            snapshot.restore()
            self.too_large.add(function)
            call = self.forms.call_of(function, env)
            return self._as_function(call, frame, env) if call else self._written_out(frame, env)
        if cost >= LARGE and spent is t.state.spent:
            self.costly.add(function)
            call = self.forms.call_of(function, env)
            if call:
                forms = dict.fromkeys((call.known, call.general))
                spent += [(form, cost) for form in forms]
        return result

    def _as_function(self, call: Call, frame: CallFrame, env: dict[str, Any]) -> Any:
        """The value of a call of a formula that is too large to be written out, as a native function if it can be one."""
        for key, general in ((call.general, True), (call.known, False)):
            if key not in self.natives:
                self.make(key, call, frame, env, general, WORTH)
            native = self.natives[key]
            if native is not None:
                return self.functions.emit(native, call, general)
        return self._written_out(frame, env)

    def _copy(self, frame: CallFrame, env: dict[str, Any]) -> Any:
        """The value of a call that is written out; from the second call of a form on LLVM makes the copy."""
        function, b = frame.source.function, self.emitter.builder
        call = self.forms.call_of(function, env) if function in self.worth_copying else None
        if call and call.known in self.copies:
            copy = self.copies[call.known]
            if copy is None:
                copy = self.make(("copy", call.known), call, frame, env, False, 0, True) or False
                self.copies[call.known] = copy
            if isinstance(copy, NativeFunction):
                before, result = b.emitted, self.functions.emit(copy, call, False)
                b.emitted = before
                b.grow(copy.size)
                self.translator.state.spent += copy.spent
                return result
        before = b.emitted
        result = self.translator.enter(frame)
        cost = b.emitted - before
        if cost >= COPIED:
            call = call or self.forms.call_of(function, env)
            if call and cost >= COPIED + PER_NUMBER * len(call.numbers):
                self.worth_copying.add(function)
                self.copies.setdefault(call.known)
        return result

    def _written_out(self, frame: CallFrame, env: dict[str, Any]) -> Any:
        """The value of a call written out, however large; its instructions do not count for the formulas around."""
        b, starts, room = self.emitter.builder, self.translator.state.begun, self.emitter.builder.room
        self.translator.state.begun, b.room, before = [], math.inf, b.emitted
        try:
            return self.translator.enter(CallFrame(frame.source, frame.scope, env))
        finally:
            starts[:] = [x + b.emitted - before for x in starts]
            self.translator.state.begun, b.room = starts, room + b.emitted - before

    @contextlib.contextmanager
    def _limit(self, counted: list[float]) -> Iterator[None]:
        """Inside, a formula raises Growing where it becomes huge.

        counted : the count of instructions at which it begins; afterwards that from which it counts, without formulas in
        it that had to be written out: to write it out again would write them out again.
        """
        starts, b = self.translator.state.begun, self.emitter.builder
        starts.append(counted[0])
        b.room = starts[0] + SLACK * self.translator.state.huge
        try:
            yield
        finally:
            counted[0] = starts.pop()
            b.room = starts[0] + SLACK * self.translator.state.huge if starts else math.inf

    def _form_of_function(self, call: Call) -> tuple[Any, bool]:
        """The form in which a call is one of a native function, and whether it is the general one; None for neither."""
        specific, general = self._cost(call.known), self._cost(call.general)
        for key, is_general, worth in ((call.general, True, general > specific), (call.known, False, True)):
            if self.natives.get(key) is not None:
                return key, is_general
            if worth and key not in self.natives and (general if is_general else specific) >= WORTH:
                return key, is_general
        return None, False

    def _cost(self, key: Any) -> int:
        """The instructions that calls of a form have cost in the present native function."""
        return sum(cost for k, cost in self.translator.state.spent if k == key)

    def make(
        self,
        key: Any,
        call: Call,
        frame: CallFrame,
        env: dict[str, Any],
        general: bool,
        least: int = 0,
        copied: bool = False,
    ) -> NativeFunction | None:
        """The native function of a formula, for calls of this form; None if calls must be written out."""
        name = f"{frame.source.function.__name__}.{len(self.natives)}"
        try:
            native = self.functions.make(name, call, frame, env, general, least, copied)
        except Small:
            native = None
            self.natives.setdefault(call.known)
        self.natives[key] = native
        return native
