"""The binary asteroid 1999 KW4: Beta swings about the line to Alpha while both orbit and spin, and
energy and angular momentum stay.
"""

import numpy as np

import liemech as lm

hour = 3600.0
pair, start = lm.models.GravitatingBodies.asteroid_1999_kw4(tilt=0.05, libration=0.1)
run = lm.integrate(pair, lm.KickDrift(order=8), start, h=0.5 * hour, steps=3000, progress=False)
print(run.drift())

line = run.g[:, 0, 9:] - run.g[:, 1, 9:]  # from Beta to Alpha
seen = np.einsum("nji,nj->ni", run.g[:, 1, :9].reshape(-1, 3, 3), line)  # in the axes of Beta
angle = np.degrees(np.arctan2(seen[:, 1], -seen[:, 0]) + 0.0)
angle -= 360.0 * np.round(angle / 360.0)
angle = np.where(np.abs(angle) > 90.0, angle - 180.0 * np.sign(angle), angle)
print(f"Beta swings by {np.abs(angle).max():.2f} degrees; the distance is between "
      f"{np.linalg.norm(line, axis=1).min():.0f} and {np.linalg.norm(line, axis=1).max():.0f} m")  # fmt: skip

figure, (left, right) = lm.plots.subplots(1, 2, figsize=(9.6, 3.6))
some = run.t < 150 * hour
left.plot(run.t[some] / hour, angle[some])
left.set(xlabel="time $t$ (h)", ylabel="long axis off the line (degrees)", title="Beta swings")
pole = run.g[:, 0, :9].reshape(-1, 3, 3)[:, :, 2]
right.plot(np.degrees(pole[:, 0]), np.degrees(pole[:, 1]))
right.set(
    xlabel="pole of Alpha, $x$ (degrees)",
    ylabel="$y$ (degrees)",
    title="Alpha's axis goes round",
    aspect="equal",
)
lm.plots.save(figure, "binary_asteroid.png")
