"""Runs of one system of many sites, step by step over the sites.

In the order in which one reads:

    plan.py         which runs go by sites, and of which class they are
    run.py          `SiteRun`: the loop in Python, a `Course`; samples, times inside of steps
    failures.py     why a step failed, and at which site
    driver.py       the loop in native code, `advance_sites`, around the step of one site
    turns.py        splittings by colours, a step of all sites together; chains.py: chains and rings, solved as a whole
    states.py, shape.py, execution.py       states, layouts of memory, native code or plain Python
    samples.py, totals.py                   samples of the sites, sums over them
    events.py                               the observer of all steps: zeros of events, ways of adaptive steps
    between.py      the motion between samples; lists.py: lists of neighbours within a distance

Runs of linkages are in `joints/in_memory/`.
"""
