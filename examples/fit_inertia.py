"""The inertia of a body from a gyroscope: least squares whose derivatives are those of the steps themselves."""

import numpy as np
from scipy.optimize import least_squares

import liemech as lm

noise, h, steps = 0.01, 0.05, 400


def motion(x):
    """The angular velocity mu/J, and its derivatives by x = (J_2, J_3, velocity at the start)."""
    J, xi = np.array([1.0, *x[:2]]), x[2:]  # the scale of J cannot be seen without a known torque
    body = lm.RigidBody(J)
    plan = lm.Plan(body, lm.RKMK(order=4), h, compiled=True, progress=False)
    run = plan.tangent(body.state(mu=J * xi), steps=steps, by=["start", "inertia"])
    shown, by_mu = run.mu / J, run.tangent["start"]
    by_J = run.tangent["inertia"] + by_mu * xi - np.einsum("nj,ji->nji", shown, np.eye(3))
    return shown, np.concatenate([by_J[:, :, 1:], by_mu * J], axis=2) / J[:, None]


true = np.array([1.62, 2.35, 0.3, 1.0, -0.2])
readings = motion(true)[0] + noise * np.random.default_rng(4).normal(size=(steps + 1, 3))
fit = least_squares(
    lambda x: ((motion(x)[0] - readings) / noise).ravel(),
    x0=[1.5, 2.0, 0.25, 0.9, -0.25],
    jac=lambda x: (motion(x)[1] / noise).reshape(-1, 5),
)
spread = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
print(f"{fit.nfev} evaluations, chi^2 per reading {2 * fit.cost / readings.size:.3f}")
for i in 0, 1:
    print(f"J_{i + 2}/J_1 = {fit.x[i]:.5f} +- {spread[i]:.5f}   (true {true[i]})")
t = h * np.arange(steps + 1)
figure, ax = lm.plots.subplots()
ax.plot(t, readings, ".", color="0.7", markersize=2)
ax.plot(t, motion(fit.x)[0], label=["axis 1", "axis 2", "axis 3"])
ax.set(xlabel="time $t$ (s)", ylabel="angular velocity (rad/s)")
lm.plots.legend(ax)
lm.plots.save(figure, "fit_inertia.png")
