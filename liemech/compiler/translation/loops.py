"""Loops: written out where the number of turns is known, else loops of native code with the
variables they carry.

In lanes `break` switches a lane off until the loop ends, and the loop ends when no lane is active.
"""

from __future__ import annotations

import ast
import dataclasses
from collections.abc import Callable, Iterable
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.classes.layouts import Layout, build, layout_of, leaves
from ...formulas.numbers.bases import is_any_number
from ...formulas.numbers.forms import LinearForm, factors_of, now
from ..driver import is_part_of_driver
from ..machine.stop_checks import StopCheck
from ..numbers.ir_numbers import Num, kind_of
from ..numbers.large_arrays import spans
from .branches import Branches
from .joins import (
    ACTIVE,
    BROKEN,
    CONTINUED,
    LEFT,
    NO_LANE,
    Felt,
    Loop,
    Open,
    Promote,
    Returns,
    Retype,
    come_from,
    leveled,
)
from .scopes import FOUND, HAS_FOUND, Closure, Env, Undefined, breaks, changed_names, changes_lists, has, returns
from .state import Snapshot

UNROLL = 32  # a static loop with more turns than this stays a loop


class Loops(Branches):
    """`for` and `while`, `break` and `continue`."""

    def leave(self, loop: Loop, how: str, env: Env) -> bool:
        """Translate `break` or `continue`: control goes elsewhere, or the running lanes are switched off.  False if control
        never comes behind the statement.
        """
        places = {"break": loop.breaks, "continue": loop.continues}[how]
        if self.state.depth == loop.depth and not loop.masked and ACTIVE not in env:
            places.append(Open(self.builder.block, dict(env)))
            return False
        if loop.dynamic and not loop.masked:
            raise Retype(None)
        # a dynamic loop takes those up again that are not broken
        if how == "break" or not loop.dynamic:
            name = BROKEN if how == "break" else CONTINUED
            env[name] = self.emitter.logic("or_", env.get(name, False), self.everyone(self.active(env)))
        env[ACTIVE] = NO_LANE
        return True

    def written_out(self, turns: Iterable[Callable[[Env], Any]], body: list[ast.stmt], env: Env) -> bool:
        """A loop with a static number of turns; each first sets its variables, or ends the loop by returning False."""
        loop = Loop(dynamic=False, depth=self.state.depth)
        loops, outer = self.frames[-1].loops, {name: env.pop(name) for name in LEFT if name in env}
        loops.append(loop)
        alive = True
        taken = [(stream, stream.taken) for stream in self.streams]
        for begin in turns:
            if begin(env) is False:
                break
            alive = self.block(body, env)
            opens = loop.continues + ([Open(self.builder.block, dict(env))] if alive else [])
            loop.continues = []
            alive = self.join(opens, env)
            self._take_up(CONTINUED, env)
            if not alive or env.get(ACTIVE) is NO_LANE:
                break
        loops.pop()
        if loop.breaks or BROKEN in env:
            for stream, before in taken:
                stream.part_ways(before)
        self._take_up(BROKEN, env)
        alive = self.join(loop.breaks + ([Open(self.builder.block, dict(env))] if alive else []), env)
        env |= outer
        return alive

    def _take_up(self, name: str, env: Env) -> None:
        """Let the lanes that left the turn, or the loop, run again."""
        lanes = env.pop(name, False)
        if lanes is not False and ACTIVE in env:
            env[ACTIVE] = lanes if env[ACTIVE] is NO_LANE else self.emitter.logic("or_", lanes, env[ACTIVE])

    def loop(
        self,
        test: Callable[[Env], Any],
        step: Callable[[Env], None],
        body: list[ast.stmt],
        env: Env,
        counters: tuple[str, ...] = (),
        brief: bool = False,
    ) -> bool:
        """A loop whose number of turns is known at run time only; `test` sees the variables at its
        head, `step` at its end.  brief : it has few turns, and nobody waits for its end.
        """
        changed = {*changed_names(body), *counters}
        for name in changed & env.keys():
            if isinstance(env[name], Undefined):
                del env[name]
        key = self.frames[-1].node, self.emitter.lanes, forms(env), self.active(env) is None
        form = self.loop_forms.get(key, Form(self._parting(body))).copy()
        env |= {name: _grown(env[name], new) for name, new in form.grown.items()}
        while True:
            snapshot = Snapshot(self, env)
            marks = {FOUND, HAS_FOUND} if FOUND in env else set()
            carried = sorted((changed | marks | {*map(has, changed)}) & env.keys())
            try:
                NativeLoop(self, body, env, carried, counters, form, brief).translate(test, step)
                # an int that becomes a float may do so in this call only
                if not any(mixed for *_, mixed in form.types.values()):
                    self.loop_forms[key] = form
                return True
            except Returns as wanted:
                snapshot.restore()
                env |= {FOUND: wanted.blank, HAS_FOUND: False}
                form.types.clear()
            except Promote as wanted:
                snapshot.restore()
                form.grown |= wanted.variables
                env |= {name: _grown(env[name], new) for name, new in wanted.variables.items()}
                form.types.clear()
            except Felt as wanted:
                snapshot.restore()
                form.felt += wanted.forms
                form.types.clear()
            except Retype as wanted:
                snapshot.restore()
                if wanted.number is None:
                    form.masked = True
                else:
                    form.types[wanted.number] = wanted.type

    def _parting(self, body: list[ast.stmt]) -> bool:
        """Whether lanes leave a loop one after the other: where a formula has a `break`.  That of a driver is for all
        of them.
        """
        leaves = breaks(body) or returns(body)
        formula = not all(is_part_of_driver(frame.source.function) for frame in self.frames[1:])
        return self.emitter.lanes > 1 and formula and leaves


