"""A rubber rod is let go level and swings under its weight: explicit steps, and steps ten times as
long that solve for all frames together.
"""

import numpy as np

import liemech as lm

rubber = lm.models.RodSection.round(radius=0.01, young=2e6, density=1100.0, poisson=0.49)
rod = lm.models.CosseratRod(rubber, length=1.0, elements=60, gravity=9.81)
level = [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]  # e3 of the rod along x
start = rod.at_rest(rod.shape(start=level))
h = 0.2 * rod.length / rod.elements * np.sqrt(rubber.inertia[5] / rubber.stiffness[5])
every, steps = 100, 12_000
explicit = lm.integrate(rod, lm.KickDrift(), start, h=h, steps=steps, every=every)
method = lm.GalerkinVariational(order=2)
run = lm.integrate(rod, method, start, h=10 * h, steps=steps // 10, every=every // 10)
figure, (left, right) = lm.plots.subplots(1, 2, figsize=(7.2, 3.8))
for k, g in enumerate(explicit.g[::10]):
    shade = str(0.85 - 0.07 * k)
    left.plot(g[:, 0, 3], g[:, 2, 3], color=shade)
left.plot(*explicit.g[:, -1, [0, 2], 3].T, ":", linewidth=1)
left.set(xlabel="$x$ (m)", ylabel="height $z$ (m)", aspect="equal")
right.plot(explicit.t, rod.wrenches(explicit.g)[:, 0, 1], label="explicit, h")
right.plot(run.t[::4], rod.wrenches(run.g)[::4, 0, 1], ".", label=f"{method.name}, 10 h")
right.set(xlabel="time $t$ (s)", ylabel="moment at the wall (N m)")
lm.plots.legend(right)
for name, one in (("explicit", explicit), ("implicit", run)):
    band = np.ptp(one.energy) / np.abs(rod.potential.energy(one.g[-1]) - one.energy[0])
    print(f"{name}: energy to {band:.0e} of what the rod falls, tip at {one.g[-1, -1, [0, 2], 3]}")
figure.savefig("rubber_rod.png", dpi=200)
lm.viewer.Scene(explicit, title="A rubber rod").save("rubber_rod.html", compressed=True)
