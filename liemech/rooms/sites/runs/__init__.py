"""Runs of one system of many sites, step by step over the sites.

Read plan.py (which runs go by sites), run.py (the loop: a `Course`) and driver.py (the compiled steps of all sites).
turns.py are splittings by colours, chains.py chains and rings that are solved as a whole; linkages are in
`joints/in_memory/`.  states.py and prepared.py lay out the sites, lists.py finds neighbours, execution.py calls native
code on threads and writes what samples.py has; events.py, totals.py and between.py look at a run.
"""
