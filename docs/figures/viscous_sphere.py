"""The picture of viscous flow beside ideal flow on the page on large groups: python docs/figures/viscous_sphere.py"""

from pathlib import Path

import numpy as np

import liemech as lm

sphere, rng = lm.models.ZeitlinSphere(64), np.random.default_rng(3)
eddies = {(l, m): rng.normal() / l for l in range(2, 13) for m in range(-l, l + 1)}
viscous = lm.models.ViscousSphere(sphere, viscosity=3e-4)
latitude, longitude = np.linspace(-np.pi / 2, np.pi / 2, 121), np.linspace(-np.pi, np.pi, 241)

figure, axes = lm.plots.subplots(2, 4, figsize=(9.6, 5.2))
for row, system, method, name in (
    (axes[0], sphere, lm.Isospectral(order=2), "ideal"),
    (axes[1], viscous, lm.DissipativeSplitting(lm.Isospectral(order=2)), "viscous"),
):
    start = system.from_harmonics(eddies)
    run = lm.integrate(system, method, start, h=0.4 * sphere.hbar, steps=1800, every=45)
    print(run.drift())
    enstrophy = sphere.enstrophy(run.mu)
    for ax, k in zip(row, (0, 14, 27, 40), strict=True):
        title = f"{name}, t = {run.t[k]:.1f}, enstrophy {enstrophy[k]:.2f}"
        picture = sphere.vorticity(run.mu[k], latitude, longitude)
        lm.plots.field(picture, latitude, longitude, ax=ax, most=2.0, title=title)
        ax.title.set_fontsize(8.5)
lm.plots.save(figure, Path(__file__).with_suffix(".png"))
