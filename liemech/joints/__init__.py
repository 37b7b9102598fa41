"""Joints between rigid bodies, linkages of bodies, and contacts that roll or glide.

lm.joints.chain(12, mass=0.5, length=0.2)

    link.py, joints.py                 bodies; conditions on two poses (points_and_axes.py); given_motion.py: moved ones
    linkage.py                         the system; mounting.py: its poses from coordinates of joints; urdf.py: from files
    joint_forces.py, body_forces.py    springs, dampers, motors at joints; fields and loads on single bodies
    joint_motion.py, joint_space.py    angle, torque, reaction, work of a joint along a run; mass matrix, inverse dynamics
    rolling.py                         conditions on velocities, for a `NonholonomicBody`
    linked_joints.py                   the linkage in memory; elimination_order.py: its equations; in_memory/: its methods
"""

from ..names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
