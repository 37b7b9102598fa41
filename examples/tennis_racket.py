"""A body spun about its middle axis flips periodically; the period grows like the logarithm of its distance from
the axis, on which it would never do so.
"""

import numpy as np

import liemech as lm

body = lm.RigidBody([1.0, 2.0, 3.0])
t = np.linspace(0.0, 500.0, 100_001)

for offset in 1e-2, 1e-4, 1e-6, 1e-8:
    start = body.state(mu=[offset, 1.0, 0.0])
    exact = body.exact(start, t)  # closed form: no steps, no error that grows
    upside_down = exact.mu[:, 1] < 0.0
    flips = t[1:][upside_down[1:] != upside_down[:-1]]
    print(f"offset {offset:.0e}: {len(flips):2} flips, one every {body.period(start) / 2:6.2f} s")

exact = lm.viewer.Motion(
    body, t[:20_000], body.exact(body.state(mu=[1e-4, 1.0, 0.0], g=np.eye(3)), t[:20_000])
)
lm.plots.save(lm.plots.components(exact, "mu", title="offset 1e-4").figure, "tennis_racket.png")
