"""Methods of linkages of any size: loops over bodies and joints, whose numbers lie in memory.

links.py                  the system, and what each place has in memory, by name
rattle_of_links.py        LieRATTLE; multiple_time_steps_of_links.py with slow forces between its steps
rattle_backwards.py       what a function of the end of its step feels at the start
elimination.py            impulses from joint to joint
loads_of_links.py         kicks that depend on velocities; on_all_bodies.py: by one formula for all bodies
reduced_equation.py       the velocity of a body among others, for RKMK and commutator-free methods as they stand
multipliers.py            what holds bodies together there; multipliers_backwards.py: what a function of it feels
taylor_of_links.py        the reduced equation by power series
runs.py                   runs, their events and errors; plan.py: of which plans
"""
