"""A trapped particle in a tokamak: Boris' method and a Poisson splitting gyrate for long along the
banana of its guiding centre.
"""

import numpy as np

import liemech as lm

particle = lm.models.ChargedParticle(lm.models.TokamakField())
start = particle.state([1.05, 0.0, 0.0, 0.0, 4.816e-4, -2.059e-3])
h, steps = np.pi / 10, 400_000  # twenty steps in a gyration
centre, begin = lm.models.GuidingCentre.of_particle(particle, start.y)
guide = lm.integrate(centre, lm.RKMK(order=6), centre.state(begin), h=50.0, steps=900)


def draw(axis, orbit, **look):
    """The orbit in the plane of R and z."""
    axis.plot(np.hypot(orbit.y[:, 0], orbit.y[:, 1]), orbit.y[:, 2], **look)


figure, axes = lm.plots.subplots(1, 3, figsize=(10, 3.8), sharex=True, sharey=True)
methods = {
    "Boris": lm.Boris(),
    "Splitting(order=2), a Poisson map": lm.Splitting(order=2),
    "Runge-Kutta, order 4": lm.RKMK(order=4),
}
for axis, (name, method) in zip(axes, methods.items()):
    run = lm.integrate(particle, method, start, h=h, steps=steps, every=20)
    change = np.abs(run.energy / run.energy[0] - 1.0).max()
    defect = lm.poisson_defect(method, particle, start, h)
    print(f"{name:34} Poisson defect {defect:.0e}, largest error of the energy {change:.0e}")
    draw(axis, run, color=lm.plots.COLORS[0], linewidth=0.3)
    draw(axis, guide, color=lm.plots.COLORS[1], linewidth=1.2)
    axis.set(title=name, xlabel="$R$ (m)", aspect="equal", xticks=[0.95, 1.0, 1.05])
axes[0].set_ylabel("$z$ (m)")
figure.savefig("banana_orbit.png", dpi=200)
