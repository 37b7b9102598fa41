"""Stop checks: a loop of native code that may never end asks, from time to time, whether Ctrl-C or
another signal has come, or whether nobody waits for its thread any more.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from ..numbers.ir_numbers import I1, I32
from ..translation.joins import Open
from .interrupts import THREAD

EVERY = 2**14
"""Turns of a loop between two checks: a turn takes up to some 10 us for each lane, a check 0.1 us."""

KEEPING = "preserve_mostcc"
"""The calling convention of a check: it saves the registers of integers itself.  (`preserve_allcc`
promises the same of vector registers, but LLVM clears their upper halves on processors with AVX.)
"""

LOOK = f"""
@liemech_raised = external global [4 x ptr]
@liemech_stopped = external global i64
declare i32 @liemech_ensure()
declare void @liemech_release(i32)
declare i32 @liemech_signals()
declare void @liemech_fetch(ptr, ptr, ptr)
declare {THREAD} @liemech_thread()
declare i32 @liemech_is_stopped({THREAD})

define internal {KEEPING} i1 @look() cold noinline nounwind {{
entry:
  %thread = call {THREAD} @liemech_thread()
  %me = inttoptr {THREAD} %thread to ptr
  %traceback = getelementptr [4 x ptr], ptr @liemech_raised, i64 0, i64 2
  %value = getelementptr [4 x ptr], ptr @liemech_raised, i64 0, i64 1
  %owner = getelementptr [4 x ptr], ptr @liemech_raised, i64 0, i64 3
  %before = load volatile ptr, ptr %owner
  %held = icmp eq ptr %before, %me
  br i1 %held, label %stop, label %ask
ask:
  %state = call i32 @liemech_ensure()
  %come = call i32 @liemech_signals()
  %raised = icmp ne i32 %come, 0
  br i1 %raised, label %hold, label %go_on
hold:
  call void @liemech_fetch(ptr @liemech_raised, ptr %value, ptr %traceback)
  store volatile ptr %me, ptr %owner
  call void @liemech_release(i32 %state)
  br label %stop
go_on:
  call void @liemech_release(i32 %state)
  %count = load volatile i64, ptr @liemech_stopped
  %some = icmp ne i64 %count, 0
  br i1 %some, label %others, label %none
others:
  %found = call i32 @liemech_is_stopped({THREAD} %thread)
  %mine = icmp ne i32 %found, 0
  br i1 %mine, label %stop, label %none
stop:
  ret i1 true
none:
  ret i1 false
}}
"""
"""Is this thread to stop?  Python handles signals here; what a handler raises is held until native
code has come back.
"""


class StopCheck:
    """The stop checks of one loop; it gives the attempted step up when its thread is to stop."""

    def __init__(self, loops: Any, before: ir.Block, head: ir.Block) -> None:
        b = loops.builder
        b.position_at_end(head)
        self.turns = b.phi(I32)
        self.turns.add_incoming(ir.Constant(I32, 0), before)

    def after_turn(self, loops: Any) -> None:
        """Count a turn at its end; after `EVERY` of them check, and leave the loop if the thread is to stop."""
        e, b = loops.emitter, loops.builder
        turns = self.next = b.add(self.turns, ir.Constant(I32, 1))
        check, stopped, on = (b.append_basic_block() for _ in range(3))
        period = EVERY // e.lanes
        due = b.icmp_unsigned("==", b.and_(turns, ir.Constant(I32, period - 1)), ir.Constant(I32, 0))
        b.cbranch(due, check, on).set_weights([1, period])
        b.position_at_end(check)
        b.cbranch(b.call(look(b.module), [], cconv=KEEPING), stopped, on)
        e.calls += 1
        b.position_at_end(stopped)
        e.store(True, loops.state.failed)
        loops.state.escapes[-1].append(Open(stopped, {}))
        b.position_at_end(on)

    def again(self, block: ir.Block) -> None:
        """Count on, where control goes back to the head from this block."""
        self.turns.add_incoming(self.next, block)


class _CheckText(ir.Function):
    """The function `look`, which LLVM reads from the text LOOK."""

    def __str__(self) -> str:
        return LOOK


def look(module: ir.Module) -> ir.Function:
    """The check of a module, declared at its first use."""
    return module.globals.get("look") or _CheckText(module, ir.FunctionType(I1, []), "look")
