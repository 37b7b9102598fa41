"""A trapped particle in a tokamak: Boris' method and a Poisson splitting gyrate for long along the banana of its guiding centre."""

from typing import ClassVar

import matplotlib.pyplot as plt
import numpy as np

import liemech as lm


@lm.record
class Boris(lm.Method):
    """Half a way, a turn of the velocity by Cayley's map of the field there, half a way: keeps volumes, but is no Poisson map."""

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = False

    def step(self, system, t, state, h):
        y = state.y
        x, v = lm.vec(y[0], y[1], y[2]), lm.vec(y[3], y[4], y[5])
        middle = x + 0.5 * h * v
        b = 0.5 * h * system.field.at(middle)
        turned = v + 2.0 / (1.0 + lm.dot(b, b)) * lm.cross(v + lm.cross(v, b), b)
        return lm.PoissonState(lm.vec(*(middle + 0.5 * h * turned), *turned))


particle = lm.ChargedParticle(lm.TokamakField())
y = np.array([1.05, 0.0, 0.0, 0.0, 4.816e-4, -2.059e-3])
h, steps = np.pi / 10, 400_000
centre, begin = lm.GuidingCentre.of_particle(particle, y)
guide = lm.integrate(centre, lm.RKMK(order=6), centre.state(begin), h=50.0, steps=900, progress=False)

figure, axes = plt.subplots(1, 3, figsize=(10, 3.8), sharex=True, sharey=True, layout="constrained")
methods = {"Boris": Boris(), "Splitting(order=2), a Poisson map": lm.Splitting(order=2), "Runge-Kutta, order 4": lm.RKMK(order=4)}
for axis, (name, method) in zip(axes, methods.items()):
    run = lm.integrate(particle, method, particle.state(y), h=h, steps=steps, every=20, progress=False)
    change = np.abs(run.energy / run.energy[0] - 1.0)
    print(f"{name:34} Poisson defect {lm.poisson_defect(method, particle, particle.state(y), h):.0e}, ", end="")
    print(f"largest error of the energy {change.max():.0e}")
    for orbit, look in (run, {"color": "tab:blue", "linewidth": 0.3}), (guide, {"color": "tab:red", "linewidth": 1.2}):
        axis.plot(np.hypot(orbit.y[:, 0], orbit.y[:, 1]), orbit.y[:, 2], **look)
    axis.set(title=name, xlabel="R", aspect="equal", xticks=[0.95, 1.0, 1.05])
axes[0].set_ylabel("z")
figure.savefig("banana_orbit.png", dpi=90)
