"""Steady motions, their stability, and chaos.

relative_equilibrium.py  steady motions: found, linearised, judged
near_a_state.py          the motion near a state, its momenta and what they generate
modified_energy.py       does the energy of a run drift or fluctuate?
symmetries.py            which of them stand still, found from the equations of motion
lyapunov.py              Lyapunov exponents and MEGNO along a run
"""
