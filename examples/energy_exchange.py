"""Fermi, Pasta and Ulam: the energy of a chain wanders from its first mode to others, and comes
back, instead of spreading out.
"""

import numpy as np

import liemech as lm

chain = lm.models.FermiPastaUlam(particles=32, alpha=0.25)
start = chain.mode(1, amplitude=4.0)
period = np.pi / np.sin(np.pi / 66)  # of the first mode
run = lm.integrate(
    chain, lm.StormerVerlet(), start, h=0.1, steps=120_000, every=120, progress=False
)

energies = chain.mode_energies(run.q, run.p)
share = energies[:, 0] / energies[0, 0]
home = np.argmax(np.where(run.t > 80 * period, share, 0.0))  # the first return, not the start
print(run.drift())
print(
    f"after {run.t[home] / period:.0f} periods {100 * share[home]:.1f} "
    "percent of the energy are back in the first mode"
)
print(f"in between it had {100 * share[:home].min():.0f} percent")

figure, (axis, below) = lm.plots.subplots(2, 1, figsize=(7, 4.6), sharex=True, height_ratios=(3, 1))
for k in range(5):
    axis.plot(run.t / period, energies[:, k], linewidth=1.2, label=f"mode {k + 1}")
axis.set(ylabel="energy $E_k$ of a mode", title=r"32 masses on springs, $\alpha = 1/4$")
lm.plots.legend(axis, frameon=False, ncols=5, loc="upper center", fontsize=8)
axis.set_ylim(top=1.18 * energies[0, 0])
below.plot(run.t / period, run.energy / run.energy[0] - 1.0, color="0.4", linewidth=0.8)
below.set(
    xlabel="time $t$ (periods of the first mode)",
    ylabel="$H/H_0 - 1$",
    xlim=(0.0, run.t[-1] / period),
)
figure.savefig("energy_exchange.png", dpi=200)
