"""Kapitza's pendulum: a rod whose support is shaken fast enough stands on it, upside down."""

import numpy as np

import liemech as lm

length, frequency, g = 0.3, 120.0, 9.80665  # m, rad/s, m/s^2
rod = lm.joints.chain(1, mass=0.2, length=length, radius=0.01, axis=[0.0, 1.0, 0.0])
reduced = 2.0 / 3.0 * length  # of a mathematical pendulum
least = np.sqrt(2.0 * g * reduced) / frequency  # of amplitudes at which upright is stable
figure, (left, right) = lm.plots.subplots(1, 2, figsize=(9.0, 3.2))
for part in (0.8, 1.2, 2.0):
    shaken = lm.joints.Shaking([0.0, 0.0, part * least], frequency, np.pi / 2)
    pendulum = lm.joints.Linkage(rod.links, rod.joints, motions={None: shaken})
    start = pendulum.state(angles={0: np.pi - 0.2})
    run = lm.integrate(pendulum, lm.LieRATTLE(), start, h=5e-4, steps=5000)
    tilt = np.degrees(run.joint(0).angle - np.pi)
    shown = np.where(np.maximum.accumulate(np.abs(tilt)) < 90.0, tilt, np.nan)  # until it falls
    left.plot(run.t, shown, label=f"{1e3 * part * least:.0f} mm")
    print(f"shaken by {1e3 * part * least:.0f} mm it tilts to {np.abs(tilt).max():.0f} degrees")
turns = int(2.0 * np.pi / frequency / 5e-4)  # steps of a shake, over which tilts are averaged
slow = np.convolve(tilt, np.ones(turns) / turns, "valid")
up = run.t[: len(slow) - 1][(slow[1:] > 0.0) & (slow[:-1] <= 0.0)]
averaged = np.sqrt((part**2 - 1.0) * g / reduced)
print(f"it swings in {np.diff(up).mean():.3f} s; by averaging in {2.0 * np.pi / averaged:.3f} s")
print(run.drift())
lm.plots.legend(left, loc="lower left")
left.set(xlabel="time $t$ (s)", ylabel="tilt from upright (degrees)", ylim=(-90.0, 90.0))
tip = run.g.reshape(-1, 4, 4) @ [0.0, 0.0, -0.5 * length, 1.0]
right.plot(tip[:900, 0], tip[:900, 2], linewidth=0.7)
right.set(xlabel="$x$ (m)", ylabel="$z$ (m)", title="path of the upper end")
lm.plots.save(figure, "kapitza.png")
some = lm.integrate(pendulum, lm.LieRATTLE(), start, h=5e-4, steps=1200, every=4)
lm.viewer.Scene(some, show="links", title="Kapitza's pendulum").save("kapitza.html")
