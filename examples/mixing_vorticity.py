"""Ideal flow on the sphere: eddies draw each other out into filaments, and all moments of the vorticity stay."""

import matplotlib.pyplot as plt
import numpy as np

import liemech as lm

sphere, rng = lm.models.ZeitlinSphere(64), np.random.default_rng(3)
eddies = {(l, m): rng.normal() / l for l in range(2, 13) for m in range(-l, l + 1)}
start = sphere.from_harmonics(eddies)
h = 0.4 * sphere.hbar
run = lm.integrate(
    sphere, lm.Isospectral(order=2), start, h=h, steps=1800, every=600, progress=False
)
print(run)
print(run.drift())
levels = sphere.levels(run.mu[[0, -1]])
print(f"the 64 values of the vorticity move by {np.abs(levels[1] - levels[0]).max():.1e}")

latitude, longitude = np.linspace(-np.pi / 2, np.pi / 2, 181), np.linspace(-np.pi, np.pi, 361)
figure, frames = plt.subplots(2, 2, figsize=(8, 4.4), subplot_kw={"projection": "mollweide"})
for axes, t, mu in zip(frames.flat, run.t, run.mu):
    picture = sphere.vorticity(mu, latitude, longitude)
    axes.pcolormesh(longitude, latitude, picture, cmap="RdBu_r", vmin=-2, vmax=2, shading="gouraud")
    axes.set(title=f"t = {t:.1f}", xticks=[], yticks=[])
figure.tight_layout()
figure.savefig("mixing_vorticity.png", dpi=90)
