"""The scenes that are there: one function each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import liemech as lm

from ..names import nearest
from .scene import Setup

library: Any = lm
"""The library; type checkers take fields that a model derives for arguments."""

SCENES: dict[str, Callable[[], Setup]] = {}
"""Every scene by its name."""


def scene_meant(name: str, command: str = "") -> str:
    """The end of a refusal, as of `meant`: the scene of which the name, or a word in it, is written like this."""
    words = {word: scene for scene in reversed(SCENES) for word in scene.split("-")} | {
        scene: scene for scene in SCENES
    }
    near = nearest(name, words)
    return f" (did you mean {command}{words[near]}?)" if near else ""


def scene(function: Callable[[], Setup]) -> Callable[[], Setup]:
    """Put a function into the list, under its name with hyphens."""
    SCENES[function.__name__.replace("_", "-")] = function
    return function


@scene
def free_body() -> Setup:
    """A body that tumbles freely."""
    body = library.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    return Setup("a free rigid body", body, lm.LiePoissonHamiltonJacobi(order=4), start, h=0.1, steps=600)


@scene
def flip() -> Setup:
    """Dzhanibekov's flip: spun about its middle axis, a body turns over again and again."""
    body = library.RigidBody([1.0, 2.0, 3.0])
    start = body.state(mu=[0.01, 1.0, 0.01], g=np.eye(3))
    return Setup("Dzhanibekov's flip", body, lm.LiePoissonHamiltonJacobi(order=4), start, h=0.1, steps=600)


@scene
def heavy_top() -> Setup:
    """An asymmetric heavy top, whose motion is chaotic."""
    top = library.models.HeavyTop(inertia=[1.0, 1.5, 0.7], weight=1.3, centre=[0.6, 0.0, 0.8])
    start = top.state(mu=[0.3, 0.6, 1.1], g=lm.SO3().exp([0.4, -0.3, 0.5]))
    return Setup("a heavy top", top, lm.KickDrift(order=4), start, h=0.05, steps=800)


@scene
def lagrange_top() -> Setup:
    """A symmetric top let go at rest: its nose draws cusps."""
    top = library.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.6, length=0.8)
    start = top.state(mu=[0.0, 0.0, 2.6], g=lm.SO3().exp([0.6, 0.0, 0.0]))
    return Setup("Lagrange's top", top, lm.KickDrift(order=4), start, h=0.05, steps=700)


@scene
def kirchhoff() -> Setup:
    """An ellipsoid that sinks nowhere: it swims in an ideal fluid, and its path winds."""
    body = library.models.KirchhoffBody.of_blocks(angular=[1.2, 2.0, 2.6], linear=[1.2, 1.8, 5.0])
    start = body.state(mu=[0.2, -0.8, 2.3, 0.8, 0.9, -0.7], g=np.eye(4))
    return Setup("a body in a fluid", body, lm.LiePoissonHamiltonJacobi(order=4), start, h=0.05, steps=500)


@scene
def satellite() -> Setup:
    """A long satellite that librates about the vertical of its orbit, in the gradient of gravity."""
    body = library.models.OrbitingBody(inertia=[0.05, 0.08, 0.11], mass=1.7, attraction=1.0)
    start = body.circular_orbit(3.0, lm.SO3().exp([0.1, 0.2, 0.3]))
    return Setup("a satellite in a gravity gradient", body, lm.KickDrift(), start, h=0.1, steps=1000)


@scene
def falling_body() -> Setup:
    """A thrown body that tumbles."""
    body = library.models.FallingBody(inertia=[0.01, 0.016, 0.023], mass=0.5)
    start = body.state(mu=[0.002, 0.06, 0.004, 1.0, 0.0, 2.5], g=np.eye(4))
    return Setup("a thrown body", body, lm.KickDrift(), start, h=0.005, steps=200)


@scene
def pendulum() -> Setup:
    """Twelve pendulums in their phase plane: some swing, others turn over."""
    system = library.models.Pendulum()
    start = system.state(q=np.zeros((12, 1)), p=np.linspace(0.5, 9.0, 12)[:, None])
    return Setup("twelve pendulums", system, lm.StormerVerlet(), start, h=0.02, steps=150)


@scene
def double_pendulum() -> Setup:
    """A pendulum that hangs from another one: chaotic."""
    system = library.models.DoublePendulum(masses=[1.0, 0.5], lengths=[1.0, 0.8])
    start = system.state(q=[2.0, -0.5], p=[0.0, 0.0])
    return Setup("a double pendulum", system, lm.HamiltonJacobi(order=4), start, h=0.02, steps=500)


@scene
def kepler() -> Setup:
    """A planet on a long ellipse."""
    system = library.Kepler()
    return Setup("Kepler's planet", system, lm.Splitting(order=4), system.pericentre(0.6), h=0.02, steps=1000)


@scene
def henon_heiles() -> Setup:
    """A star in a galaxy, at an energy where most motions are chaotic."""
    system = library.models.HenonHeiles()
    start = system.state(q=[0.0, 0.1], p=[(2.0 / 8.0 - 0.01 + 2e-3 / 3.0) ** 0.5, 0.0])
    return Setup("a star in a galaxy", system, lm.Splitting(order=4), start, h=0.05, steps=2000)


