"""A free body in ten dimensions: 45 momenta, and the 25 integrals that Manakov found, which make its motion regular."""

import numpy as np

import liemech as lm

body = lm.models.ManakovBody(np.linspace(1.0, 2.8, 10))
rng = np.random.default_rng(2)
start = body.state(mu=0.3 * rng.normal(size=45))
run = lm.integrate(
    body, lm.Isospectral(order=4), start, h=0.1, steps=20_000, every=20, progress=False
)
print(run)
integrals = body.integrals(run.mu)
change = np.ptp(integrals, axis=0) / np.abs(integrals).max(axis=0)
casimirs = np.array([j == 0 for _, j in body.pairs])
print(f"{len(body.pairs)} integrals, of which {casimirs.sum()} are Casimirs")
print(
    f"largest change of a Casimir {change[casimirs].max():.1e}, of another one {change[~casimirs].max():.1e}"
)
print(f"the energy changes by {np.ptp(run.energy) / run.energy[0]:.1e}")

figure, (left, right) = lm.plots.subplots(1, 2, figsize=(10.0, 4.0))
left.plot(run.mu[:, 0], run.mu[:, 9], ".", markersize=2, color=lm.plots.COLORS[0])
left.set(
    xlabel=r"$\mu_{12}$ (kg m$^2$/s)", ylabel=r"$\mu_{23}$ (kg m$^2$/s)", title="two of 45 momenta"
)
for values, casimir in zip(integrals.T, casimirs):
    off = np.maximum(np.abs(values / values[0] - 1.0), 1e-17)
    right.semilogy(run.t, off, color=lm.plots.COLORS[0 if casimir else 1], linewidth=0.5)
right.set(xlabel="time $t$ (s)", ylabel="relative change", ylim=(1e-17, 1e-4))
right.set(title="45 momenta, their integrals: Casimirs blue")
lm.plots.save(figure, "body_in_ten_dimensions.png")
