"""An upright top sleeps while it spins fast, and falls below a threshold: growth rates of its relative equilibrium, and
the closed form.
"""

import numpy as np

import liemech as lm

A, weight, length = 1.0, 0.8, 1.0
top = lm.models.LagrangeTop(transverse=A, axial=0.6, weight=weight, length=length)
threshold = 2.0 * np.sqrt(A * weight * length)
spins = np.linspace(0.0, 1.4, 29) * threshold
upright = [
    lm.relative_equilibrium(top, top.state(mu=[0.0, 0.0, spin], g=np.eye(3))) for spin in spins
]
growth = np.array([found.growth for found in upright])
exact = np.sqrt(np.maximum(weight * length / A - (spins / (2.0 * A)) ** 2, 0.0))
print(f"largest difference from the closed form {np.abs(growth - exact).max():.1e} per second")
print(upright[-1])

figure, ax = lm.plots.subplots()
fine = np.linspace(0.0, spins[-1], 400)
ax.plot(
    fine,
    np.sqrt(np.maximum(weight * length / A - (fine / (2.0 * A)) ** 2, 0.0)),
    color="0.6",
    label="closed form",
)
for verdict in ("unstable", "spectrally stable", "stable"):
    chosen = [found.verdict == verdict for found in upright]
    if any(chosen):
        ax.plot(spins[chosen], growth[chosen], "o", markersize=4, label=verdict)
ax.axvline(threshold, color="0.8", linewidth=1)
ax.set(xlabel=r"spin $\mu_3$ (kg m$^2$/s)", ylabel="growth (1/s)")
lm.plots.legend(ax)
lm.plots.save(figure, "sleeping_top.png")
