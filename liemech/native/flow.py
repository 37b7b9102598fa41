"""Control flow of native code: how variables come together after branches and loops, for one body or for many in lanes.

In an ensemble a condition may differ from lane to lane.  Then both branches run, one after the other and each only if some lane
wants it, under a mask; `break` switches lanes off until the loop ends, and a loop ends when no lane is active.  Values in lanes
that a piece of code does not run for are arbitrary: whoever joins two pieces picks lane by lane.
"""

from __future__ import annotations

import ast
import dataclasses
from collections.abc import Callable, Iterable
from typing import Any

from llvmlite import ir

from ..errors import NotCompilable
from .numbers import Emitter, Num, Values
from .source import Source
from .values import build, is_any_number, layout_of, leaves

RARE = 1000000  # how much rarer than the other a rare branch is
UNROLL = 32  # a static loop with more turns than this stays a loop

LIVE = "<live>"  # lanes still running at this point, where some have left (absent: all for which the code was entered)
BROKEN = "<broken>"  # lanes that left the present loop by `break`
CONTINUED = "<continued>"  # lanes that left the present turn of a written-out loop by `continue`
LEFT = (BROKEN, CONTINUED)
RETURN = "<return>"  # what lanes that have left the call return
NOBODY = "no lane is running"  # value of LIVE when every lane has left

Env = dict[str, Any]


class Undefined:
    """A variable without a value at this point, and why."""

    def __init__(self, reason: str) -> None:
        self.reason = reason


class Retype(Exception):
    """A loop turns out to need another type for a number it carries (an int becomes a float), or a mask."""

    def __init__(self, number: int | None, kind: str = "b", varying: bool = False) -> None:
        self.number, self.type = number, (kind, varying)


@dataclasses.dataclass
class Open:
    """A place where control is still to be led on, and the variables there."""

    block: ir.Block
    env: Env
    end: Callable[[ir.Block], Any] | None = None  # emits the terminator, given the block to go to


@dataclasses.dataclass
class Loop:
    """The loop being translated: where `break` and `continue` go."""

    dynamic: bool
    depth: int
    masked: bool = False
    breaks: list[Open] = dataclasses.field(default_factory=list)
    continues: list[Open] = dataclasses.field(default_factory=list)


@dataclasses.dataclass
class Frame:
    """One call being inlined."""

    source: Source
    env: Env
    returns: list[Open] = dataclasses.field(default_factory=list)
    loops: list[Loop] = dataclasses.field(default_factory=list)
    node: ast.AST | None = None