@dataclasses.dataclass
class Form:
    """The form of a loop, as far as earlier translations have found it: whether it needs a mask, the types of numbers that
    change them, the variables that change their structure; and of this one the linear forms on which slopes depend.
    """

    masked: bool
    types: dict[int, tuple[str, bool, bool]] = dataclasses.field(default_factory=dict)
    grown: Env = dataclasses.field(default_factory=dict)
    felt: list[LinearForm] = dataclasses.field(default_factory=list)

    def copy(self) -> Form:
        return Form(self.masked, {**self.types}, {**self.grown})


class NativeLoop:
    """One translation of a loop of native code, with a phi at its head for each number that it carries.

    before, head : the blocks before the loop, and of its test.  at_head : the variables there.  masks : those of lanes
    that left loops around.  outer : the lanes for which the loop was entered.
    """

    def __init__(
        self,
        translator: Loops,
        body: list[ast.stmt],
        env: Env,
        carried: list[str],
        counters: tuple[str, ...],
        form: Form,
        brief: bool,
    ) -> None:
        self.translator, self.emitter, self.builder = translator, translator.emitter, translator.builder
        self.frame, self.state = translator.frames[-1], translator.state
        self.body, self.env, self.carried, self.counters = body, env, carried, counters
        self.masked, self.types, self.felt, self.brief = form.masked, form.types, form.felt, brief
        self.before, self.head = self.builder.block, self.builder.append_basic_block()
        self.here, self.outer = translator.active(env), self.state.base
        self.layouts = {name: layout_of(env[name], is_any_number) for name in carried}
        self.phis: list[Num] = []
        self.masks = {n: v for n, v in env.items() if n in (ACTIVE, *LEFT)}
        self.at_head = {n: v for n, v in env.items() if n not in self.masks}

    def translate(self, test: Callable[[Env], Any], step: Callable[[Env], None]) -> None:
        """Translate the loop.  Raises Returns, Promote or Retype, which say in what form to translate it anew."""
        self._enter()
        start, go_on, end_of_head = self._ask(test)
        loop, inside, raises = self._turn()
        opens = loop.continues + ([Open(self.builder.block, inside)] if inside is not None else [])
        inside = dict(self.at_head) if inside is None else inside
        if self.translator.join(opens, inside):
            step(inside)
            if self.stop_check is not None:
                self.stop_check.after_turn(self.translator)
            self._carry(inside)
            self._go_back(inside, *raises)
        self.state.base = self.outer
        self._leave(loop, start, go_on, end_of_head)

    def _enter(self) -> None:
        """The phis at the head, with what the numbers are before the loop."""
        self.entered = now()
        slopes = [x for name in self.carried for x in leaves(self.env[name], self.layouts[name])]
        self.felt += dict.fromkeys(x for x in slopes if isinstance(x, LinearForm) and x not in self.felt)
        for name in self.carried:
            layout, counts = self.layouts[name], name in self.counters
            numbers = [self._at_head(x, counts) for x in leaves(self.env[name], layout)]
            self.at_head[name] = build(layout, iter(numbers))
            self.translator.aliases.meet(name, self.at_head[name], [(self.env[name], self.env)])
        self.active: Any = None
        if self.masked:
            everyone = self.emitter.constant(True, "b", True)
            self.active = self._entering(everyone if self.here is None else self.here)
            self.phis.pop()
        asks = self.state.escapes and not self.brief
        self.stop_check = StopCheck(self.translator, self.before, self.head) if asks else None
        self.builder.position_at_end(self.before)
        self.builder.branch(self.head)
        self.builder.position_at_end(self.head)

    def _at_head(self, x: Any, counts: bool) -> Any:
        """A number at the head; a slope is a linear form in those on which slopes of this loop depend."""
        if not isinstance(x, LinearForm):
            return self._entering(x, counts)
        return LinearForm(*[(self._entering(1.0 if form is x else 0.0), form) for form in self.felt])

    def _entering(self, x: Any, counts: bool = False) -> Num:
        """The phi of a number.  counts : it counts turns, for all lanes at once."""
        t, e = self.translator, self.emitter
        x = e.lift(x)
        # as it nearly always will in the loop
        differs = x.varying or (e.lanes > 1 and not counts and (self.masked or x.kind == "f"))
        kind, varying, mixed = self.types.get(len(self.phis), (x.kind, differs, x.mixed))
        self.builder.position_at_end(self.before)
        t.fail_if(e.rounded(x, kind), everywhere=True)
        value = e.cast(x, kind, varying)
        self.builder.position_at_end(self.head)
        phi = t.phi(kind, varying)
        phi.mixed = mixed
        self.phis.append(phi)
        come_from(phi, value, self.before)
        return phi

    def _ask(self, test: Callable[[Env], Any]) -> tuple[ir.Block, Any, ir.Block]:
        """The test at the head: where a turn starts, whether there is one, and where it is known."""
        self.state.base = self.active if self.masked else self.here
        self.frame.env = self.at_head
        condition = test(self.at_head)
        if isinstance(condition, Num) and condition.varying and not self.masked:
            raise Retype(None)
        self.lanes = self.emitter.logic("and_", self.active, condition) if self.masked else self.here
        go_on = self.emitter.any(self.lanes) if self.masked else condition
        end_of_head, start = self.builder.block, self.builder.append_basic_block()
        self.builder.position_at_end(start)
        return start, go_on, end_of_head

    def _turn(self) -> tuple[Loop, Env | None, tuple[int, int]]:
        """The statements: where they leave the loop, the variables at their end, None if control
        does not come there, and how many places before may raise.
        """
        inside, raises = dict(self.at_head), (self.state.raises, self.state.marks)
        loop = Loop(True, self.state.depth, self.masked)
        self.frame.loops.append(loop)
        self.state.base = self.lanes
        with self.translator.apart(loop=True):
            alive = self.translator.block(self.body, inside)
        self.frame.loops.pop()
        return loop, inside if alive else None, raises

    def _carry(self, inside: Env) -> None:
        """Let the phis get the numbers at the end of a turn."""
        retyped: dict[int, tuple[str, bool, bool]] = {}
        moves: list[tuple[Num, Any, Num]] = []  # of what lies in memory
        grown: Env = {}
        changed: list[str] = []
        phis = enumerate(self.phis)
        for name in self.carried:
            # a mark that is gone: the variable has a value now
            new, old, layout = inside.get(name, True), self.at_head[name], self.layouts[name]
            actual = layout_of(new, is_any_number)
            if isinstance(new, Undefined):
                changed.append(f"`{name}` changes its structure in the loop: {new.reason}")
            elif _grows(self.env[name], new, layout):
                grown[name] = new
            elif actual != layout:
                changed.append(f"`{name}` changes its structure in the loop: from {layout} to {actual}")
            else:
                self._refuse_other_names(name, new, old, inside)
                pairs = [*zip(leaves(new, layout), leaves(old, layout), strict=True)]
                for (x, y), (kind, _, detail) in zip(pairs, spans(layout)):
                    if kind == "place" and x is not y:
                        moves.append((x, detail, next(phis)[1]))
                        continue
                    for k, old_k in self._factors(x, y):
                        i, phi = next(phis)
                        form = self._carry_number(name, k, old_k, phi)
                        if form is not None:
                            retyped[i] = form
        if grown:
            raise Promote(grown)
        if changed:
            raise NotCompilable(changed[0])
        if retyped:
            self.types |= retyped
            raise Retype(next(iter(retyped)), *retyped[next(iter(retyped))])
        if moves:
            places = self.emitter.large.copies_for_next_turn([(x, form) for x, form, _ in moves])
            for place, (*_, phi) in zip(places, moves):
                come_from(phi, place.values, self.builder.block)

    def _factors(self, x: Any, y: Any) -> list[tuple[Any, Any]]:
        """A number at the end of a turn and at its beginning; of a slope the factors of the forms on which it depends."""
        if not isinstance(y, LinearForm):
            return [(x, y)]
        new, old = factors_of(self.translator.settled(x, self.entered, self.felt)), factors_of(y)
        others = [form for form in new if form not in self.felt]
        if others:
            raise Felt(others)
        return [(new.get(form, 0.0), old[form]) for form in self.felt]

    def _refuse_other_names(self, name: str, new: Any, old: Any, inside: Env) -> None:
        """Refuse a list that has another name at the end of a turn, where lists are changed."""
        # the variables of a turn alone have no value in the next one
        carried = {n: v for n, v in inside.items() if n in self.at_head}
        if self.translator.aliases.meet(name, old, [(new, carried)]) and changes_lists(self.body, inside):
            copy = f", `[*{name}]`" if isinstance(new, list) else " of these lists"
            raise NotCompilable(
                f"`{name}` has another name at the end of a turn of a loop that changes lists in "
                f"place: let it be a copy{copy}"
            )

    def _carry_number(self, name: str, x: Any, y: Num, phi: Num) -> tuple[str, bool, bool] | None:
        """Let a phi get x, the number at the end of a turn, where y is that at its beginning; the type that the phi
        should have, if its own does not fit.
        """
        e = self.emitter
        alone = self.masked and x is not y and not (name in self.counters and not phi.varying)
        leaf = e.lift(e.select(self.lanes, x, y) if alone else x)
        kind = max(leaf.kind, phi.kind, key="bif".index)
        varying = leaf.varying or phi.varying
        mixed = kind == "f" and (leaf.kind != "f" or phi.kind != "f" or leaf.mixed or phi.mixed)
        if (kind, varying, mixed) != (phi.kind, phi.varying, phi.mixed):
            return kind, varying, mixed
        self.translator.fail_if(e.rounded(leaf, kind), everywhere=True)
        come_from(phi, e.cast(leaf, kind, varying), self.builder.block)
        return None

    def _go_back(self, inside: Env, raises: int, marks: int) -> None:
        """Let control go from the end of a turn to the head, with the lanes that are still in the loop."""
        e, b, state = self.emitter, self.builder, self.state
        if self.masked:
            broken = inside.get(BROKEN, False)
            # a lane that has failed might never end
            if state.raises - raises > (state.marks - marks if self.counters else 0):
                broken = e.logic("or_", broken, e.load(state.failed))
            lanes = e.logic("and_", self.lanes, e.negation(broken))
            come_from(self.active, e.cast(lanes, "b", True), b.block)
        if self.stop_check is not None:
            self.stop_check.again(b.block)
        # what has failed everywhere might never end
        if state.raises > raises and not self.masked and not self.counters:
            going, given_up = e.any(e.negation(e.load(state.failed))), b.append_basic_block()
            b.cbranch(going.value, self.head, given_up)
            state.escapes[-1].append(Open(given_up, {}))
        else:
            b.branch(self.head)

    def _leave(self, loop: Loop, start: ir.Block, go_on: Any, end_of_head: ir.Block) -> None:
        """Join the ways out of the loop."""
        b, env, exits = self.builder, self.env, list(loop.breaks)
        local = changed_names(self.body) - env.keys()
        b.position_at_end(end_of_head)
        if isinstance(go_on, Num):
            into = lambda done: b.cbranch(go_on.value, start, done)  # noqa: E731
            exits.insert(0, Open(end_of_head, self.at_head, into))
        else:
            b.branch(start)
        if not exits:
            raise NotCompilable("the loop never ends: no `break` is reached")
        for o in exits:
            for name in (ACTIVE, *LEFT):
                o.env.pop(name, None)
        self.translator.join(exits, env, b.append_basic_block() if len(exits) == 1 else None)
        env |= self.masks
        for name in local:
            env[name] = Undefined("it gets one inside the loop only, which may have no turn: give it a value before")


