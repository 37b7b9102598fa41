"""Branches of native code: one way or the other, or both under masks where a condition differs from
lane to lane.

The two ways then run one after the other, each only if some lane wants it.
"""

from __future__ import annotations

import ast
from collections.abc import Callable

from llvmlite import ir

from ...formulas.numbers.forms import now
from ..numbers.ir_numbers import Num
from .joins import ACTIVE, LEFT, NO_LANE, Joins, Open, replace
from .scopes import Env, has

RARE = 1000  # how much rarer than the other a rare branch is


class Branches(Joins):
    """Translation of `if` on numbers that are known at run time only."""

    def branch(self, test: Num, body: list[ast.stmt], orelse: list[ast.stmt], env: Env) -> bool:
        """Translate `if`; False if control never comes behind it."""
        if test.varying:
            self.masked_branch(test, body, orelse, env)
            return True
        b, opens, calls = self.builder, [], [self.emitter.calls]
        starts = b.append_basic_block(), b.append_basic_block()
        fork = b.cbranch(test.value, *starts)
        for start, statements in zip(starts, (body, orelse), strict=True):
            b.position_at_end(start)
            branch = dict(env)
            with self.apart():
                if self.block(statements, branch):
                    opens.append(Open(b.block, branch))
            calls.append(self.emitter.calls)
        self._weigh(fork, calls[1] > calls[0], calls[2] > calls[1])
        return self.join(opens, env)

    @staticmethod
    def _weigh(fork: ir.Instruction, yes_calls: bool, no_calls: bool) -> None:
        """A branch that calls the C library, or has a loop that asks for signals, is the rare one: its
        spills and reloads belong on its own way.
        """
        if yes_calls is not no_calls:
            fork.set_weights([1, RARE] if yes_calls else [RARE, 1])

    def masked_branch(self, test: Num, body: list[ast.stmt], orelse: list[ast.stmt], env: Env) -> None:
        """Translate `if` on a condition that differs from lane to lane: both ways, each under its mask."""
        e, b = self.emitter, self.builder
        outer, since, running = self.state.base, self.state.since, self.everyone(self.active(env))
        before = {name: value for name, value in env.items() if name != ACTIVE}
        merged, ends, someone_left = dict(before), [], False
        certain: list[set[str]] = []  # for each way, the variables that have a value at its end
        self.state.depth += 1
        for mask, statements in ((test, body), (e.negation(test), orelse)):
            lanes = e.logic("and_", mask, running)
            if ACTIVE in env:  # lanes that have left keep what they had
                mask = lanes
            if not statements:
                ends.append(lanes)
                certain.append({n for n in before if has(n) not in before})
                continue
            aside = not all(isinstance(x, (ast.Break, ast.Continue)) for x in statements)  # which change masks alone
            entered = now()
            if aside:
                any_lane, skip, calls = e.any(lanes), b.block, e.calls
                start = b.append_basic_block()
                b.position_at_end(start)
            inside = dict(before)
            inside |= {n: merged[n] for n in LEFT if n in merged}
            self.state.base, self.state.since = lanes, entered
            with self.apart():
                self.block(statements, inside)
            left = inside.pop(ACTIVE, None)
            if left is not NO_LANE:
                certain.append({n for n in inside if has(n) not in inside})
            for n in [n for n in inside if n not in before and not n.startswith("<")]:
                inside.setdefault(has(n), True)
                merged.setdefault(has(n), False)
            changed = {n: self.settled(v, entered) for n, v in inside.items() if v is not before.get(n, inside)}
            after = {
                n: self.blended(n, mask, (v, inside), (merged[n], merged)) if n in merged and n not in LEFT else v
                for n, v in changed.items()
            }
            skipped = dict(merged) | {
                n: False if n in LEFT else self.blank(v) for n, v in after.items() if n not in merged
            }
            after = skipped | after
            if isinstance(left, Num):
                after["<end>"], skipped["<end>"] = left, lanes
            self.state.base, self.state.since = outer, since
            if aside:
                end_of_body, merged = b.block, {}
                self.join(
                    [
                        Open(end_of_body, after),
                        Open(skip, skipped, self._entering(any_lane, start, e.calls > calls), entered),
                    ],
                    merged,
                )
            else:
                merged = after
            someone_left |= left is not None
            if left is not NO_LANE:
                ends.append(merged.pop("<end>", lanes))
        self.state.depth -= 1
        live = env.get(ACTIVE)
        assigned = {has(n) for n in (set.intersection(*certain) if certain else merged)}
        replace(env, {n: v for n, v in merged.items() if n not in assigned})
        if someone_left:
            env[ACTIVE] = NO_LANE if not ends else ends[0] if len(ends) == 1 else e.logic("or_", *ends)
        elif live is not None:
            env[ACTIVE] = live

    def _entering(self, any_lane: Num, start: ir.Block, rare: bool) -> Callable[[ir.Block], None]:
        """A function that emits the branch to `start`, taken if any lane runs, or to the block it is given."""
        return lambda into: self._weigh(self.builder.cbranch(any_lane.value, start, into), rare, False)
