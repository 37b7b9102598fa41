"""All three methods keep a body's momentum on its sphere, but one of them lets its energy go."""

import numpy as np

import liemech as lm

body = lm.RigidBody([1.0, 1.5, 2.0])
start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
methods = {
    "RKMK4": lm.RKMK(order=4),
    "Algorithm 1, Cayley": lm.CovariantVariational(lm.Cayley()),
    "Hamilton-Jacobi 4": lm.LiePoissonHamiltonJacobi(order=4),
}

runs = {}
for name, method in methods.items():
    run = runs[name] = lm.integrate(body, method, start, h=0.5, steps=200_000, every=20)
    change = np.abs(run.energy / run.energy[0] - 1.0)
    first, second = change[:5000].max(), change[5000:].max()
    print(
        f"{name:<20} largest change of the energy in the first half {first:.1e}, in the second "
        f"{second:.1e}"
    )
    print(run.drift(), end="\n\n")
lm.plots.save(lm.plots.drift(runs, title="a free rigid body").figure, "energy_drift.png")
