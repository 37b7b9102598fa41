"""A three-link arm under PD control: motors follow a plan of angles, against gravity and damping."""

import liemech as lm
from liemech.joints import Damper, JointForce, Link, Linkage, RevoluteJoint


@lm.record
class PD(JointForce):
    stiffness: float
    damping: float
    plan: lm.PiecewisePolynomial

    def effort(self, t, q, rate):
        return self.stiffness * (self.plan(t) - q) - self.damping * rate


lengths, turn, gains = [0.4, 0.3, 0.2], [0.0, 1.0, 0.0], [60.0, 30.0, 8.0]
plans = {"shoulder": [0.0, 1.2, 2.0], "elbow": [0.0, 1.5, 0.4], "wrist": [0.0, -1.0, 0.8]}
joints, forces = [], []
for k, (name, angles) in enumerate(plans.items()):  # in rad, at 0, 1 and 2 s
    top, end = [0.0, 0.0, 0.5 * lengths[k]], [0.0, 0.0, -0.5 * lengths[k - 1] if k else 0.0]
    joints += [RevoluteJoint(k, k - 1 if k else None, top, end, turn, turn, name=name)]
    plan = lm.PiecewisePolynomial.cubic([0.0, 1.0, 2.0], angles, outside="hold")
    forces += [PD(name, gains[k], gains[k] / 20.0, plan), Damper(name, 0.2)]
arm = Linkage([Link.rod(2.0 * x, x, 0.03) for x in lengths], joints, forces=forces)
run = lm.integrate(arm, lm.LieRATTLE(), arm.state(angles={}), h=0.0025, steps=1000)
figure, (upper, lower) = lm.plots.subplots(2, figsize=(5.2, 4.6), sharex=True)
for joint, force in zip(map(run.joint, plans), forces[::2]):
    (line,) = upper.plot(run.t, joint.angle, label=force.joint)
    upper.plot(run.t, force.plan(run.t), "--", color=line.get_color(), linewidth=1)
    lower.plot(run.t, joint.only(PD).torque)
    print(f"{force.joint:9} its motor's work is {joint.only(PD).work[-1]:.3f} J")
work = sum(run.joint(name).work[-1] for name in plans)
print(f"energy {run.energy[-1] - run.energy[0]:.3f} J, work of all {work:.3f} J")
upper.set(ylabel="angle (rad)"), lm.plots.legend(upper, loc="lower right")
lower.set(xlabel="time $t$ (s)", ylabel="torque of the motor (N m)")
figure.savefig("arm.png", dpi=200)
