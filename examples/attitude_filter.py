"""An attitude from a gyroscope with a bias and two known directions: seen from space its error is as large as
the filter says, seen from the body it is not, at first.
"""

import numpy as np

import liemech as lm

es, rotations, h, steps = lm.estimation, lm.SO3(), 0.1, 6000
process = es.BiasedGyroscope([2e-4] * 3, [2e-6] * 3)  # rad/s and rad/s^2 per root of Hz
group = process.group  # SO(3) x R^3
sun = es.OfPart(group, 0, es.Direction(rotations, [1.0, 0.0, 0.0], [1e-3] * 3))
field = es.OfPart(group, 0, es.Direction(rotations, [0.0, 0.6, 0.8], [1e-2] * 3))
body = lm.RigidBody([1.0, 1.5, 2.0])
start = body.state(mu=[0.02, 0.05, 0.15], g=rotations.exp([0.3, -0.2, 0.1]))
run = lm.integrate(body, lm.RKMK(order=4), start, h=h, steps=steps)

rng, bias = np.random.default_rng(1), np.array([0.002, -0.001, 0.0015])
rates = rotations.log(rotations.compose(rotations.inverse(run.g[:-1]), run.g[1:])) / h
measured = rates + bias + 2e-4 / np.sqrt(h) * rng.normal(size=(steps, 3))
truth = group.join(run.g, bias)
figure, axes = lm.plots.subplots(2, sharey=True, figsize=(6.4, 4.8))
for side, axis in zip(("left", "right"), axes):
    ekf = es.ErrorStateFilter(process, side)
    belief = ekf.belief(group.join(np.eye(3), np.zeros(3)), [0.3] * 3 + [0.01] * 3)
    errors, said = np.empty((2, steps, 6))
    for k in range(steps):
        belief = ekf.predict(belief, measured[k], h)
        for sensor in (sun, field) if k % 20 == 0 else ():
            z = sensor.value(truth[k + 1]) + sensor.deviation[0] * rng.normal(size=3)
            belief = ekf.update(belief, sensor, z)
        errors[k], said[k] = belief.error(truth[k + 1]), belief.deviations
    print(f"{side}: bias {group.split(belief.g)[1].round(5)} of {bias}")
    for values, label in (errors, "error of the attitude"), (said, "expected by the filter"):
        axis.semilogy(h * np.arange(steps), np.linalg.norm(values[:, :3], axis=1), label=label)
    axis.set(xlabel="time $t$ (s)", ylabel="angle (rad)", title=f"error on the {side}")
    lm.plots.legend(axis)
lm.plots.save(figure, "attitude_filter.png")
