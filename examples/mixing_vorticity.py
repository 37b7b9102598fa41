"""Ideal flow on the sphere as a film: eddies draw each other out into filaments, and all moments of the vorticity stay."""

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter

import liemech as lm

sphere, rng = lm.models.ZeitlinSphere(64), np.random.default_rng(3)
eddies = {(l, m): rng.normal() / l for l in range(2, 13) for m in range(-l, l + 1)}
start = sphere.from_harmonics(eddies)
h = 0.4 * sphere.hbar
run = lm.integrate(
    sphere, lm.Isospectral(order=2), start, h=h, steps=1800, every=45, progress=False
)
print(run)
print(run.drift())
levels = sphere.levels(run.mu[[0, -1]])
print(f"the 64 values of the vorticity move by {np.abs(levels[1] - levels[0]).max():.1e}")

latitude, longitude = np.linspace(-np.pi / 2, np.pi / 2, 121), np.linspace(-np.pi, np.pi, 241)
pictures = [sphere.vorticity(mu, latitude, longitude) for mu in run.mu]
figure, frames = lm.plots.subplots(1, 4, figsize=(9.6, 2.7))
for ax, k in zip(frames, (0, 14, 27, 40)):
    title = f"t = {run.t[k]:.1f}"
    lm.plots.field(pictures[k], latitude, longitude, ax=ax, most=2.0, title=title)
lm.plots.save(figure, "mixing_vorticity.png", dpi=90)


def frame(k: int) -> None:
    ax.clear()
    lm.plots.field(pictures[k], latitude, longitude, ax=ax, most=2.0, title=f"t = {run.t[k]:.1f}")


figure, ax = lm.plots.subplots(figsize=(3.2, 3.4))
film = FuncAnimation(figure, frame, frames=len(pictures))
film.save("mixing_vorticity.gif", PillowWriter(fps=8), dpi=64)
