"""The inertia of a body from a gyroscope: least squares whose derivatives are those of the steps themselves."""

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import least_squares

import liemech as lm

TRUE, H, STEPS = np.array([1.0, 1.62, 2.35]), 0.05, 400
RNG = np.random.default_rng(4)


def motion(moments, xi):
    """What the gyroscope shows, the body's angular velocity, and its derivatives by moments and velocity at the start."""
    body = lm.RigidBody(moments)
    plan = lm.Plan(body, lm.RKMK(order=4), H, compiled=True, progress=False)
    run = plan.tangent(body.state(mu=moments * xi), steps=STEPS, by=["start", "inertia"])
    shown, by_mu, by_inertia = run.mu / moments, run.tangent["start"], run.tangent["inertia"]
    by_inertia = by_inertia + by_mu * xi - np.einsum("nj,ji->nji", shown, np.eye(3))  # mu at the start is J xi, xi = mu / J
    return shown, np.concatenate([by_inertia, by_mu * moments], axis=2) / moments[:, None]


def draw(axes, t, dots, line, colour, label):
    """Readings as dots, the fitted motion as a line."""
    axes = axes or Figure(figsize=(7.0, 3.6), layout="constrained").add_subplot(xlabel="t, s", ylabel="angular velocity, 1/s")
    axes.plot(t, dots, ".", color=colour, markersize=2)
    axes.plot(t, line, color=colour, label=label)
    axes.legend(frameon=False, ncols=3)
    return axes


def main():
    """Fit two ratios of moments and the velocity at the start: the scale of the inertia cannot be seen without a known torque."""
    xi = np.array([0.3, 1.0, -0.2])
    noise = 0.01
    measured = motion(TRUE, xi)[0] + noise * RNG.normal(size=(STEPS + 1, 3))

    def unknown(x):
        return np.array([1.0, *x[:2]]), x[2:]

    def misfit(x):
        return ((motion(*unknown(x))[0] - measured) / noise).ravel()

    def slope(x):
        return (motion(*unknown(x))[1][:, :, 1:] / noise).reshape(-1, 5)

    fit = least_squares(misfit, [1.5, 2.0, 0.25, 0.9, -0.25], jac=slope, x_scale="jac")
    spread = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    print(f"{fit.nfev} evaluations, chi^2 per reading {2 * fit.cost / measured.size:.3f}")
    for name, x, s, true in zip(("J_2/J_1", "J_3/J_1"), fit.x, spread, TRUE[1:]):
        print(f"{name} = {x:.5f} +- {s:.5f}   (true {true})")
    axes = None
    for i, colour in enumerate(lm.plots.COLORS[:3]):
        axes = draw(axes, H * np.arange(STEPS + 1), measured[:, i], motion(*unknown(fit.x))[0][:, i], colour, f"axis {i + 1}")
    lm.plots.save(axes.figure, "fit_inertia.png", dpi=110)


if __name__ == "__main__":
    main()
