"""Steady motions, their stability, and chaos.

near_a_state.py          the motion near a state, its momenta and the motions that they generate
symmetries.py            which momenta are kept, from the equations of motion
relative_equilibrium.py  steady motions, by Newton's method, and their stability, by the energy-momentum method
lyapunov.py              Lyapunov exponents and MEGNO along a run
modified_energy.py       does the energy of a run drift or fluctuate?
"""
