"""Runs of one system of many sites, step by step over the sites.

A run in ten lines, from `plan.run(...)` to samples, beside that of bodies in `simulation/__init__.py`:

     1. plan.py      `SitesOfPlan.trajectory`: does the run go by sites, and of which class is it
     2. run.py       `SiteRun`: `aim` sets h, goals and times of samples; lists.py says who is near whom
     3. shape.py     layouts and native code of runs that begin alike; execution.py: native code or plain Python
     4. driver.py    `begin_sites`: what the method carries along at every site; states.py: states as rows of numbers
     5. simulation/runs/course.py    the loop: pieces, between them the bar, the file, Ctrl-C
     6. run.py       a piece, `_go`: as many steps as end soon, by one call of the driver, `_steps`
     7. driver.py    `advance_sites`: the `advance` of bodies with the method of all sites, samples at ends of steps
     8. samples.py   what the driver has written; `SiteRun._attend` adds those inside of steps; totals.py: sums
     9. events.py    where every step is looked at: makes the steps, asks events, and ends the run at a zero
    10. simulation/result.py    the `Trajectory`; between.py: the motion between samples; failures.py: which site failed

Other steps than site by site: turns.py, splittings by colours, all sites together; chains.py, chains and rings solved
as a whole; `joints/in_memory/`, linkages.  A user's `energy(a, b)` is asked by terms/terms_at_site.py,
`RoleAtSite.plus_edges`.
"""
