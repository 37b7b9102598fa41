"""Hares and foxes: a Poisson integrator keeps their orbits closed, Euler's methods spiral, outwards
or inwards.
"""

import sys

import numpy as np

import liemech as lm

species = lm.models.LotkaVolterra()  # u' = u (v - 2), v' = v (1 - u), H = u - ln u + v - 2 ln v
start = species.state([1.5, 1.0])
outwards, inwards = lm.RKMK(order=1), lm.RKMK(tableau=lm.tableaus.IMPLICIT_EULER)
methods = {
    "explicit Euler": outwards,
    "implicit Euler": inwards,
    "symplectic Euler, a Poisson map": lm.PoissonEuler(),
}

for name, method in methods.items():
    run = lm.integrate(species, method, start, h=0.05, steps=400, progress=False)
    print(
        f"{name:32}Poisson defect "
        f"{lm.poisson_defect(method, species, start, 0.05):.0e}, {run.drift()['energy']}"
    )

figure, axes = lm.plots.subplots(1, 3, figsize=(10, 3.6), sharex=True, sharey=True)
u, v = np.meshgrid(np.linspace(0.05, 3.6, 200), np.linspace(0.2, 5.4, 200))
levels = species.energy(np.stack([u, v], axis=-1))
for axis, (name, method) in zip(axes, methods.items()):
    run = lm.integrate(species, method, start, h=0.05, steps=400, progress=False)
    axis.contour(u, v, levels, levels=[1.65, 1.8, 2.0945, 2.5, 3.0], colors="0.8", linewidths=0.8)
    axis.plot(run.y[:, 0], run.y[:, 1], ".-", color=lm.plots.COLORS[0], markersize=3, linewidth=0.7)
    axis.plot(*start.y, "o", color="black", markersize=4)
    axis.set(title=name, xlabel="prey $u$", xlim=(0.0, 3.6), ylim=(0.2, 5.4))
axes[0].set_ylabel("predators $v$")
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "lotka_volterra.png", dpi=200)
