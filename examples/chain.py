"""A chain of four links swings from rest: RATTLE keeps every rod, and the energy for as long as one
likes.
"""

import numpy as np

import liemech as lm

links = 4
chain = lm.models.ChainPendulum(masses=[0.2] * links, lengths=[0.25] * links)
slope = np.array([np.cos(0.3), 0.0, np.sin(-0.3)])
q = chain.hanging(np.tile(slope, links))
start = chain.consistent(q, 0.02 * np.cross([0.0, 0.0, 1.0], np.reshape(q, (-1, 3))).ravel())

run = lm.integrate(chain, lm.RATTLE(), start, h=0.002, steps=20_000, every=10, progress=False)
tensions = np.asarray(chain.multipliers(run.q, run.p))
print(run.drift())
print(
    f"the uppermost rod carries between {tensions[:, 0].min():.2f} and "
    f"{tensions[:, 0].max():.2f} N; at rest 7.85 N"
)
lm.plots.save(lm.plots.invariants(run).figure, "chain.png")
