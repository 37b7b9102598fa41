"""A satellite stops tumbling by coils in the Earth's magnetic field, m = -k dB/dt: a law of control
in two lines.
"""

import numpy as np

import liemech as lm

K, R, models = 3.986004418e14, 6.3781363e6, lm.models


@lm.record
class BDot(models.MagneticTorquers):
    gain: float = 0.0

    def moment_at(self, here, B):  # in the body dB/dt is B x w, but for what the orbit adds
        return -self.gain * np.cross(B, here.rate)


def rate(t, state):
    """The angular velocity in degrees a second."""
    return 57.29577951308232 * craft.velocity(state.mu)[0:3]


earth = models.DipoleField(strength=7.7e15, axis=[0.0, 0.6 * 0.28, -((1 - 0.168**2) ** 0.5)])
effectors = [models.PointGravity(K), models.GravityGradient(K), BDot(earth, gain=5e4, limit=0.2)]
craft = models.Spacecraft(inertia=[0.05, 0.06, 0.02], mass=5.0, effectors=effectors)
v = np.sqrt(K / (R + 5e5)) * np.array([0.0, np.cos(1.7), np.sin(1.7)])
start = craft.state_of([R + 5e5, 0.0, 0.0], v, rate=[0.15, -0.1, 0.2])
run = lm.integrate(craft, lm.RKMK(order=4), start, h=0.5, steps=12_000, every=20, record=[rate])
for k in 0, 100, 300, 600:
    print(f"after {run.t[k]:5.0f} s: {np.linalg.norm(run.rate[k]):6.3f} degrees a second")
figure, ax = lm.plots.subplots(figsize=(6.6, 3.4))
ax.plot(run.t, run.rate, label=[f"about axis {k}" for k in (1, 2, 3)])
ax.set(xlabel="time $t$ (s)", ylabel="rate (degrees/s)"), lm.plots.legend(ax)
lm.plots.save(figure, "detumbling.png")
