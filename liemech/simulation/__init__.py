"""From a system, a method and a start to a trajectory.

A run, read in the order in which it happens:

1. `integrate` (integrate.py) looks for a plan that it has made before, or makes one, and calls its `run`.
2. `Plan` (plan.py) checks the system, the method and the `Options` (options.py, arguments.py) once.  It
   keeps h or the tolerances, and what is compiled, as `Steps` (compiled/prepared.py) or `AdaptiveSteps`
   (tolerance.py).  `Plan.run` checks the start (starts.py), and chooses the kind of run:

                                    all bodies make the same steps    each body its own steps
       fixed steps (equal.py)       StraightRun                       EqualRun
       in fictive time              StraightFictiveRun                FictiveRun (both: fictive_time/run.py)
       adaptive (tolerance.py)                                        ToleranceRun

   A run that is so short that one native call makes it takes a shorter way (short.py), to the same bits.
3. `Course` (course.py) is the loop: `piece` after piece of some steps, until every body is at its goal;
   between them the run is saved and shown, and hears Ctrl-C.  In a `Run` (run.py) a body is a column of
   numbers: what the method carries along, its `Clock` (time, step h, number of steps, marks) and its
   `Goal` (last time, last step, tolerances); one body is an ensemble of one.  `aim` sets the goals and
   h of all bodies, `begin` writes the columns: the start goes through `Method.start`, or comes from the
   `Carry` of a former run.  A body that fails stays, and the others go on.
4. `advance` (compiled/driver.py) is what is compiled: it makes steps of one column, or of several side by
   side.  A `Control` (compiled/control.py) knows how long a step is and when it is the last: `Equal`, `Tolerance`,
   `Fictive`.  `Lanes` (compiled/lanes.py) calls it on columns; `Execution` (compiled/execution.py) decides
   whether native code or plain Python does it.  Both give the same bits.
5. After each piece observers (keep.py) look at its steps: `Every` n-th state, states `At` given times,
   `Straight` samples that native code writes where they stay, `Dense` rows for the motion between steps,
   `Quantities` for functions of states; `Events` (between/events.py) for zeros.  States inside of steps come
   from a `Between` (between/dense.py): by a polynomial, or by a shorter step.
6. result.py makes every `Trajectory` (trajectory.py), of what the observers have, and joins those of
   chunks and members.  Its `carry` (carry.py; origin.py in fictive time) says where every body stands, and
   going_on.py whether a plan may go on from there.

The rooms beside it, of which each imports only from those before it and from here, but for a plan that opens
them when they are asked for (tests/test_architecture.py):

    reports/ compiled/ between/     a run is made of them
    fictive_time/ sites/            runs of other kinds
    derivatives/ at_work/ files/    what is done with plans and runs
"""
