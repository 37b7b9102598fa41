"""A trefoil of rubber is let go.  Its frames gain in twist what its axis loses in writhe (Calugareanu),
until it passes through itself.
"""

import numpy as np

import liemech as lm

N, L, a = 150, 1.0, np.linspace(0.0, 2.0 * np.pi, 20_001)
knot = np.array([np.sin(a) + 2 * np.sin(2 * a), np.cos(a) - 2 * np.cos(2 * a), -np.sin(3 * a)])
arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(knot), axis=0)))
rubber = lm.models.RodSection.round(radius=0.004, young=2e6, density=1100.0, poisson=0.49)
rod = lm.models.CosseratRod(rubber, L, N, closed=True)
frames = rod.along(lambda s: [L / arc[-1] * np.interp(s / L * arc[-1], arc, x) for x in knot])
h = 0.4 * L / N * np.sqrt(rubber.inertia[5] / rubber.stiffness[5])
run = lm.integrate(rod, lm.KickDrift(), rod.at_rest(frames), h=h, steps=1800, every=20)


def writhe(x):  # Gauss's integral over all pairs of elements
    edge = np.roll(x, -1, axis=0) - x
    r = (x + 0.5 * edge)[:, None] - (x + 0.5 * edge) + np.eye(N)[:, :, None]
    solid = (np.cross(edge[:, None], edge) * r).sum(axis=2) / np.linalg.norm(r, axis=2) ** 3
    return solid.sum() / (4.0 * np.pi)


of_axis = np.array([writhe(g[:, :3, 3]) for g in run.g])
twist = rod.strains(run.g)[..., 2].mean(axis=1) * L / (2.0 * np.pi)
print("writhe + twist until it meets itself:", (of_axis + twist)[:60].mean().round(2))
figure, (left, right) = lm.plots.subplots(1, 2, figsize=(8.4, 3.6))
for k, at in enumerate((0, 40, 60)):
    x, y, z = run.g[at, :, :3, 3].T
    left.scatter(x + 0.24 * k, y, c=z, s=14, cmap="copper")
    left.text(0.24 * k, -0.16, f"{run.t[at]:.2f} s", ha="center")
left.set(xlabel="x (m), from above, light is up", yticks=[], aspect="equal", ylim=(-0.2, 0.2))
right.plot(run.t, np.array([of_axis, twist]).T, label=["writhe", "twist"])
right.plot(run.t, of_axis + twist, "--", color="#1a1a1a", label="their sum")
right.annotate("through itself", (0.082, 0.0), (0.02, 1.2), arrowprops={"arrowstyle": "->"})
right.set(xlabel="time t (s)", ylabel="turns"), lm.plots.legend(right)
lm.plots.save(figure, "trefoil.png")
