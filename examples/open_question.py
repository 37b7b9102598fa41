"""Is Algorithm 1 a Lie-Poisson Hamilton-Jacobi method? Of the second kind it is, to rounding: docs/theory/hamilton_jacobi.md."""

import numpy as np
from matplotlib.figure import Figure

import liemech as lm
from liemech.plots import COLORS, save


@lm.record
class AxisByAxis(lm.Retraction):
    """A retraction of one's own, on every group: half a turn about each axis in order, and back."""

    def tau(self, group, xi):
        g = group.identity()
        for k in range(group.dim):
            half = group.exp(lm.vec(*[0.5 * xi[k] if i == k else 0.0 for i in range(group.dim)]))
            g = group.compose(half, group.compose(g, half))
        return g


@lm.record
class Affine(lm.MatrixLieGroup):
    """The maps x -> a x + b, from their generators."""

    @property
    def generators(self):
        return np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [0.0, 0.0]])


# 1. one step of both, h = 0.3, on six groups
rng, every = np.random.default_rng(1), (lm.SO3(), lm.SE3(), lm.SO(4), lm.SU(2), lm.Heisenberg(), Affine())
print(f"{'largest difference of one step':32}{'exp':>10}{'Cayley':>10}{'own':>10}")
for group in every:
    n, row = group.dim, ""
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(np.diag(np.linspace(1.0, 2.0, n)) + 0.1))
    start = system.state(rng.normal(size=n) / n**0.5, np.array(group.identity()))
    for tau in lm.Exponential(), lm.Cayley(), AxisByAxis():
        if tau == AxisByAxis() and n > 3:
            continue  # the same, but derivatives of products of six exponentials take a minute without native code
        methods = lm.CovariantVariational(tau), lm.LiePoissonHamiltonJacobi(order=2, retraction=tau)
        one, other = (lm.integrate(system, method, start, h=0.3, steps=1, compiled=False) for method in methods)
        row += f"{max(np.abs(one.mu - other.mu).max(), np.abs(one.g - other.g).max()):10.0e}"
    print(f"{group!r:32}{row}")

# 2. what Algorithm 1 misses: H of the momentum after the step, minus H before, is (t^2/2) s_3 in the momentum p of the interval
body = lm.RigidBody([1.0, 1.5, 2.0])
p = np.array([0.5, -0.4, 0.75])
v = np.array(body.velocity(p))
w = np.cross(p, v)
for tau, s3 in (lm.Exponential(), w @ body.velocity(w) / 4), (lm.Cayley(), w @ body.velocity(w) / 4 + (v @ v) * (p @ v) / 2):
    residual = [(t, body.energy(tau.dtau_inv_dual(body.group, t * v, p, "left")) - body.energy(p)) for t in (0.2, 0.1, 0.05)]
    print(f"{tau!r:15} residual/(t^2/2 s_3)", *(f"{r / (0.5 * t * t * s3):.4f}" for t, r in residual))

# 3. how far the others are, after one step and after a while
start, a1 = body.state(mu=[0.5, 0.0, 0.75**0.5]), lm.CovariantVariational()
rivals = {
    "second kind, $s = hH$": (lm.LiePoissonHamiltonJacobi(order=2), COLORS[2], "o"),
    "second kind, $s = hH + h^3 s_3/6$": (lm.LiePoissonHamiltonJacobi(order=4), COLORS[0], "s"),
    "first kind, $S_0 = (\\xi, \\xi)/2$": (lm.FirstKindHamiltonJacobi(order=2, scale=1.0), COLORS[1], "^"),
}
figure = Figure(figsize=(9.0, 4.0), layout="constrained")
left, right = figure.subplots(1, 2)
steps = 2.0 ** -np.arange(1.0, 7.0)


def momenta(method, h, n):
    return lm.integrate(body, method, start, h=h, steps=n, progress=False).mu[-1]


exact = body.exact(start, 8.0).mu
right.loglog(steps, [np.abs(momenta(a1, h, round(8 / h)) - exact).max() for h in steps], color="black", lw=3, label="Algorithm 1")
for name, (method, color, marker) in rivals.items():
    gaps = [max(np.abs(momenta(method, h, 1) - momenta(a1, h, 1)).max(), 1e-17) for h in steps]
    errors = [np.abs(momenta(method, h, round(8 / h)) - exact).max() for h in steps]
    print(f"{name:36} from Algorithm 1, one step of 1/16: {gaps[3]:.0e}; error at t = 8: {errors[3]:.1e}")
    left.loglog(steps, gaps, color=color, marker=marker, label=name)
    right.loglog(steps, errors, color=color, marker=marker, lw=1, label=name)
for place, words in (((0.1, 6e-4), "$h^3$"), ((0.1, 4e-6), "$h^3$"), ((0.1, 3e-17), "rounding")):
    left.annotate(words, place, ha="center", va="bottom")
left.set(title="One step: distance from Algorithm 1", xlabel="$h$", ylim=(3e-18, 3.0))
right.set(title="Error of the momentum at $t = 8$", xlabel="$h$")
right.legend(frameon=False, fontsize=8)
for axes in left, right:
    axes.set_xticks(steps, [f"1/{round(1 / h)}" for h in steps])
    axes.minorticks_off()
    axes.grid(color="0.92", lw=0.6)
    axes.set_axisbelow(True)
save(figure, "open_question.png", dpi=110)