@scene
def comet() -> Setup:
    """A comet on an ellipse of eccentricity 0.97, with steps that follow it: short near the sun,
    and still symplectic.
    """
    system = library.LogarithmicHamiltonian(library.Kepler())
    method = lm.Splitting(order=4, quadratic=False)
    return Setup("a comet", system, method, library.Kepler().pericentre(0.97), h=0.05, steps=600)


@scene
def spherical_pendulum() -> Setup:
    """A ball on a rod, in three coordinates and one constraint."""
    system = library.SphericalPendulum()
    start = system.consistent(q=[0.8, 0.0, -0.6], p=[0.0, 1.2, 0.0])
    return Setup("a spherical pendulum", system, lm.RATTLE(), start, h=0.01, steps=1500)


@scene
def chain() -> Setup:
    """Four links that swing from rest."""
    system = library.models.ChainPendulum(masses=[0.2] * 4, lengths=[0.25] * 4)
    q = system.hanging(np.tile([np.cos(0.3), 0.0, -np.sin(0.3)], 4))
    return Setup("a chain of four links", system, lm.RATTLE(), system.consistent(q, np.zeros(12)), h=0.005, steps=1000)


@scene
def figure_eight() -> Setup:
    """Three equal masses follow each other on an eight."""
    system, start = library.models.NBody.figure_eight()
    return Setup("three bodies on an eight", system, lm.Splitting(order=6), start, h=0.02, steps=316)


@scene
def hares_and_foxes() -> Setup:
    """Lotka and Volterra's species, whose numbers circle for ever: by a Poisson integrator."""
    system = library.models.LotkaVolterra()
    return Setup("hares and foxes", system, lm.Splitting(order=4), system.state([1.5, 1.0]), h=0.05, steps=400)


@scene
def four_bar() -> Setup:
    """Two parallelograms of rods side by side swing from rest: one degree of freedom in six coordinates."""
    system = library.models.FourBarLinkage(loops=2)
    joints = np.ravel([(j + np.sin(1.1), -np.cos(1.1)) for j in range(3)])
    return Setup("a four-bar linkage", system, lm.RATTLE(), system.consistent(joints, np.zeros(6)), h=0.01, steps=1000)


@scene
def hanging_rods() -> Setup:
    """Two rods that hang one from another by ball joints: bodies on SE(3), six conditions."""
    system = library.joints.chain(2)
    poses, top = np.tile(np.eye(4), (2, 1, 1)), np.zeros(3)
    for pose, axis in zip(poses, ([1.2, 0.0, 0.0], [0.4, 0.9, 0.0]), strict=True):
        pose[:3, :3] = lm.SO3().exp(axis)
        pose[:3, 3] = top - 0.5 * pose[:3, 2]
        top = top - pose[:3, 2]
    return Setup("two hanging rods", system, lm.LieRATTLE(), system.assembled(poses), h=0.01, steps=900)


@scene
def slider_crank() -> Setup:
    """A crank on a hinge, a piston in its cylinder, a rod between them: a loop that is closed."""
    turn, out = [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]
    hinge: Any = lm.joints.RevoluteJoint
    crank, piston = (lm.joints.Link(1.0, [0.002, 0.02, 0.02]), lm.joints.Link(0.5, [0.002, 0.002, 0.002]))
    joints = [
        hinge(0, None, [-0.25, 0.0, 0.0], [0.0, 0.0, 0.0], turn, turn),
        lm.joints.PrismaticJoint(1, None, axis=out),
        lm.joints.RigidRod(0, 1, [0.25, 0.0, 0.0], [0.0, 0.0, 0.0], 1.5),
    ]
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, 0, 3] = 0.25, 2.0
    system = library.joints.Linkage([crank, piston], joints)
    start = system.assembled(poses, [[0.0, -6.0, 0.0, 0.0, 0.0, 1.5], [0.0] * 6])
    return Setup("a crank, a rod and a piston", system, lm.LieRATTLE(), start, h=0.01, steps=300)


@scene
def sleigh() -> Setup:
    """Chaplygin's sleigh: a blade behind the centre of mass lets it turn round, until it glides
    with the blade behind.
    """
    body = library.LiePoissonSystem(lm.SE2(), library.KineticEnergy([0.7, 1.3, 1.3]))
    system = library.NonholonomicBody(body, lm.joints.Blade(0.4))
    start = system.consistent([0.77, -1.2, 0.5], np.eye(3))
    return Setup("Chaplygin's sleigh", system, lm.LagrangeDAlembert(), start, h=0.02, steps=400)


@scene
def rolling_ball() -> Setup:
    """Chaplygin's ball: uneven, but with its centre of mass in its centre, it rolls on a plane and wobbles."""
    group = lm.ProductGroup(lm.SO3(), lm.VectorSpace(3))
    body = library.LiePoissonSystem(group, library.KineticEnergy([0.3, 0.5, 0.7, 1.0, 1.0, 1.0]))
    system = library.NonholonomicBody(body, lm.joints.Rolling(1.0))
    place = np.concatenate([np.eye(3).ravel(), [0.0, 0.0, 1.0]])  # its centre above the plane
    start = system.consistent([0.1, 1.0, 0.3, 0.0, 0.0, 0.0], place)
    return Setup("a ball that rolls", system, lm.LagrangeDAlembert(), start, h=0.05, steps=400)
