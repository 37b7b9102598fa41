"""A spherical pendulum by index reduction, with projection, and by RATTLE: distance from the
sphere, and energy.
"""

import numpy as np

import liemech as lm

pendulum = lm.SphericalPendulum(gravity=9.81)
start = pendulum.state(q=[0.6, 0.0, -0.8], p=[0.4, 1.5, 0.3])
methods = {
    "RK4, reduced": lm.IndexReduction(lm.RKMK(order=4)),
    "RK4, reduced and projected": lm.IndexReduction(lm.RKMK(order=4), project=True),
    "RATTLE": lm.RATTLE(),
    "RATTLE, order 4": lm.Composition(lm.RATTLE(), order=4),
}
figure, (left, right) = lm.plots.subplots(1, 2, figsize=(9, 3.6))
for name, method in methods.items():
    run = lm.integrate(pendulum, method, start, h=0.03, steps=20_000, every=20, progress=False)
    distance = np.abs(np.linalg.norm(run.q, axis=1) - pendulum.length)
    error = np.maximum.accumulate(np.abs(run.energy / run.energy[0] - 1.0))
    left.loglog(run.t[1:], np.maximum(distance[1:], 1e-17), label=name)
    right.loglog(run.t[1:], error[1:], label=name)
    print(
        f"{name:27} off the sphere by {distance.max():.1e} m, "
        f"energy wrong by {error[-1]:.1e} of its size"
    )
left.set(ylabel="distance from the sphere (m)", xlabel="time $t$ (s)")
right.set(ylabel="largest relative error\nof the energy so far", xlabel="time $t$ (s)")
lm.plots.legend(left, loc="center right")
figure.savefig("index_reduction.png", dpi=200)
