"""From a system, a method and a start to a trajectory.

A run in ten lines, from `lm.integrate(...)` to samples:

     1. integrate.py            takes a plan that it has made before, or makes one, and calls its `run`
     2. plan.py, options.py     the plan has checked system, method and options once (arguments.py)
     3. runs/starts.py          checks the start: its parts, its bodies
     4. runs/short.py           a short run that nothing looks into: one native call, and the result
     5. runs/equal, tolerance   any other run: `aim` sets goals and h, `begin` writes a column for each body
     6. runs/course.py          the loop: pieces of some steps, between them the bar, the file, Ctrl-C
     7. runs/run.py             a piece: bodies side by side, until they are at their goals or fail
     8. compiled/driver.py      its steps: `advance` under a control, as native code or plain Python
     9. keep.py, between/       after each piece: samples, states inside of steps, events
    10. result.py, runs/carry   the `Trajectory` (trajectory.py), and where every body stands; stopped.py: who failed

Kinds of runs, by the steps:

                                    all bodies to one end, no event   each to an end of its own
       fixed steps (equal.py)       StraightRun                       EqualRun
       in fictive time              StraightFictiveRun                FictiveRun (both: rooms/fictive_time/runs.py)
       adaptive (tolerance.py)                                        ToleranceRun

In a `Run` a body is a column of numbers: what the method carries along, its `Clock` (time, step h, number of
steps, marks) and its `Goal` (last time, last step, tolerances); one body is an ensemble of one.  The start
goes through `Method.start`, or comes from the `Carry` of a former run (going_on.py says whether it may).  A
body that fails stays, and the others go on; jumps.py ends adaptive steps where the velocity jumps.
A `Control` (compiled/control.py) knows how long a step is and when it is the last: `Equal`, `Tolerance`,
`Fictive`.  `Lanes` (compiled/lanes.py) calls `advance` on columns, `Execution` (compiled/execution.py)
decides whether native code or plain Python does it: both give the same bits.
Observers (keep.py) keep `Every` n-th state, states `AtTimes` that are given, `Straight` samples that native code writes
where they stay, `Dense` rows for the motion between steps, `Quantities` for functions of states (recorded.py).

Folders: reports/, compiled/ and between/ are what a run is made of; runs/ are the runs.  Runs by the sites of one
system are in `rooms/sites/runs`, those of linkages in `joints/in_memory`, those in fictive time in `rooms/fictive_time`;
a run so far goes into a file by checkpoint.py; what is done with plans and runs is in `rooms/derivatives`, `rooms/at_work`,
`rooms/files`.
"""
