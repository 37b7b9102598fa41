"""A satellite is turned to its target by a PD controller at 1 kHz, with four native steps to each
command: in time, and with commands that arrive late.
"""

import numpy as np

import liemech as lm


@lm.record
class Wheels(lm.Force):
    torque: lm.Vec

    def covector(self, t, xi, g):
        return self.torque


inertia, period, rest = np.array([10.0, 15.0, 20.0]), 1e-3, np.zeros(3)
body = lm.MechanicalSystem(lm.RigidBody(inertia), lm.NoPotential(), load=Wheels(rest))
start = body.state(xi=[0.1, -0.05, 0.2], g=lm.SO3().exp([1.0, 1.2, -0.8]))
loop = lm.Plan(body, lm.RKMK(order=4), h=period / 4).stepper(start)
figure, (upper, lower) = lm.plots.subplots(2, figsize=(5.2, 4.6), sharex=True)
for late in 0, 400, 800:  # looks
    loop.reset()
    latency, limit = lm.loops.Latency(late, rest), lm.loops.RateLimit(5.0, period, rest)
    t, away, torque = np.empty(20_000), np.empty((20_000, 3)), np.empty((20_000, 3))
    for k in range(len(t)):
        g = loop.g - loop.g.T
        away[k] = 0.5 * g[2, 1], 0.5 * g[0, 2], 0.5 * g[1, 0]
        command = np.clip(-inertia * (0.8 * away[k] + 1.2 * loop.mu / inertia), -5.0, 5.0)
        torque[k], t[k] = limit(latency(command)), loop.t
        loop.step(4, torque=torque[k])
    upper.semilogy(t, np.linalg.norm(away, axis=1), label=f"{late * period:g} s late")
    lower.plot(t, torque[:, 0])
    print(f"{late * period:g} s late: {np.linalg.norm(away[-1]):.0e} rad away after {loop.t:.0f} s")
upper.set(ylabel="angle to the target (rad)"), lm.plots.legend(upper)
lower.set(xlabel="time $t$ (s)", ylabel="torque (N m)")
lm.plots.save(figure, "attitude_control.png")
