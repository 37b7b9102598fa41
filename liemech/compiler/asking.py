"""Loops that may never end ask, from time to time, whether to stop."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from .ir_numbers import I1, I32, I64
from .phi import Open

EVERY = 2**14
"""Turns of a loop after which native code asks whether somebody wants it to stop: a turn takes up to
some 10 us, and asking 0.1 us.
"""


KEEPING = "preserve_mostcc"
"""The registers of the loop stay what they are: a step that never asks does not save any."""


class Look:
    """Lets a loop that may never end ask from time to time, and give the attempt up when somebody
    wants it to stop.
    """

    def __init__(self, loops: Any, before: ir.Block, head: ir.Block) -> None:
        b = loops.builder
        b.position_at_end(head)
        self.turns = b.phi(I32)
        self.turns.add_incoming(ir.Constant(I32, 0), before)

    def after_turn(self, loops: Any) -> None:
        """At the end of a turn."""
        e, b = loops.emitter, loops.builder
        turns = self.next = b.add(self.turns, ir.Constant(I32, 1))
        asked, stopped, on = (b.append_basic_block() for _ in range(3))
        now = b.icmp_unsigned("==", b.and_(turns, ir.Constant(I32, EVERY - 1)), ir.Constant(I32, 0))
        b.cbranch(now, asked, on).set_weights([1, EVERY])
        b.position_at_end(asked)
        b.cbranch(b.call(look(b.module), [], cconv=KEEPING), stopped, on)
        b.position_at_end(stopped)
        e.store(True, loops.failed)
        loops.escapes[-1].append(Open(stopped, {}))
        b.position_at_end(on)

    def again(self, block: ir.Block) -> None:
        """Control goes back to the head from this block."""
        self.turns.add_incoming(self.next, block)


def look(module: ir.Module) -> ir.Function:
    """The function of a module that tells whether to stop: signals are handled in it, and what a
    handler raises is kept.
    """
    found = module.globals.get("look")
    if found is not None:
        return found
    function = ir.Function(module, ir.FunctionType(I1, []), "look")
    function.linkage, function.calling_convention = "internal", KEEPING
    for fact in ("noinline", "cold", "nounwind"):
        function.attributes.add(fact)
    pointer = I64.as_pointer()
    ensure = _declared(module, "liemech_ensure", I32, [])
    release = _declared(module, "liemech_release", ir.VoidType(), [I32])
    signals = _declared(module, "liemech_signals", I32, [])
    fetch = _declared(module, "liemech_fetch", ir.VoidType(), [pointer] * 3)
    asked = _declared(module, "liemech_asked", I32, [])
    raised = ir.GlobalVariable(module, ir.ArrayType(I64, 3), "liemech_raised")
    given_up = ir.GlobalVariable(module, I64, "liemech_given_up")

    b = ir.IRBuilder(function.append_basic_block("entry"))
    held, end, wanted, none = (
        function.append_basic_block(n) for n in ("raised", "end", "wanted", "none")
    )
    state = b.call(ensure, [])
    come = b.icmp_signed("!=", b.call(signals, []), ir.Constant(I32, 0))
    b.cbranch(come, held, end)
    b.position_at_end(held)
    places = [
        b.gep(raised, [ir.Constant(I32, 0), ir.Constant(I32, i)], inbounds=True) for i in range(3)
    ]
    b.call(fetch, places)
    b.branch(end)
    b.position_at_end(end)
    b.call(release, [state])
    word = b.gep(raised, [ir.Constant(I32, 0), ir.Constant(I32, 0)], inbounds=True)
    some = b.or_(b.load(given_up, typ=I64), b.load(word, typ=I64))
    b.cbranch(b.icmp_signed("!=", some, ir.Constant(I64, 0)), wanted, none)
    b.position_at_end(wanted)
    b.ret(b.icmp_signed("!=", b.call(asked, []), ir.Constant(I32, 0)))
    b.position_at_end(none)
    b.ret(ir.Constant(I1, 0))
    return function


def _declared(
    module: ir.Module, name: str, result: ir.Type, arguments: list[ir.Type]
) -> ir.Function:
    return ir.Function(module, ir.FunctionType(result, arguments), name)