def _grown(value: Any, new: Any) -> Any:
    """The value with numbers made pairs where `new` has pairs."""
    return leveled([value, new])[0]


def _grows(value: Any, new: Any, layout: Layout) -> bool:
    """Whether a value of this layout must be made anew with pairs, or with a float for an int, to become the new one."""
    first, now = leveled([value, new])
    if layout_of(now, is_any_number) != layout_of(first, is_any_number):
        return False
    if layout_of(first, is_any_number) != layout:
        return True
    old, floats = leaves(value, layout), leaves(first, layout)
    return any(
        isinstance(y, LinearForm)
        if isinstance(y, LinearForm) is not isinstance(x, LinearForm)
        else type(x) is int and type(y) is float and kind_of(z) == "f"
        for x, y, z in zip(old, floats, leaves(now, layout), strict=True)
    )


def forms(env: Env) -> Any:
    """The form of variables, on which the translation of a loop may depend: their structure, the kinds of their
    numbers, and the integers and truth values known now, which decide about branches.
    """
    return tuple([(name, _form(value)) for name, value in env.items()])


def _form(value: Any) -> Any:
    if isinstance(value, (Undefined, Closure)):
        return value.node if isinstance(value, Closure) else None
    layout = layout_of(value, is_any_number)
    return layout, tuple(
        [
            (x.kind, x.varying, x.mixed) if isinstance(x, Num) else (type(x), x if isinstance(x, int) else None)
            for x in leaves(value, layout)
        ]
    )
