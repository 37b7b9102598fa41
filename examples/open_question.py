"""Algorithm 1 is the second-kind Lie-Poisson Hamilton-Jacobi method with s = h H: docs/hamilton_jacobi.md."""

import numpy as np

import liemech as lm

body = lm.RigidBody([1.0, 1.5, 2.0])
start = body.state(mu=[0.5, 0.0, 0.75**0.5])
variational = lm.CovariantVariational()
rivals = {
    r"second kind, $s = hH$": lm.LiePoissonHamiltonJacobi(order=2),
    r"second kind, $s = hH + h^3 s_3/6$": lm.LiePoissonHamiltonJacobi(order=4),
    r"first kind, $S_0 = (\xi, \xi)/2$": lm.FirstKindHamiltonJacobi(order=2, scale=1.0),
}
steps, t_end = 2.0 ** -np.arange(1.0, 7.0), 8.0


def momentum_after(n, method, h):
    return lm.integrate(body, method, start, h=h, steps=n, progress=False).mu[-1]


def far(method, mu, n):
    """How far the method is from the momenta mu, for every step."""
    return [np.abs(momentum_after(k, method, h) - m).max() for h, m, k in zip(steps, mu, n)]


once, many = [1] * 6, [round(t_end / h) for h in steps]
algorithm_1 = [momentum_after(1, variational, h) for h in steps]
exact = [body.exact(start, t_end).mu] * 6
gaps = {name: np.maximum(far(method, algorithm_1, once), 1e-17) for name, method in rivals.items()}
errors = {name: far(method, exact, many) for name, method in rivals.items()}
for name in rivals:
    print(f"{name:36} one step of 1/16 is {gaps[name][3]:.0e} from Algorithm 1")
figure, (left, right) = lm.plots.subplots(1, 2, figsize=(9.0, 4.0))
lm.plots.orders(steps, gaps, ax=left, title="Distance from Algorithm 1 after one step", ylabel="")
right.loglog(steps, far(variational, exact, many), "0.6", linewidth=5, label="Algorithm 1")
lm.plots.orders(steps, errors, ax=right, title="Error of the momentum at $t = 8$", ylabel="")
figure.savefig("open_question.png", dpi=200)
