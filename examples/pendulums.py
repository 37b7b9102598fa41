"""Twelve pendulums in their phase plane, by a symplectic method: some swing, some turn over, and no
curve crosses another.
"""

import numpy as np

import liemech as lm

pendulum = lm.models.Pendulum(length=1.0)
starts = pendulum.state(q=np.zeros((12, 1)), p=np.linspace(0.5, 9.0, 12)[:, None])
run = lm.integrate(pendulum, lm.StormerVerlet(), starts, h=0.02, steps=150)

highest = np.abs(run.q[..., 0]).max(axis=0)
print(
    f"{np.sum(highest < np.pi)} swing, "
    f"{np.sum(highest >= np.pi)} turn over; the last to swing reaches",
    end=" ",
)
print(f"{np.degrees(highest[highest < np.pi].max()):.0f} degrees")
lm.plots.save(lm.plots.phase_portrait(run, title="twelve pendulums").figure, "pendulums.png")
