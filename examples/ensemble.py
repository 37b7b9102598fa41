"""Ten thousand bodies at once: how a cloud of equal bodies, spun almost alike, comes apart.

Their rates of spin differ by some per cent; after a while they have forgotten their common phase.
"""

import time

import numpy as np

import liemech as lm

bodies, steps = 10_000, 1000
rng = np.random.default_rng(1)
body = lm.RigidBody([1.0, 1.5, 2.0])
momenta = [0.5, 0.0, 0.75**0.5] * (1.0 + 0.05 * rng.normal(size=(bodies, 1)))
# a leading axis makes an ensemble; no attitude, so none is computed
starts = body.state(mu=momenta)
# compile before the clock runs
lm.integrate(body, lm.RKMK(order=4), starts, h=0.1, steps=1, compiled=True)

begun = time.perf_counter()
run = lm.integrate(body, lm.RKMK(order=4), starts, h=0.1, steps=steps, every=100)
spent = time.perf_counter() - begun

for t, mu in zip(run.t, run.mu):
    phase = np.arctan2(mu[:, 1], mu[:, 0])
    print(f"t = {t:5.1f} s   together in phase: {abs(np.exp(1j * phase).mean()):.3f}")
print(f"{bodies * steps / spent / 1e6:.0f} million steps of a body per second")
lm.plots.save(
    lm.plots.cloud(run, title=f"{bodies} bodies after {run.t[-1]:.0f} s").figure, "ensemble.png"
)
