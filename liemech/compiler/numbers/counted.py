"""Native loops whose number of turns is known where they begin."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from llvmlite import ir

from .ir_numbers import I64


@dataclass
class CountedTurn:
    """A turn of a loop: its index, and the values that the turn before has left; those that it sets go on."""

    index: ir.Value
    values: list[ir.Value]


@contextlib.contextmanager
def counted(
    b: ir.IRBuilder, begin: ir.Value, end: ir.Value, step: int = 1, values: Sequence[ir.Value] = ()
) -> Iterator[CountedTurn]:
    """A native loop over begin, begin + step, ... below a larger end.  values : what the first turn finds; behind the
    loop those of the turn are what the last one has left.
    """
    before, head, after = b.block, b.append_basic_block(), b.append_basic_block()
    b.branch(head)
    b.position_at_end(head)
    index, phis = b.phi(I64), [b.phi(x.type) for x in values]
    for phi, x in zip((index, *phis), (begin, *values), strict=True):
        phi.add_incoming(x, before)
    yield (turn := CountedTurn(index, [*phis]))
    following = b.add(index, I64(step))
    for phi, x in zip((index, *phis), (following, *turn.values), strict=True):
        phi.add_incoming(x, b.block)
    b.cbranch(b.icmp_signed("<", following, end), head, after)
    b.position_at_end(after)
