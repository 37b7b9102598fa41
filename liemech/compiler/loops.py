"""Loops: written out where the number of turns is known, else loops of native code with the
variables they carry.

In lanes `break` switches a lane off until the loop ends, and the loop ends when no lane is active.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable
from typing import Any

from ..errors import NotCompilable
from ..formulas.pytree import Layout, build, is_any_number, layout_of, leaves
from ..formulas.taken_back import back
from .branches import Branches
from .ir_numbers import Num, kind_of
from .joins import (
    ACTIVE,
    BROKEN,
    CONTINUED,
    LEFT,
    NO_LANE,
    Loop,
    Open,
    Promote,
    Returns,
    Retype,
    come_from,
    leveled,
)
from .scopes import (
    FOUND,
    HAS_FOUND,
    Closure,
    Env,
    Undefined,
    breaks,
    changed_names,
    changes_lists,
    has,
    returns,
)
from .stop_checks import Look

UNROLL = 32  # a static loop with more turns than this stays a loop


class Loops(Branches):
    """`for` and `while`, `break` and `continue`."""

    def leave(self, loop: Loop, how: str, env: Env) -> bool:
        """`break` or `continue`: control goes elsewhere, or the lanes running here are switched
        off.
        """
        places = {"break": loop.breaks, "continue": loop.continues}[how]
        if self.depth == loop.depth and not loop.masked and ACTIVE not in env:
            places.append(Open(self.builder.block, dict(env)))
            return False
        if loop.dynamic and not loop.masked:
            raise Retype(None)
        # a dynamic loop takes those up again that are not broken
        if how == "break" or not loop.dynamic:
            name = BROKEN if how == "break" else CONTINUED
            env[name] = self.emitter.logic(
                "or_", env.get(name, False), self.everyone(self.active(env))
            )
        env[ACTIVE] = NO_LANE
        return True

    def written_out(
        self, turns: Iterable[Callable[[Env], Any]], body: list[ast.stmt], env: Env
    ) -> bool:
        """A loop with a static number of turns; each first sets its variables, or ends the loop by
        returning False.
        """
        loop = Loop(dynamic=False, depth=self.depth)
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
        alive = self.join(
            loop.breaks + ([Open(self.builder.block, dict(env))] if alive else []), env
        )
        env |= outer
        return alive

    def _take_up(self, name: str, env: Env) -> None:
        """Lanes that left the turn or the loop run again."""
        lanes = env.pop(name, False)
        if lanes is not False and ACTIVE in env:
            env[ACTIVE] = (
                lanes if env[ACTIVE] is NO_LANE else self.emitter.logic("or_", lanes, env[ACTIVE])
            )

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
        for name in {*changed_names(body), *counters} & env.keys():
            if isinstance(env[name], Undefined):
                del env[name]
        changed = {*changed_names(body), *counters}
        form = self.frames[-1].node, forms(env), self.active(env) is None
        masked, types, grown = self.loop_forms.get(form, (self._parting(body), {}, {}))
        types, grown = dict(types), dict(grown)
        env |= {name: _grown(env[name], new) for name, new in grown.items()}
        while True:
            forget = self.mark()
            marks = {FOUND, HAS_FOUND} if FOUND in env else set()
            carried = sorted((changed | marks | {*map(has, changed)}) & env.keys())
            try:
                going_on = self._loop(
                    test, step, body, env, carried, types, masked, counters, brief
                )
                # an int that becomes a float may do so in this call only
                if not any(mixed for *_, mixed in types.values()):
                    self.loop_forms[form] = masked, types, grown
                return going_on
            except Returns as wanted:
                forget()
                env |= {FOUND: wanted.blank, HAS_FOUND: False}
                types.clear()
            except Promote as wanted:
                forget()
                grown |= wanted.variables
                env |= {name: _grown(env[name], new) for name, new in wanted.variables.items()}
                types.clear()
            except Retype as wanted:
                forget()
                if wanted.number is None:
                    masked = True
                else:
                    types[wanted.number] = wanted.type

    def _parting(self, body: list[ast.stmt]) -> bool:
        """Will lanes leave a loop one after the other?  Where a formula has a `break`; that of a
        driver is for all of them.
        """
        leaves = breaks(body) or returns(body)
        return self.emitter.lanes > 1 and len(self.frames) > 1 and leaves

    def mark(self) -> Callable[[], None]:
        """A way back to this point: undoes everything emitted since, so that it can be translated
        in another way.
        """
        b, function, frame = self.builder, self.builder.function, self.frames[-1]
        block, instructions, blocks = b.block, len(b.block.instructions), len(function.blocks)
        lists: list[list[Any]] = [
            self.frames,
            frame.loops,
            frame.returns,
            self.escapes,
            *self.escapes,
            self.outliner.spent,
        ]
        lengths = [len(items) for items in lists]
        state = self.base, self.depth, self.raises, self.marks, self.region, frame.env, frame.node
        attempts, take_back = (self.failed, self.outcome), back()
        taken, emitted = (
            [(stream, stream.taken, stream.region) for stream in self.streams],
            b.emitted,
        )

        def forget() -> None:
            take_back()
            for items, length in zip(lists, lengths, strict=True):
                del items[length:]
            del function.blocks[blocks:], block.instructions[instructions:]
            block.terminator, b.emitted = None, emitted
            self.base, self.depth, self.raises, self.marks, self.region, frame.env, frame.node = (
                state
            )
            self.failed, self.outcome = attempts
            for stream, before, region in taken:
                stream.back_to(before, region)
            b.position_at_end(block)

        return forget

    def _loop(
        self,
        test: Callable[[Env], Any],
        step: Callable[[Env], None],
        body: list[ast.stmt],
        env: Env,
        carried: list[str],
        types: dict[int, tuple[str, bool, bool]],
        masked: bool,
        counters: tuple[str, ...],
        brief: bool,
    ) -> bool:
        e, b, frame = self.emitter, self.builder, self.frames[-1]
        before, head, outer = b.block, b.append_basic_block(), self.base
        here = self.active(env)
        layouts = {name: layout_of(env[name], is_any_number) for name in carried}
        phis: list[Num] = []

        def entering(x: Any, counts: bool = False) -> Num:
            x = e.lift(x)
            # as it nearly always will in the loop; the turns are counted for all lanes at once
            differs = x.varying or (e.lanes > 1 and not counts and (masked or x.kind == "f"))
            kind, varying, mixed = types.get(len(phis), (x.kind, differs, x.mixed))
            b.position_at_end(before)
            self.fail_if(e.rounded(x, kind), everywhere=True)
            value = e.cast(x, kind, varying)
            b.position_at_end(head)
            phis.append(self.phi(kind, varying))
            phis[-1].mixed = mixed
            come_from(phis[-1], value, before)
            return phis[-1]

        masks = {n: v for n, v in env.items() if n in (ACTIVE, *LEFT)}
        at_head = {n: v for n, v in env.items() if n not in masks}
        for name in carried:
            at_head[name] = build(
                layouts[name],
                iter([entering(x, name in counters) for x in leaves(env[name], layouts[name])]),
            )
            self.aliases.meet(name, at_head[name], [(env[name], env)])
        active: Any = None
        if masked:
            active = entering(e.constant(True, "b", True) if here is None else here)
            phis.pop()
        look = None if brief or not self.escapes else Look(self, before, head)
        b.position_at_end(before)
        b.branch(head)
        b.position_at_end(head)

        self.base, frame.env = active if masked else here, at_head
        wanted = test(at_head)
        if isinstance(wanted, Num) and wanted.varying and not masked:
            raise Retype(None)
        lanes = e.logic("and_", active, wanted) if masked else here
        go_on = e.any(lanes) if masked else wanted
        head_end, start = b.block, b.append_basic_block()
        b.position_at_end(start)
        inside = dict(at_head)
        loop, raises, marks = Loop(True, self.depth, masked), self.raises, self.marks
        frame.loops.append(loop)
        self.base = lanes
        with self.apart(loop=True):
            alive = self.block(body, inside)
        frame.loops.pop()
        if self.join(loop.continues + ([Open(b.block, inside)] if alive else []), inside):
            step(inside)
            if look is not None:
                look.after_turn(self)
            index, retyped = 0, {}
            grown: Env = {}
            changed: list[str] = []
            for name in carried:
                # a mark that is gone: the variable has a value now
                new, old = inside.get(name, True), at_head[name]
                layout = layout_of(new, is_any_number)
                if not isinstance(new, Undefined) and _grows(env[name], new, layouts[name]):
                    grown[name] = new
                    continue
                if isinstance(new, Undefined) or layout != layouts[name]:
                    what = (
                        new.reason
                        if isinstance(new, Undefined)
                        else f"from {layouts[name]} to {layout}"
                    )
                    changed.append(f"`{name}` changes its structure in the loop: {what}")
                    continue
                # the variables of a turn alone have no value in the next one
                kept = {n: v for n, v in inside.items() if n in at_head}
                if self.aliases.meet(name, old, [(new, kept)]) and changes_lists(body, inside):
                    raise NotCompilable(
                        f"`{name}` has another name at the end of a turn of a loop that changes "
                        f"lists in place: let it be a copy{f', `[*{name}]`' if isinstance(new, list) else ' of these lists'}"
                    )
                for x, y in zip(leaves(new, layout), leaves(old, layout), strict=True):
                    phi = phis[index]
                    alone = masked and x is not y and not (name in counters and not phi.varying)
                    leaf = e.lift(e.select(lanes, x, y) if alone else x)
                    kind = max(leaf.kind, phi.kind, key="bif".index)
                    varying = leaf.varying or phi.varying
                    mixed = kind == "f" and (
                        leaf.kind != "f" or phi.kind != "f" or leaf.mixed or phi.mixed
                    )
                    if (kind, varying, mixed) != (phi.kind, phi.varying, phi.mixed):
                        retyped[index] = kind, varying, mixed
                    else:
                        self.fail_if(e.rounded(leaf, kind), everywhere=True)
                        come_from(phi, e.cast(leaf, kind, varying), b.block)
                    index += 1
            if grown:
                raise Promote(grown)
            if changed:
                raise NotCompilable(changed[0])
            if retyped:
                types |= retyped
                raise Retype(next(iter(retyped)), *retyped[next(iter(retyped))])
            if masked:
                broken = inside.get(BROKEN, False)
                # a lane that has failed might never end
                if self.raises - raises > (self.marks - marks if counters else 0):
                    broken = e.logic("or_", broken, e.load(self.failed))
                come_from(
                    active, e.cast(e.logic("and_", lanes, e.negation(broken)), "b", True), b.block
                )
            if look is not None:
                look.again(b.block)
            # what has failed everywhere might never end
            if self.raises > raises and not masked and not counters:
                going, given_up = e.any(e.negation(e.load(self.failed))), b.append_basic_block()
                b.cbranch(going.value, head, given_up)
                self.escapes[-1].append(Open(given_up, {}))
            else:
                b.branch(head)
        self.base = outer
        exits = list(loop.breaks)
        local = changed_names(body) - env.keys()
        b.position_at_end(head_end)
        if isinstance(go_on, Num):
            exits.insert(
                0, Open(head_end, at_head, lambda into: b.cbranch(go_on.value, start, into))
            )
        else:
            b.branch(start)
        if not exits:
            raise NotCompilable("the loop never ends: no `break` is reached")
        for o in exits:
            for name in (ACTIVE, *LEFT):
                o.env.pop(name, None)
        self.join(exits, env, b.append_basic_block() if len(exits) == 1 else None)
        env |= masks
        for name in local:
            env[name] = Undefined(
                "it gets one inside the loop only, which may have no turn: give it a value before"
            )
        return True


def _grown(value: Any, new: Any) -> Any:
    """A value with the structure that it has later, its numbers made pairs as those of the new one."""
    return leveled([value, new])[0]


def _grows(value: Any, new: Any, layout: Layout) -> bool:
    """Does a value of this layout need another structure, to become the new one: a derivative where
    it has none, not even a zero?
    """
    first, now = leveled([value, new])
    if layout_of(now, is_any_number) != layout_of(first, is_any_number):
        return False
    if layout_of(first, is_any_number) != layout:
        return True
    old, floats = leaves(value, layout), leaves(first, layout)
    return any(
        type(x) is int and type(y) is float and kind_of(z) == "f"
        for x, y, z in zip(old, floats, leaves(now, layout), strict=True)
    )


def forms(env: Env) -> Any:
    """What a loop's translation may depend on in the variables: their structure, the kinds of their
    numbers, and the integers and truth values known now, which decide about branches.
    """
    return tuple([(name, _form(value)) for name, value in env.items()])


def _form(value: Any) -> Any:
    if isinstance(value, (Undefined, Closure)):
        return value.node if isinstance(value, Closure) else None
    layout = layout_of(value, is_any_number)
    return layout, tuple(
        [
            (x.kind, x.varying, x.mixed)
            if isinstance(x, Num)
            else (type(x), x if isinstance(x, int) else None)
            for x in leaves(value, layout)
        ]
    )
