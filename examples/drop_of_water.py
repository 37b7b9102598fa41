"""A drop of 125 rigid water molecules falls together, from a lattice on which they are turned at
random: all pairs, no cutoff, and steps of four femtoseconds.
"""

import numpy as np

import liemech as lm

rng, side = np.random.default_rng(7), 5
water, sites = lm.models.SPC(), side**3  # angstrom, picoseconds, atomic masses
bodies = lm.LiePoissonSystem(lm.SE3() ** sites, lm.PerSite(water.kinetic_energy))
drop = lm.MechanicalSystem(bodies, lm.Terms(water.over(lm.neighbours.all_pairs())))
axis = 3.6 * (np.arange(side) - 0.5 * (side - 1))
poses = np.tile(np.eye(4), (sites, 1, 1))
poses[:, :3, :3] = lm.SO3().random(rng, sites)
poses[:, :3, 3] = np.stack(np.meshgrid(axis, axis, axis), -1).reshape(-1, 3)
start = drop.state(mu=np.zeros((sites, 6)), g=poses)

ways = {"order 2, 1 fs": (lm.KickDrift(), 0.001), "order 4, 4 fs": (lm.KickDrift(order=4), 0.004)}
figure, (left, right) = lm.plots.subplots(1, 2, figsize=(9.6, 4.0))
for name, (method, h) in ways.items():
    steps, every = round(1.0 / h), round(0.02 / h)
    run = lm.integrate(drop, method, start, h=h, steps=steps, every=every, progress=False)
    off = np.abs(run.energy / run.energy[0] - 1.0)
    print(f"{name}: the energy is off by {off.max():.1e}")
    right.semilogy(run.t[1:], off[1:], label=name)
right.set(xlabel="time $t$ (ps)", ylabel="relative error of the energy")
lm.plots.legend(right)
kelvin = (run.mu[-1] ** 2 / np.array(water.moments)).sum() / (6 * sites) / 0.8314462618
print(f"it has warmed itself to {kelvin:.0f} K")
g = run.g[-1]
atoms = g[:, None, :3, 3] + np.einsum("nij,aj->nai", g[:, :3, :3], np.array(water.atoms))
for molecule in atoms[np.argsort(-atoms[:, 0, 1])]:  # from the back to the front
    left.scatter(*molecule[1:, ::2].T, s=26, c="#c9ced8", edgecolors="#5f6672", linewidths=0.4)
    left.scatter(
        *molecule[0, ::2], s=110, c=lm.plots.COLORS[1], edgecolors="#1a1a1a", linewidths=0.4
    )
left.set(title="after a picosecond", xlabel="$x$ (\u212b)", ylabel="$z$ (\u212b)", aspect="equal")
lm.plots.save(figure, "drop_of_water.png")
