"""A PUMA 560 from its URDF file swings its tool round: PD control of six joints, and a spring that carries the arm."""

import numpy as np

import liemech as lm
from liemech.formulas import cos, sin


@lm.record
class PD(lm.joints.JointForce):
    stiffness: float
    damping: float
    plan: lm.Vec  # in rad: the middle, and the swing that begins there, and that which ends there

    def effort(self, t, q, rate):
        wanted = self.plan[0] + self.plan[1] * sin(1.5 * t) + self.plan[2] * (1.0 - cos(1.5 * t))
        pace = 1.5 * (self.plan[1] * cos(1.5 * t) + self.plan[2] * sin(1.5 * t))
        return self.stiffness * (wanted - q) + self.damping * (pace - rate)


gains = [(4000, 120), (6000, 200), (3000, 60), (20, 0.2), (10, 0.05), (0.2, 0.004)]
plans = [(0, 0.5, 0), (0.7, 0, -0.3), (-0.9, 0, 0.4), (0, 1.2, 0), (0.6, 0, 0.2), (0, 0.6, 0)]
forces = [PD(k, *gains[k], plans[k]) for k in range(6)] + [lm.joints.Spring(1, 25.0, 2.2)]
arm = lm.joints.Linkage.from_urdf(__file__.replace("puma.py", "puma560.urdf"), forces=forces)
rates = {k: 1.5 * plans[k][1] for k in range(6)}
start = arm.state(angles={k: plans[k][0] for k in range(6)}, rates=rates)
run = lm.integrate(arm, lm.LieRATTLE(), start, h=0.001, steps=5000, every=10)
print("work of the motors in J:", [f"{run.joint(k).only(PD).work[-1]:.2f}" for k in range(6)])
lm.viewer.Scene(run, title="PUMA 560", view=(-60, 15)).save("puma.html")
torques = np.transpose([run.joint(k).only(PD).torque for k in range(6)])
figure, ax = lm.plots.subplots(figsize=(6.6, 3.4))
ax.plot(run.t, torques, "-", label=[joint.name for joint in arm.joints])
(
    ax.set(xlabel="time $t$ (s)", ylabel="torque (N m)"),
    lm.plots.legend(ax, loc="center left", bbox_to_anchor=(1.0, 0.5)),
)
lm.plots.save(figure, "puma.png")
