"""A free rigid body in four dimensions: six momenta, two Casimirs, and one more integral, which nobody told the method about."""

import itertools

import numpy as np

import liemech as lm

# a rotation turns a plane, 12, 13, 14, 23, 24 or 34, whose inertia is the sum of two second moments of mass
planes = list(itertools.combinations(range(4), 2))
moment = np.array([1.0, 1.5, 2.2, 3.0])
body = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy([moment[i] + moment[j] for i, j in planes]))

start = body.state(mu=[0.6, -0.3, 0.5, 0.4, 0.2, -0.7], g=np.eye(4))
run = lm.integrate(body, lm.CovariantVariational(lm.Cayley()), start, h=0.1, steps=20_000, every=20)
print(run)
print(run.drift(), end="\n\n")

a, b, c, d, e, f = run.mu.T
squares = np.array([moment[i] ** 2 + moment[j] ** 2 for i, j in planes])
for name, value in (
    ("|mu|^2", (run.mu**2).sum(axis=1)),
    ("Pfaffian", a * f - b * e + c * d),
    ("Manakov's integral", (squares * run.mu**2).sum(axis=1)),
):
    print(f"{name:<20} {value[0]:9.6f}, largest change {np.abs(value - value[0]).max():.1e}")

left_and_right = np.stack([a + f, b - e, c + d]), np.stack([a - f, b + e, c - d])
lengths = [np.linalg.norm(three, axis=0) for three in left_and_right]
halves = ", ".join(f"{x[0]:.6f} +- {np.ptp(x):.0e}" for x in lengths)
print("so(4) is so(3) twice; the lengths of its halves:", halves)
axes = lm.plots.invariants(run, title="a body in four dimensions")
lm.plots.save(axes.figure, "rotations_in_four_dimensions.png")
