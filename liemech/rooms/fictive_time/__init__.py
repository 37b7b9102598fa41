"""Time transformations, dt = sigma(y) dtau, and runs whose steps are equal in the fictive time tau.

time_scales.py                                sigma: how much time a unit of fictive time takes
sundman.py, time_transformed.py, clocked.py   systems that carry their physical time along
adaptive_verlet.py, reversible_controller.py  methods that choose sigma themselves
origin.py                                     where a run in fictive time began, and where it stands
runs.py, arrival.py                           the runs, and the state at a given physical time
"""