class Flow:
    """Joins, masks, branches and loops; what statements and expressions mean is the interpreter's business."""

    def __init__(self, emitter: Emitter) -> None:
        self.emitter, self.builder = emitter, emitter.builder
        self.frames: list[Frame] = []
        self.base: Any = None  # lanes for which the present code was entered (None: all)
        self.depth = 0  # enclosing conditions of the present call that differ between lanes
        self.escapes: list[list[Open]] = []  # where control goes when a formula raises
        self.failed: Any = None  # where a formula that raises says so
        self.raises = 0  # places so far that do

    def block(self, statements: list[ast.stmt], env: Env) -> bool:
        raise NotImplementedError

    # -------------------------------------------------------------- values

    def blend(self, mask: Any, new: Any, old: Any) -> Any:
        """`new` in the lanes of the mask, `old` elsewhere, number by number."""
        if isinstance(mask, bool):
            return new if mask else old
        return self._numberwise([new, old], lambda x, y: self.emitter.select(mask, x, y))

    def blank(self, value: Any) -> Any:
        """A value of the same structure whose numbers are arbitrary."""
        e = self.emitter

        def arbitrary(x: Any) -> Num:
            x = e.lift(x)
            return e.each(lambda v: ir.Constant(v.type, ir.Undefined), x.values)

        return self._numberwise([value], arbitrary)

    def _numberwise(self, items: list[Any], combine: Callable[..., Any]) -> Any:
        """Combine values of one structure number by number; numbers that agree stay as they are."""
        if len(items) > 1 and all(v is items[0] for v in items):
            return items[0]
        for v in items:
            if isinstance(v, Undefined):
                return v
        layouts = [layout_of(v, is_any_number) for v in items]
        if any(layout != layouts[0] for layout in layouts):
            shapes = " and ".join(dict.fromkeys(map(repr, layouts)))
            return Undefined(f"it is one thing on one way and another on the other: {shapes}")
        rows = zip(*(leaves(v, layouts[0]) for v in items), strict=True)
        return build(layouts[0], iter([row[0] if len(row) > 1 and _alike(row) else combine(*row) for row in rows]))

    def active(self, env: Env) -> Any:
        """The mask of lanes running here; None for all."""
        live = env.get(LIVE)
        return self.emitter.constant(False, "b", True) if live is NOBODY else self.base if live is None else live

    def everyone(self, mask: Any) -> Any:
        return True if mask is None else mask

    # -------------------------------------------------------------- joins

    def join(self, opens: list[Open], env: Env, into: ir.Block | None = None) -> bool:
        """Lead control from all open places to one, leaving there in `env` what the variables may be; False if none is open."""
        if not opens:
            return False
        if len(opens) == 1 and into is None and opens[0].end is None:
            self.builder.position_at_end(opens[0].block)
            _replace(env, opens[0].env)
            return True
        into = into or self.builder.append_basic_block()
        self._align_masks(opens)
        merged: Env = {}
        for name in opens[0].env:
            if all(name in o.env for o in opens):
                merged[name] = self._numberwise(
                    [o.env[name] for o in opens], lambda *numbers: self._phi(into, [o.block for o in opens], numbers)
                )
        for o in opens:
            self.builder.position_at_end(o.block)
            (o.end or self.builder.branch)(into)
        self.builder.position_at_end(into)
        _replace(env, merged)
        return True

    def _phi(self, into: ir.Block, blocks: list[ir.Block], numbers: Iterable[Any]) -> Num:
        lifted = [self.emitter.lift(x) for x in numbers]
        kind = max((x.kind for x in lifted), key="bif".index)
        varying = any(x.varying for x in lifted)
        incoming = []
        for block, x in zip(blocks, lifted, strict=True):
            self.builder.position_at_end(block)
            incoming.append((self.emitter.cast(x, kind, varying), block))
        self.builder.position_at_end(into)
        phi = self.phi(kind, varying)
        for values, block in incoming:
            come_from(phi, values, block)
        return phi

    def phi(self, kind: str, varying: bool) -> Num:
        """A number whose value depends on where control comes from; `come_from` says how."""
        e = self.emitter
        return e.num([self.builder.phi(e.type(kind, varying)) for _ in range(e.registers(varying))])

    def _align_masks(self, opens: list[Open]) -> None:
        """Give every open place the masks that any of them has."""
        if any(LIVE in o.env for o in opens) and not all(o.env.get(LIVE) is NOBODY for o in opens):
            for o in opens:
                mask = self.active(o.env)
                o.env[LIVE] = self.emitter.constant(True, "b", True) if mask is None else mask
        for name in LEFT:
            if any(name in o.env for o in opens):
                for o in opens:
                    o.env.setdefault(name, False)
        returned = next((o.env[RETURN] for o in opens if RETURN in o.env), None)
        if returned is not None:
            for o in opens:
                o.env.setdefault(RETURN, self.blank(returned))

    # -------------------------------------------------------------- branches

    def branch(self, test: Num, body: list[ast.stmt], orelse: list[ast.stmt], env: Env) -> bool:
        if test.varying:
            self.masked_branch(test, body, orelse, env)
            return True
        b, opens, calls = self.builder, [], [self.emitter.calls]
        starts = b.append_basic_block(), b.append_basic_block()
        fork = b.cbranch(test.value, *starts)
        for start, statements in zip(starts, (body, orelse), strict=True):
            b.position_at_end(start)
            branch = dict(env)
            if self.block(statements, branch):
                opens.append(Open(b.block, branch))
            calls.append(self.emitter.calls)
        self._weigh(fork, calls[1] > calls[0], calls[2] > calls[1])
        return self.join(opens, env)

    @staticmethod
    def _weigh(fork: ir.Instruction, yes_calls: bool, no_calls: bool) -> None:
        """A branch that calls the C library is the rare one: its spills and reloads belong on its own way."""
        if yes_calls is not no_calls:
            fork.set_weights([1, RARE] if yes_calls else [RARE, 1])

    def masked_branch(self, test: Num, body: list[ast.stmt], orelse: list[ast.stmt], env: Env) -> None:
        e, b = self.emitter, self.builder
        outer, here = self.base, self.everyone(self.active(env))
        before = {name: value for name, value in env.items() if name != LIVE}
        merged, ends, someone_left = dict(before), [], False
        self.depth += 1
        for mask, statements in ((test, body), (e.negation(test), orelse)):
            lanes = e.logic("and_", mask, here)
            if LIVE in env:  # lanes that have left keep what they had
                mask = lanes
            if not statements:
                ends.append(lanes)
                continue
            some, skip, calls = e.any(lanes), b.block, e.calls
            start = b.append_basic_block()
            b.position_at_end(start)
            inside = dict(before)
            inside |= {n: merged[n] for n in LEFT if n in merged}
            self.base = lanes
            self.block(statements, inside)
            left = inside.pop(LIVE, None)
            changed = {n: v for n, v in inside.items() if v is not before.get(n, inside)}
            after = {n: self.blend(mask, v, merged[n]) if n in merged and n not in LEFT else v for n, v in changed.items()}
            skipped = dict(merged) | {n: False if n in LEFT else self.blank(v) for n, v in after.items() if n not in merged}
            after = skipped | after
            if isinstance(left, Num):
                after["<end>"], skipped["<end>"] = left, lanes
            end_of_body = b.block
            merged = {}
            self.base = outer
            self.join(
                [
                    Open(end_of_body, after),
                    Open(skip, skipped, self._entering(some, start, e.calls > calls)),
                ],
                merged,
            )
            someone_left |= left is not None
            if left is not NOBODY:
                ends.append(merged.pop("<end>", lanes))
        self.depth -= 1
        live = env.get(LIVE)
        _replace(env, merged)
        if someone_left:
            env[LIVE] = NOBODY if not ends else ends[0] if len(ends) == 1 else e.logic("or_", *ends)
        elif live is not None:
            env[LIVE] = live

    def _entering(self, some: Num, start: ir.Block, rare: bool) -> Callable[[ir.Block], None]:
        return lambda into: self._weigh(self.builder.cbranch(some.value, start, into), rare, False)

    # -------------------------------------------------------------- loops

    def leave(self, loop: Loop, how: str, env: Env) -> bool:
        """`break` or `continue`: control goes elsewhere, or the lanes running here are switched off."""
        places = {"break": loop.breaks, "continue": loop.continues}[how]
        if self.depth == loop.depth and not loop.masked and LIVE not in env:
            places.append(Open(self.builder.block, dict(env)))
            return False
        if loop.dynamic and not loop.masked:
            raise Retype(None)
        if how == "break" or not loop.dynamic:  # a dynamic loop takes those up again that are not broken
            name = BROKEN if how == "break" else CONTINUED
            env[name] = self.emitter.logic("or_", env.get(name, False), self.everyone(self.active(env)))
        env[LIVE] = NOBODY
        return True

    def written_out(self, turns: Iterable[Callable[[Env], Any]], body: list[ast.stmt], env: Env) -> bool:
        """A loop with a static number of turns; each first sets its variables, or ends the loop by returning False."""
        loop = Loop(dynamic=False, depth=self.depth)
        loops, outer = self.frames[-1].loops, {name: env.pop(name) for name in LEFT if name in env}
        loops.append(loop)
        alive = True
        for begin in turns:
            if begin(env) is False:
                break
            alive = self.block(body, env)
            opens = loop.continues + ([Open(self.builder.block, dict(env))] if alive else [])
            loop.continues = []
            alive = self.join(opens, env)
            self._take_up(CONTINUED, env)
            if not alive or env.get(LIVE) is NOBODY:
                break
        loops.pop()
        self._take_up(BROKEN, env)
        alive = self.join(loop.breaks + ([Open(self.builder.block, dict(env))] if alive else []), env)
        env |= outer
        return alive

    def _take_up(self, name: str, env: Env) -> None:
        """Lanes that left the turn or the loop run again."""
        lanes = env.pop(name, False)
        if lanes is not False and LIVE in env:
            env[LIVE] = lanes if env[LIVE] is NOBODY else self.emitter.logic("or_", lanes, env[LIVE])

    def loop(
        self,
        test: Callable[[Env], Any],
        step: Callable[[Env], None],
        body: list[ast.stmt],
        env: Env,
        counters: tuple[str, ...] = (),
    ) -> bool:
        """A loop whose number of turns is known at run time only; `test` sees the variables at its head, `step` at its end."""
        for name in {*_assigned(body), *counters} & env.keys():
            if isinstance(env[name], Undefined):
                del env[name]
        carried = sorted({*_assigned(body), *counters} & env.keys())
        types: dict[int, tuple[str, bool]] = {}
        masked = False
        while True:
            forget = self.mark()
            try:
                return self._loop(test, step, body, env, carried, types, masked)
            except Retype as wanted:
                forget()
                if wanted.number is None:
                    masked = True
                else:
                    types[wanted.number] = wanted.type

    def mark(self) -> Callable[[], None]:
        """A way back to this point: undoes everything emitted since, so that it can be translated in another way."""
        b, function, frame = self.builder, self.builder.function, self.frames[-1]
        block, instructions, blocks = b.block, len(b.block.instructions), len(function.blocks)
        lists: list[list[Any]] = [self.frames, frame.loops, frame.returns, self.escapes, *self.escapes]
        lengths = [len(items) for items in lists]
        state = self.base, self.depth, frame.env, frame.node

        def forget() -> None:
            for items, length in zip(lists, lengths, strict=True):
                del items[length:]
            del function.blocks[blocks:], block.instructions[instructions:]
            block.terminator = None
            self.base, self.depth, frame.env, frame.node = state
            b.position_at_end(block)

        return forget

    def _loop(
        self,
        test: Callable[[Env], Any],
        step: Callable[[Env], None],
        body: list[ast.stmt],
        env: Env,
        carried: list[str],
        types: dict[int, tuple[str, bool]],
        masked: bool,
    ) -> bool:
        e, b, frame = self.emitter, self.builder, self.frames[-1]
        before, head, outer = b.block, b.append_basic_block(), self.base
        here = self.active(env)
        layouts = {name: layout_of(env[name], is_any_number) for name in carried}
        phis: list[Num] = []

        def entering(x: Any) -> Num:
            x = e.lift(x)
            kind, varying = types.get(len(phis), (x.kind, x.varying))
            b.position_at_end(before)
            value = e.cast(x, kind, varying)
            b.position_at_end(head)
            phis.append(self.phi(kind, varying))
            come_from(phis[-1], value, before)
            return phis[-1]

        masks = {n: v for n, v in env.items() if n in (LIVE, *LEFT)}
        at_head = {n: v for n, v in env.items() if n not in masks}
        for name in carried:
            at_head[name] = build(layouts[name], iter([entering(x) for x in leaves(env[name], layouts[name])]))
        active: Any = None
        if masked:
            active = entering(e.constant(True, "b", True) if here is None else here)
            phis.pop()
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
        loop, raises = Loop(True, self.depth, masked), self.raises
        frame.loops.append(loop)
        self.base = lanes
        alive = self.block(body, inside)
        frame.loops.pop()
        if self.join(loop.continues + ([Open(b.block, inside)] if alive else []), inside):
            step(inside)
            index = 0
            for name in carried:
                new, old = inside[name], at_head[name]
                layout = layout_of(new, is_any_number)
                if isinstance(new, Undefined) or layout != layouts[name]:
                    what = new.reason if isinstance(new, Undefined) else f"from {layouts[name]} to {layout}"
                    raise NotCompilable(f"`{name}` changes its structure in the loop: {what}")
                for x, y in zip(leaves(new, layout), leaves(old, layout), strict=True):
                    phi = phis[index]
                    leaf = e.lift(x if not masked or x is y else e.select(lanes, x, y))
                    kind = max(leaf.kind, phi.kind, key="bif".index)
                    varying = leaf.varying or phi.varying
                    if (kind, varying) != (phi.kind, phi.varying):
                        raise Retype(index, kind, varying)
                    come_from(phi, e.cast(leaf, kind, varying), b.block)
                    index += 1
            if masked:
                broken = inside.get(BROKEN, False)
                if self.raises > raises:  # a lane that has failed holds anything, and might never end
                    broken = e.logic("or_", broken, e.load(self.failed))
                come_from(active, e.cast(e.logic("and_", lanes, e.negation(broken)), "b", True), b.block)
            b.branch(head)
        self.base = outer
        exits = list(loop.breaks)
        local = _assigned(body) - env.keys()
        b.position_at_end(head_end)
        if isinstance(go_on, Num):
            exits.insert(0, Open(head_end, at_head, lambda into: b.cbranch(go_on.value, start, into)))
        else:
            b.branch(start)
        if not exits:
            raise NotCompilable("the loop never ends: no `break` is reached")
        for o in exits:
            for name in (LIVE, *LEFT):
                o.env.pop(name, None)
        self.join(exits, env, b.append_basic_block() if len(exits) == 1 else None)
        env |= masks
        for name in local:
            env[name] = Undefined("it gets one inside the loop only, which may have no turn: give it a value before")
        return True


def come_from(phi: Num, values: Values, block: ir.Block) -> None:
    """Let a phi have these values when control comes from this block."""
    for register, value in zip(phi.values, values, strict=True):
        register.add_incoming(value, block)


def _alike(numbers: tuple[Any, ...]) -> bool:
    first = numbers[0]
    return all(x is first or (type(x) is type(first) and not isinstance(x, Num) and repr(x) == repr(first)) for x in numbers)


def _replace(env: Env, new: Env) -> None:
    if new is not env:
        new = dict(new)
        env.clear()
        env.update(new)


def _assigned(body: list[ast.stmt]) -> set[str]:
    """The names that these statements may change."""
    nodes = [n for statement in body for n in ast.walk(statement)]
    inner = {id(n) for c in nodes if isinstance(c, ast.comprehension) for n in ast.walk(c.target)}
    names = {n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store) and id(n) not in inner}
    return names | {
        n.value.id for n in nodes if isinstance(n, ast.Subscript) and isinstance(n.ctx, ast.Store) and isinstance(n.value, ast.Name)
    }
