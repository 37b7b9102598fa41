"""Ideal flow on the sphere, in a page that moves: eddies draw each other out into filaments; all moments of vorticity stay."""

import numpy as np

import liemech as lm

sphere, rng = lm.models.ZeitlinSphere(64), np.random.default_rng(3)
eddies = {(l, m): rng.normal() / l for l in range(2, 13) for m in range(-l, l + 1)}
start = sphere.from_harmonics(eddies)
h = 0.4 * sphere.hbar
run = lm.integrate(
    sphere, lm.Isospectral(order=2), start, h=h, steps=1800, every=30, progress=False
)
print(run)
print(run.drift())
levels = sphere.levels(run.mu[[0, -1]])
print(f"the 64 values of the vorticity move by {np.abs(levels[1] - levels[0]).max():.1e}")

lm.viewer.Scene(run, title="Eddies on the sphere", view=(-60.0, 20.0)).save("mixing_vorticity.html")
latitude, longitude = np.linspace(-np.pi / 2, np.pi / 2, 121), np.linspace(-np.pi, np.pi, 241)
figure, frames = lm.plots.subplots(1, 4, figsize=(9.6, 2.7))
for ax, k in zip(frames, (0, 20, 40, 60)):
    picture = sphere.vorticity(run.mu[k], latitude, longitude)
    title = f"$t$ = {run.t[k]:.1f} s"
    lm.plots.field(picture, latitude, longitude, ax=ax, most=2.0, title=title)
lm.plots.save(figure, "mixing_vorticity.png")
