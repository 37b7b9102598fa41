"""Lie-Poisson Hamilton-Jacobi methods on the momentum sphere: the first kind, Algorithm 1, and the
second kind of order 4.

The body and the start are those of the article.
"""

import warnings

import numpy as np

import liemech as lm

with warnings.catch_warnings():
    # no body of positive masses has these moments
    warnings.simplefilter("ignore", lm.errors.InertiaWarning)
    body = lm.RigidBody([2 / 3, 1.0, 2.0])
start, h, steps = body.state(mu=[0.5, 0.0, 0.75**0.5]), 0.5, 200
exact = body.exact(start, h * np.arange(steps + 1)).mu
around = body.exact(start, np.linspace(0.0, body.period(start), 400)).mu
methods = {
    "first kind, order 1": lm.FirstKindHamiltonJacobi(1),
    "first kind, order 2": lm.FirstKindHamiltonJacobi(2),
    "Algorithm 1 = second kind, 2": lm.CovariantVariational(),
    "second kind, order 4": lm.LiePoissonHamiltonJacobi(order=4),
}
panels = []
for title, method in methods.items():
    run = lm.integrate(body, method, start, h=h, steps=steps)
    off, energy = np.abs(run.mu - exact).max(), np.abs(run.energy - run.energy[0]).max()
    print(f"{title:<30} momentum off by {off:.1e}, energy by {energy:.1e}")
    panels.append(
        (title, run.mu, f"energy within {energy:.1g}\nmomentum within {off:.1g}", exact[-1])
    )
lm.plots.save(
    lm.plots.figure_one(panels, around, body.inertia), "kinds_of_generating_functions.png"
)
