"""Generating functions in R^2n: how the pendulum's curves fare under Hamilton-Jacobi methods of
order 1 to 4, at a large step.

The exact curves are drawn below, in grey.
"""

import numpy as np

import liemech as lm

pendulum, h = lm.models.Pendulum(gravity=1.0), 0.5
starts = [(0.0, p) for p in (0.6, 1.2, 1.7)] + [(-np.pi, 0.7), (np.pi, -0.7)]
figure, panels = lm.plots.subplots(1, 4, figsize=(11.0, 3.2), sharey=True)
for ax, order in zip(panels, (1, 2, 3, 4)):
    worst = 0.0
    for q, p in starts:
        start = pendulum.state(q, p)
        exact = pendulum.exact(start, np.linspace(0.0, 25.0, 2000))
        run = lm.integrate(pendulum, lm.HamiltonJacobi(order), start, h=h, steps=200)
        worst = max(worst, np.abs(run.energy - run.energy[0]).max())
        for states, look in (
            (exact, {"color": "0.75", "markersize": 1.0}),
            (run, {"markersize": 2.5}),
        ):
            angle = (np.asarray(states.q)[:, 0] + np.pi) % (2.0 * np.pi) - np.pi
            ax.plot(angle, np.asarray(states.p)[:, 0], ".", **look)
    print(f"order {order}: the energy stays within {worst:.1e}")
    ax.set(title=f"order {order}, $h = {h}$", xlabel="$q$", xlim=(-np.pi, np.pi), ylim=(-2.6, 2.6))
panels[0].set_ylabel("$p$")
lm.plots.save(figure, "pendulum_curves.png")
