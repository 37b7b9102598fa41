"""Magnons: the waves of a ferromagnetic ring in its noise, beside their frequencies in closed form."""

import numpy as np

import liemech as lm


@lm.record
class Exchange(lm.Term):
    def energy(self, a, b):
        return -lm.dot(a.mu, b.mu)


n, h, samples = 256, 0.75, 1024
spins = lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(Exchange().over(lm.neighbours.ring(n))))
x, y = np.random.default_rng(1).normal(size=(2, n), scale=0.01)
start = spins.state(mu=np.stack([x, y, np.sqrt(1.0 - x**2 - y**2)], axis=1))
run = lm.integrate(spins, lm.SublatticeSplitting(), start, h=h, steps=samples - 1, progress=False)

wave = (run.mu[..., 0] + 1j * run.mu[..., 1]) * np.blackman(samples)[:, None]
power = np.fft.fftshift(np.abs(np.fft.fft2(wave)) ** 2)  # of frequency and wave number
k, omega = (2.0 * np.pi * np.fft.fftshift(np.fft.fftfreq(*x)) for x in ((n,), (samples, h)))
exact, of_step = 2.0 - 2.0 * np.cos(k), 2.0 - 2.0 / h * np.arcsin(np.cos(k) * np.sin(h))
near = np.abs(omega[:, None] - of_step) < 0.3  # not the other eigenvalue of the step
peaks = omega[np.where(near, power, 0.0).argmax(axis=0)]
print(f"the energy {run.energy[0]:.2f} changes by {np.ptp(run.energy):.1e}")
print(f"frequencies are {np.abs(peaks - of_step).max():.3f} from those of the step")
print(f"and {np.abs(peaks - exact).max():.3f} from those of the equations")

figure, axis = lm.plots.subplots(figsize=(6.4, 4.4))
axis.pcolormesh(k, omega, np.log10(power / power.max()), vmin=-7, cmap="magma", rasterized=True)
half = k >= 0.0
axis.plot(k[half], exact[half], ":", color="white", linewidth=1.2, label=r"$2 J (1 - \cos k)$")
axis.plot(k[half], of_step[half], "--", color="cyan", linewidth=1.2, label="of the step")
axis.text(0.0, 2.4, "faint: the other\neigenvalue of the step", color="white", ha="center")
axis.set(xlabel="wave number $k$", ylabel=r"frequency $\omega/J$", ylim=(-0.15, 4.18))
axis.legend(loc="lower right", fontsize=8, facecolor="0.35", labelcolor="white")
figure.savefig("magnons.png", dpi=200)
