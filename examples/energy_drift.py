"""Both methods keep a body's momentum on its sphere, but one of them lets its energy go."""

import numpy as np

import liemech as lm

body = lm.RigidBody([1.0, 1.5, 2.0])
start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))

runs = {}
for method in lm.RKMK(order=4), lm.CovariantVariational(lm.Cayley()):
    run = runs[method.name] = lm.integrate(body, method, start, h=0.5, steps=20_000, every=20)
    change = np.abs(run.energy / run.energy[0] - 1.0)
    first, second = change[:500].max(), change[500:].max()
    print(
        f"{method.name:<22} largest change of the energy in the first "
        f"half {first:.1e}, in the second {second:.1e}"
    )
    print(run.drift(), end="\n\n")
lm.plots.save(lm.plots.drift(runs, title="a free rigid body").figure, "energy_drift.png", dpi=110)
