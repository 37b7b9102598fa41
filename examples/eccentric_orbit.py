"""A comet's ellipse, e = 0.9, in steps that follow its speed: where they fall, and what becomes of the energy."""

import sys

import numpy as np

import liemech as lm

planets = lm.Kepler()
start = planets.pericentre(eccentricity=0.9)
choices = {
    "3: as much change in each step": (lm.time_scales.EqualChange(), 15.25),
    "4: as much way in each step": (lm.time_scales.EqualPath(), 3.314),
}

figure, axes = lm.plots.subplots(2, 3, figsize=(11, 5.2), gridspec_kw={"width_ratios": [1.4, 1, 1]})
for row, (name, (sigma, period)) in zip(axes, choices.items(), strict=True):
    symplectic = lm.TimeTransformed(planets, sigma), lm.AdaptiveVerlet()
    reversible = planets, lm.ReversibleController(lm.StormerVerlet(), sigma)
    few = lm.integrate(*symplectic, start, h=period / 500, steps=500, every=8).q
    row[0].plot(few[:, 0], few[:, 1], "o-", color="black", markersize=3, linewidth=0.6)
    row[0].plot(0.0, 0.0, "*", color=lm.plots.COLORS[1], markersize=12)
    row[0].set(aspect="equal", title=f"choice {name}", xlabel="$x$", ylabel="$y$")
    for label, (system, method) in {"symplectic": symplectic, "reversible": reversible}.items():
        run = lm.integrate(system, method, start, h=period / 500, steps=5000)
        error = run.energy - run.energy[0]
        row[1].plot(run.t / (2.0 * np.pi), error, linewidth=0.8, label=label)
        row[2].semilogy(
            run.t[1:501] / (2.0 * np.pi), np.diff(run.t[:501]), linewidth=1.2, label=label
        )
        print(
            f"{name:<30} {label:<10} max |H - H0| = {np.abs(error).max():.1e} in {run.t[-1] / 2 / np.pi:.2f} periods"
        )
    row[1].set(xlabel="time $t$ (periods)", title="500 steps a period", ylabel="$H - H_0$")
    row[2].set(xlabel="time $t$ (periods)", ylabel="step $h$ in time")
    row[2].tick_params(which="minor", labelleft=False)
    lm.plots.legend(row[1], loc="upper right", ncols=2)
    row[1].margins(y=0.25)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "eccentric_orbit.png", dpi=200)
