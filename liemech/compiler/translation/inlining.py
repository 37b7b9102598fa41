"""Which calls of formulas are written out, and which call a native function made of the formula.

Small kernels are written out whole.  Once a native function has grown long, a formula that has cost
much in it, called again with arguments of the same form, becomes a function of its own: what is
known while translating (classes, integers, texts, tableaus) is built into it, numbers are passed.
Both ways give the same bits.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import Any

from ...formulas.classes.pytree import Layout
from ..numbers.large_arrays import spans
from . import state
from .call_forms import Call, CallForms
from .instructions import Growing, TooLong
from .native_functions import NativeFunction, NativeFunctions, Small
from .scopes import CallFrame
from .state import Snapshot

LONG = 2500
"""Instructions up to which everything is written out, in each native function."""

WORTH = 600
"""Instructions that a formula must have cost in a native function before it becomes one of its own."""

LARGE = 120
"""Formulas of fewer instructions are always written out."""

SLACK, MOST = 1.25, 0.8
"""Writing out is given up when so many times HUGE have been emitted, some of which might have been
taken back later; the innermost formula that has this part of HUGE becomes a function.
"""

ALONE = 5
"""The kernel of a single body, not the functions that it calls, may write out so many times more:
there a call costs most.
"""

WHOLE = 3
"""The kernel of an ensemble may write out formulas that are so many times larger."""

COPIED = 60
"""Instructions from which a formula that is written out is translated once for all calls of one
form: LLVM copies it.
"""

PER_NUMBER = 4
"""More instructions for each number that the formula is given."""

WIDE = 64
"""Numbers of a state from which this is no longer so: the formulas of large groups take much longer
than a call.
"""

WIDEST = 1000
"""Numbers of a state from which nothing is compiled: to carry so many in registers takes too long
to make.
"""


class Outliner:
    """Decides which calls are written out and which call a native function."""

    def __init__(self, translator: Any) -> None:
        self.t, self.e = translator, translator.emitter
        self.forms = CallForms(translator)
        self.functions = NativeFunctions(translator, self.forms)
        self.large: set[Any] = set()  # formulas that have been large
        self.made: dict[Any, NativeFunction | None] = {}  # None: it has to be written out
        self.copied: set[Any] = set()  # formulas of which some call was worth a copy
        # by form of the call, what LLVM copies; None: there was one call; False: it has no copies
        self.copies: dict[Any, NativeFunction | bool | None] = {}
        self.grown: set[Any] = set()  # formulas that were too large to be written out
        self.divided: set[Any] = set()  # formulas in which sites meet, which are always written out
        # in lanes a formula has as many instructions more as its numbers take registers
        single = self.e.lanes == 1
        translator.state.patience = ALONE if single else self.e.registers(True)
        translator.state.huge = (ALONE if single else WHOLE) * state.HUGE

    def fitting(self, layout: Layout) -> Layout:
        """The layout of a state, refused if it is too wide.  Raises TooLong."""
        width = sum(kind != "large" for kind, *_ in spans(layout)) if layout.in_memory else layout.width
        if width > WIDEST:
            raise TooLong(
                f"the native code would be too long: a state of {layout.width} numbers, more than "
                f"{WIDEST}, takes more than about ten seconds to make. Take a smaller group, leave "
                "out what is not needed (the element g), or compiled=False"
            )
        if width > WIDE:
            self.t.state.patience, self.t.state.huge = 1, state.HUGE
        return layout

    def enter(self, frame: CallFrame) -> Any:
        """The value of a call, made here or written out."""
        t = self.t
        if not t.frames:
            return t.enter(frame)
        function, env = frame.source.function, dict(frame.env)
        if function in self.divided:
            return self._written_out(frame, env)
        often = function in self.large and self.e.builder.emitted >= LONG * t.state.patience
        call = self.forms.call_of(function, env) if often or function in self.grown else None
        if call and not often:
            return self._grown(call, frame, env)
        key, general = self._chosen(call) if call else (None, False)
        if call and key:
            native = self.made.get(key) or self.make(key, call, frame, env, general)
            if native is not None:
                return self.functions.emit(native, call, general)
        return self._tried(frame, env)

    def divide(self) -> None:
        """Sites meet here: all formulas around are written out, however large."""
        t = self.t
        self.divided |= {frame.source.function for frame in t.frames}
        t.state.begun[:] = [math.inf for _ in t.state.begun]
        self.e.builder.room = math.inf

    def _tried(self, frame: CallFrame, env: dict[str, Any]) -> Any:
        """The value of a call that is written out, unless it turns out to be too large for it."""
        t, b, function = self.t, self.e.builder, frame.source.function
        snapshot, before, spent = Snapshot(t, t.frames[-1].env), b.emitted, t.state.spent
        try:
            with self._limited(before):
                result = self._copy(frame, env)
            large = b.emitted - before >= t.state.huge
        except Growing:
            large = b.emitted - before >= MOST * t.state.huge
            if not large:
                raise
        cost = b.emitted - before
        if function in self.divided:
            return result
        if large:  # it becomes a function
            snapshot.restore()
            self.grown.add(function)
            call = self.forms.call_of(function, env)
            return self._grown(call, frame, env) if call else self._written_out(frame, env)
        if cost >= LARGE and spent is t.state.spent:
            self.large.add(function)
            call = self.forms.call_of(function, env)
            if call:
                forms = dict.fromkeys((call.known, call.general))
                spent += [(form, cost) for form in forms]
        return result

    def _grown(self, call: Call, frame: CallFrame, env: dict[str, Any]) -> Any:
        """The value of a call of a formula that has been too large to be written out."""
        for key, general in ((call.general, True), (call.known, False)):
            if key not in self.made:
                self.make(key, call, frame, env, general, WORTH)
            native = self.made[key]
            if native is not None:
                return self.functions.emit(native, call, general)
        return self._written_out(frame, env)

    def _copy(self, frame: CallFrame, env: dict[str, Any]) -> Any:
        """The value of a call that is written out; from the second call of one form on as a copy,
        which LLVM makes.
        """
        function, b = frame.source.function, self.e.builder
        call = self.forms.call_of(function, env) if function in self.copied else None
        if call and call.known in self.copies:
            copy = self.copies[call.known]
            if copy is None:
                copy = self.make(("copy", call.known), call, frame, env, False, 0, True) or False
                self.copies[call.known] = copy
            if isinstance(copy, NativeFunction):
                before, result = b.emitted, self.functions.emit(copy, call, False)
                b.emitted = before
                b.grow(copy.size)
                self.t.state.spent += copy.spent
                return result
        before = b.emitted
        result = self.t.enter(frame)
        cost = b.emitted - before
        if cost >= COPIED:
            call = call or self.forms.call_of(function, env)
            if call and cost >= COPIED + PER_NUMBER * len(call.numbers):
                self.copied.add(function)
                self.copies.setdefault(call.known)
        return result

    def _written_out(self, frame: CallFrame, env: dict[str, Any]) -> Any:
        """The value of a call that has to be written out, however large: what is around it does not
        count that.
        """
        b, starts, room = self.e.builder, self.t.state.begun, self.e.builder.room
        self.t.state.begun, b.room, before = [], math.inf, b.emitted
        try:
            return self.t.enter(CallFrame(frame.source, frame.scope, env))
        finally:
            starts[:] = [x + b.emitted - before for x in starts]
            self.t.state.begun, b.room = starts, room + b.emitted - before

    @contextlib.contextmanager
    def _limited(self, begin: int) -> Iterator[None]:
        """Raises Growing where the formula that is being written out becomes huge."""
        starts, b = self.t.state.begun, self.e.builder
        starts.append(begin)
        b.room = starts[0] + SLACK * self.t.state.huge
        try:
            yield
        finally:
            starts.pop()
            b.room = starts[0] + SLACK * self.t.state.huge if starts else math.inf

    def _chosen(self, call: Call) -> tuple[Any, bool]:
        """The form in which a call becomes one of a function, and whether it is the general one;
        None for neither.
        """
        specific, general = self._cost(call.known), self._cost(call.general)
        for key, is_general, worth in ((call.general, True, general > specific), (call.known, False, True)):
            if self.made.get(key) is not None:
                return key, is_general
            if worth and key not in self.made and (general if is_general else specific) >= WORTH:
                return key, is_general
        return None, False

    def _cost(self, key: Any) -> int:
        return sum(cost for k, cost in self.t.state.spent if k == key)

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
        """The native function of a formula, for calls of this form; None if it must be written out."""
        name = f"{frame.source.function.__name__}.{len(self.made)}"
        try:
            native = self.functions.make(name, call, frame, env, general, least, copied)
        except Small:
            native = None
            self.made.setdefault(call.known)
        self.made[key] = native
        return native
