"""White noise and damping on coadjoint orbits.

stochastic.py                                 Lie-Poisson systems whose velocity has white noise in it
stochastic_steps.py                           methods around methods for equations without noise
double_bracket.py                             damping that leaves a momentum on its orbit
dissipative.py, dissipative_splitting.py      dissipation whose flow is known, and Strang's splitting with it
"""
