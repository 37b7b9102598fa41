"""From a system, a method and a start to a trajectory: the loops over steps, their native code,
samples and diagnostics.

The way of a run, for who reads this for the first time:

integrate    finds or makes a `Plan`, and calls its `run`.
plan         checks system, method and `Options` once, and keeps `Steps` (prepared.py) or
             `AdaptiveSteps` (tolerance.py), which have h or the tolerances.  A run begins with a state,
             or with the carry of another run, and is one of five: `StraightRun` (all bodies make the
             same steps) and `EqualRun` (each its own) of equal.py, the same two in fictive time of
             fictive_run.py, and `ToleranceRun`.  Short ones are one native call (short.py).
run          `Run` is the loop.  `aim` sets the goals of all bodies and their h, `begin` makes their
             columns: what the method carries along, `Clock` (with h), `Goal`.  `_march` takes them
             forwards in pieces, `result` makes the trajectory.
driver       `advance`, which is compiled: `turns` turns of a `Control` (control.py), which knows how
             long a step is and when it is the last one.  `Lanes` (lanes.py) has its layouts and its
             native code, `Execution` (execution.py) decides between that and plain Python.
keep         observers, which look at the steps of a piece: `Every`, `At`, `Dense`; `Events` (events.py).
             Inside of steps they ask `Between` (dense.py), and so does `Trajectory.at`.
carry        where a run stands, with which another one goes on.

Systems of many sites have drivers and runs of their own, sites_*.py; derivatives go through the same
steps in dual numbers, tangent.py.
"""
