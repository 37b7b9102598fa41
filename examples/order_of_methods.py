"""The order of a method is the slope of its error: four methods on one body, and what the same
accuracy costs in steps.
"""

import numpy as np

import liemech as lm

body = lm.RigidBody([1.0, 1.5, 2.0])
start, end = body.state(mu=[0.5, 0.0, 0.75**0.5]), 8.0
exact, counts = body.exact(start, end).mu, 2 ** np.arange(3, 9)
methods = {
    "Algorithm 1": lm.CovariantVariational(),
    "Hamilton-Jacobi 4": lm.LiePoissonHamiltonJacobi(order=4),
    "RKMK4": lm.RKMK(order=4),
    "RKMK6": lm.RKMK(order=6),
}
errors = {}
for name, method in methods.items():
    runs = (
        lm.integrate(body, method, start, h=end / n, steps=int(n), every=int(n)) for n in counts
    )
    errors[name] = [np.abs(run.mu[-1] - exact).max() for run in runs]
    print(
        f"{name:<22} order {lm.plots.order_of(end / counts, errors[name]):.2f}, error with 256 "
        f"steps {errors[name][-1]:.1e}"
    )
ax = lm.plots.orders(
    end / counts, errors, title="a free rigid body, t = 8", ylabel="error of the momentum"
)
lm.plots.save(ax.figure, "order_of_methods.png")
