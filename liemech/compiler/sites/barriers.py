"""Barriers: threads that share the sites of one system wait for each other where sites meet."""

from __future__ import annotations

from llvmlite import ir

from ..machine.stop_checks import look
from ..numbers.ir_numbers import I64

GIVEN_UP = 2
"""A flag: the step is given up."""

PATIENCE = 2**14
"""Looks at a barrier, some 20 us, before the thread lets others have its processor whenever they ask for
it, and looks again.
"""

YIELDS = 2**13
"""Times that it does, some milliseconds, before it sleeps between looks.  A thread that sleeps wakes up
late, so that the next one comes to sleep as well, and all of them sleep at every barrier from then on:
nobody may sleep because another was interrupted for a moment.
"""

IN_TURN = 2**6
"""Yields of all threads between two sleeps: where two share a processor, the one that wakes up is put on another
one if that is free, which does not happen as long as they run in turn.
"""

REST = 20
"""Microseconds of a sleep."""

SELDOM = 2**10
"""Yields or sleeps between two looks at whether the thread is to stop."""

BARRIER = f"""
declare i32 @liemech_sleep(i32)
declare i32 @liemech_yield()

define internal i64 @barrier(ptr %crew, i64 %flags) noinline nounwind {{
entry:
  %threads = load i64, ptr %crew
  %alone = icmp sle i64 %threads, 1
  br i1 %alone, label %single, label %many
single:
  ret i64 %flags
many:
  %arrived = getelementptr i64, ptr %crew, i64 1
  %met = getelementptr i64, ptr %crew, i64 2
  %said = getelementptr i64, ptr %crew, i64 3
  %gone = getelementptr i64, ptr %crew, i64 6
  %turn = load atomic i64, ptr %met acquire, align 8
  %odd = and i64 %turn, 1
  %place = add i64 %odd, 4
  %result = getelementptr i64, ptr %crew, i64 %place
  %before = atomicrmw or ptr %said, i64 %flags acq_rel
  %others = atomicrmw add ptr %arrived, i64 1 acq_rel
  %all = add i64 %others, 1
  %last = icmp eq i64 %all, %threads
  br i1 %last, label %free, label %wait
free:
  %together = load atomic i64, ptr %said acquire, align 8
  store atomic i64 %together, ptr %result monotonic, align 8
  store atomic i64 0, ptr %said monotonic, align 8
  store atomic i64 0, ptr %arrived monotonic, align 8
  %next = add i64 %turn, 1
  store atomic i64 %next, ptr %met release, align 8
  ret i64 %together
wait:
  %k = phi i64 [ 1, %many ], [ %more, %on ], [ %more, %yield ], [ %more, %rest ], [ %more, %ask ]
  %now = load atomic i64, ptr %met acquire, align 8
  %done = icmp ne i64 %now, %turn
  br i1 %done, label %through, label %patient
patient:
  %more = add i64 %k, 1
  %long = icmp sgt i64 %k, {PATIENCE}
  br i1 %long, label %tired, label %on
on:
  br label %wait
tired:
  %given_up = load atomic i64, ptr %gone acquire, align 8
  %alone_now = icmp ne i64 %given_up, 0
  br i1 %alone_now, label %leave, label %check
check:
  %seldom = and i64 %k, {SELDOM - 1}
  %asks = icmp eq i64 %seldom, 0
  br i1 %asks, label %ask, label %pause
pause:
  %very_long = icmp sgt i64 %k, {PATIENCE + YIELDS}
  %yields = getelementptr i64, ptr %crew, i64 8
  %yielded = atomicrmw add ptr %yields, i64 1 monotonic
  %many_times = and i64 %yielded, {IN_TURN - 1}
  %often = icmp eq i64 %many_times, {IN_TURN - 1}
  %sleepy = or i1 %very_long, %often
  br i1 %sleepy, label %rest, label %yield
yield:
  %nothing = call i32 @liemech_yield()
  br label %wait
rest:
  %ignored = call i32 @liemech_sleep(i32 {REST})
  br label %wait
ask:
  %stop = call preserve_mostcc i1 @look()
  br i1 %stop, label %leave, label %wait
leave:
  store atomic i64 1, ptr %gone release, align 8
  ret i64 2
through:
  %heard = load atomic i64, ptr %result monotonic, align 8
  ret i64 %heard
}}
"""
"""Wait for all threads, and say what any of them says: flags.  The words of the crew: how many
threads there are, how many have arrived, how often all have met, what they have said so far, what
was said at the last two meetings, whether one has given up waiting, a word for scratch memory, and how
often threads have let others have their processor.
"""


class _BarrierText(ir.Function):
    """The function `barrier`, which LLVM reads from the text BARRIER."""

    def __str__(self) -> str:
        return BARRIER


def barrier(module: ir.Module) -> ir.Function:
    """The barrier function of a module, declared at its first use."""
    function = module.globals.get("barrier")
    if function is None:
        look(module)
        type_ = ir.FunctionType(I64, [I64.as_pointer(), I64])
        function = _BarrierText(module, type_, "barrier")
    return function
