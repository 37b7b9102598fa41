"""A double pendulum: its energy does not separate, its motion is chaotic, and a symplectic method keeps both honest for long."""

import numpy as np

import liemech as lm

pendulum = lm.models.DoublePendulum(masses=[1.0, 0.5], lengths=[1.0, 0.8])
angles = np.radians([50.0, -25.0])
start = pendulum.state(q=angles, p=pendulum.momentum(angles, [0.0, 0.0]))

# the energy after a few thousand swings
runs = {}
for method in (
    lm.HamiltonJacobi(order=4),
    lm.HamiltonJacobi(order=6),
    lm.RKMK(order=4),
    lm.RKMK(order=6),
):
    run = lm.integrate(pendulum, method, start, h=0.02, steps=100_000, every=100)
    runs[method.name] = run
    print(f"{method.name:18}", run.drift()["energy"])
lm.plots.save(lm.plots.drift(runs, title="a double pendulum").figure, "double_pendulum.png")

# thrown higher it is chaotic: twenty pendulums a millionth of a degree apart, and when they are ten degrees apart
high = np.radians([120.0, -30.0])
many = high + np.radians(1e-6) * np.random.default_rng(1).normal(size=(20, 2))
starts = pendulum.state(q=many, p=np.zeros((20, 2)))
cloud = lm.integrate(pendulum, lm.HamiltonJacobi(order=6), starts, h=0.01, steps=3000, every=10)
spread = np.degrees(np.ptp(cloud.q, axis=1).max(axis=1))
apart = np.flatnonzero(spread > 10.0)
print(
    f"ten degrees apart after {cloud.t[apart[0]]:.0f} s"
    if len(apart)
    else f"still {spread.max():.1e} degrees together"
)
