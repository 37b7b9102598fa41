"""Scenes and their pages as data: what is in them, what is not, what is refused, and what it takes to write them."""

from __future__ import annotations

import base64
import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import liemech as lm
import liemech.viewer.page as page_module
from liemech.command_line.main import main
from liemech.command_line.scenes import SCENES
from liemech.errors import InvalidInput, InvalidType, MissingExtra
from liemech.models.even_boxes import box_of_inertia
from liemech.models.poses import quaternions, rotated
from liemech.plots.spheres.contours import contours, sphere
from liemech.viewer import Body, Momentum, Motion, Points, Scene, animate
from liemech.viewer.drawing import Canvas, Drawing
from liemech.viewer.page import described

needs_meshcat = pytest.mark.skipif(
    importlib.util.find_spec("meshcat") is None, reason="needs meshcat's page (the extra viewer)"
)

BODY = lm.RigidBody([1.0, 2.0, 3.0])
START = BODY.state(mu=[0.3, 1.0, 0.2], g=np.eye(3))
RUN = lm.integrate(BODY, lm.RKMK(order=4), START, h=0.1, steps=60, compiled=False)
TOP = lm.models.HeavyTop(inertia=[1.0, 1.5, 0.7], weight=1.3, centre=[0.6, 0.0, 0.8])


def content(page: str) -> dict[str, Any]:
    """The scene in a page."""

    def array(found: dict[str, Any]) -> Any:
        if "$" not in found:
            return found
        kinds = {
            "Float32Array": "f4",
            "Float64Array": "f8",
            "Int16Array": "i2",
            "Uint16Array": "u2",
            "Uint8Array": "u1",
        }
        return np.frombuffer(base64.b64decode(found["b"]), kinds[found["$"]])

    text = re.search(r'<script type="application/json" id="scene">(.*?)</script>', page, re.DOTALL)
    assert text is not None
    return json.loads(text[1], object_hook=array)


# ------------------------------------------------------------------ what a page costs


@pytest.mark.slow
@needs_meshcat
def test_writing_a_page_loads_no_more_than_numpy() -> None:
    program = """
import sys, numpy as np, liemech as lm
before = set(sys.modules)
assert not {name.partition(".")[0] for name in before} & {"meshcat", "matplotlib"}, "import liemech"
body = lm.RigidBody([1.0, 2.0, 3.0])
t = np.linspace(0.0, 1.0, 5)
scene = lm.viewer.Scene(lm.viewer.Motion(body, t, {"mu": np.ones((5, 3)), "g": np.array([np.eye(3)] * 5)}))
scene.html(), scene.html(compressed=True)
heavy = {"meshcat", "zmq", "tornado", "IPython", "matplotlib", "scipy", "llvmlite", "PIL", "umsgpack"}
assert not {name.partition(".")[0] for name in sys.modules} & heavy, {n.partition(".")[0] for n in sys.modules} & heavy
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


@needs_meshcat
def test_sizes_whatever_the_number_of_samples() -> None:
    def scene(samples: int) -> Scene:
        t = np.linspace(0.0, 60.0, samples)
        turns = np.zeros((samples, 3, 3))
        turns[:, 0, 0], turns[:, 1, 1], turns[:, 0, 1], turns[:, 1, 0] = (np.cos(t), np.cos(t), -np.sin(t), np.sin(t))
        turns[:, 2, 2] = 1.0
        return Scene(Motion(BODY, t, {"mu": turns[:, 0], "g": turns}))

    assert len(scene(600).html()) < 1_300_000
    assert len(scene(600).html(compressed=True)) < 550_000
    many, few = scene(200_000).html(), scene(900).html()
    assert abs(len(many) - len(few)) < 100 and len(few) < 1_300_000


@needs_meshcat
def test_without_meshcat_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for known in page_module.asset_folder, page_module.asset, page_module.licence:
        known.cache_clear()
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r'pip install "liemech\[viewer\]"'):
        Scene(RUN).html()


JOB = ["--steps", "5", "--methods", "exp", "--inertia", "1", "1.5", "2"]


@needs_meshcat
def test_the_main_job_writes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*JOB, "--out", str(tmp_path)]) == 0
    assert f"Page for the browser: {tmp_path / 'rigid_body.html'}\n" in capsys.readouterr().out
    legend = content((tmp_path / "rigid_body.html").read_text(encoding="utf-8"))["legend"]
    names = [entry["name"] for entry in legend]
    assert names == ["Algorithm 1, exp", "exact", "constant energy", "separatrix"]


def test_the_main_job_does_without(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> str:
        raise MissingExtra("no meshcat", extra="viewer")

    for name in "asset", "licence":
        monkeypatch.setattr(page_module, name, missing)
    assert main([*JOB, "--out", str(tmp_path)]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "page" in line.lower()]
    assert lines == ['No page for the browser: no meshcat: pip install "liemech[viewer]"']
    assert not (tmp_path / "rigid_body.html").exists()


# ------------------------------------------------------------------ what is in a scene


def paths(scene: Scene) -> set[str]:
    return {path.partition("/")[2] for panel in scene.panels() for path in panel.nodes}


def test_only_what_is_shown_is_there() -> None:
    assert paths(Scene(RUN, show=Momentum(trail=False, sphere=False, levels=0))) == {"run 1/mu"}
    assert not {path for path in paths(Scene(RUN, show="body")) if "mu" in path or "sphere" in path}
    full = paths(Scene(RUN))
    assert {
        "run 1/body",
        "run 1/mu",
        "run 1/mu trail",
        "run 1/spatial momentum",
        "shared/levels",
        "shared/separatrix 1",
    } <= full


STANDING = "run 1/mu trail", "shared/separatrix 1", "shared/separatrix 2"
"""Curves are sent once, and drawn from there."""


def test_channels_that_stand_still_are_sent_once() -> None:
    tracks = described(Scene(RUN))["tracks"]
    found = {(track["path"].partition("/")[2], track["channel"]) for track in tracks}
    assert found == {
        ("run 1/body", "quaternion"),
        ("run 1/mu", "direction"),
        ("run 1/mu tip", "position"),
        ("run 1/mu trail", "reveal"),
        *((name, channel) for name in STANDING for channel in ("cloud", "vectors")),
    }


def test_tracks_are_the_samples() -> None:
    scene = described(Scene(RUN, show="momentum"))
    direction = next(track for track in scene["tracks"] if track["channel"] == "direction")
    assert np.abs(direction["values"].reshape(-1, 3) - RUN.mu / np.linalg.norm(RUN.mu, axis=1)[:, None]).max() < 1e-7
    assert (scene["clocks"][direction["clock"]] == RUN.t).all()


@needs_meshcat
def test_a_page_holds_the_scene_as_it_is() -> None:
    scene = Scene(RUN, title="</script>", seconds=7.0)
    there, here = content(scene.html()), described(scene)
    assert there["title"] == "</script>" and there["seconds"] == 7.0
    for a, b in zip(there["tracks"], here["tracks"], strict=True):
        assert a["path"] == b["path"] and np.array_equal(a.get("values", 0), b.get("values", 0))
    assert len(there["commands"]) == len(here["commands"])


def test_several_runs_share_the_sphere_and_stand_side_by_side() -> None:
    other = lm.integrate(BODY, lm.RKMK(order=2), START, h=0.1, steps=30, compiled=False)
    scene = Scene(RUN, name="four").add(other, name="two")
    panels = scene.panels()
    assert [panel.title for panel in panels] == ["four", "two", "momentum, seen from the body"]
    names = [path.partition("/")[2] for path in panels[-1].nodes]
    assert {"run 1/mu", "run 2/mu"} <= set(names) and sum(name.startswith("shared/sphere") for name in names) == 1
    assert scene.duration == RUN.t[-1]
    assert described(scene)["legend"][:2] == [
        {"name": "four", "color": "#0072B2", "run": 0},
        {"name": "two", "color": "#D55E00", "run": 1},
    ]


def test_different_bodies_have_spheres_of_their_own() -> None:
    other = lm.RigidBody([1.0, 1.5, 2.0])  # with other curves of constant energy
    run = lm.integrate(other, lm.RKMK(order=4), other.state(mu=[0.3, 1.0, 0.2]), h=0.1, steps=3, compiled=False)
    panels = Scene(RUN, show="momentum", name="a").add(run, name="b").panels()
    assert [panel.title[:3] for panel in panels] == ["a: ", "b: "]


def test_adaptive_steps_move_by_their_dense_output() -> None:
    run = lm.integrate(BODY, lm.RKMK(order=5), START, t_end=10.0, rtol=1e-9, compiled=False)
    motion = Scene(run, frames=200).shown[0].motion
    assert len(run) < len(motion) == 200 and np.isin(run.t, motion.t).all()
    assert np.abs(motion["mu"] - BODY.exact(START, motion.t).mu).max() < 1e-6
    steps = Scene(run, frames=200, interpolate=False).shown[0].motion
    assert (steps.t == run.t).all()


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_trail_of_a_comet_is_its_ellipse(sign: float) -> None:
    """Steps in fictive time are short near the sun: chords of the trail stay as close to the conic
    p/(1 + e cos) there as elsewhere.
    """
    e, kepler, method = 0.97, lm.Kepler(), lm.Splitting(order=4, quadratic=False)
    start, system = kepler.pericentre(e), lm.LogarithmicHamiltonian(kepler)
    run = lm.integrate(system, method, start, h=0.05 * sign, steps=150, compiled=False)
    q = Scene(run).shown[0].motion["q"]
    assert len(q) > 2 * len(run)
    middle = 0.5 * (q[1:] + q[:-1])
    radius = (1.0 - e**2) / (1.0 + e * np.cos(np.arctan2(middle[:, 1], middle[:, 0])))
    assert np.abs(np.linalg.norm(middle, axis=1) / radius - 1.0).max() < 0.02


def test_backwards_is_played_backwards() -> None:
    back = lm.integrate(BODY, lm.RKMK(order=4), START, h=-0.1, steps=20, t0=1.0, compiled=False)
    scene = described(Scene(back))
    assert (scene["start"], scene["sign"], scene["duration"]) == (1.0, -1, pytest.approx(2.0))
    assert (np.diff(scene["clocks"][0]) > 0.0).all()
    with pytest.raises(InvalidInput, match="goes the other way in time"):
        Scene(back).add(RUN)


@pytest.mark.parametrize("order", [1, -1])
def test_runs_that_begin_at_different_times(order: int) -> None:
    early = Motion(BODY, order * np.array([0.0, 1.0, 2.0]), {"mu": RUN.mu[:3]})
    late = Motion(BODY, order * np.array([1.5, 2.5, 4.0]), {"mu": RUN.mu[:3]})
    scene = Scene(early).add(late)
    assert (scene.start, scene.duration) == (0.0, 4.0)
    assert [list(clock) for clock in scene.clocks()] == [[0.0, 1.0, 2.0], [1.5, 2.5, 4.0]]


def test_trails_are_curves_or_points() -> None:
    def shape(h: float) -> str:
        t = h * np.arange(100)
        mu = np.stack([np.cos(t), np.sin(t), 0.0 * t], axis=-1)
        panel = Scene(Motion(BODY, t, {"mu": mu}), show="momentum").panels()[0]
        found = panel.nodes["panel 1/run 1/mu trail"].shape
        assert found is not None
        return str(found.geometry()["type"])

    assert shape(0.1) == "LatheGeometry"
    assert shape(1.0) == "SphereGeometry"  # a curve through corners of 57 degrees would be invented


SYSTEMS = (
    "HeavyTop",
    "ReducedHeavyTop",
    "FallingBody",
    "OrbitingBody",
    "Kepler",
    "Pendulum",
    "DoublePendulum",
    "Quaternions",
)


@pytest.mark.sample(4)
@pytest.mark.parametrize("name", SYSTEMS)
def test_every_system_has_a_picture(name: str) -> None:
    attitude = lm.SO3().exp([0.4, -0.3, 0.5])
    top = TOP.state(mu=[0.3, 0.6, 1.1], g=attitude)
    orbiting = lm.models.OrbitingBody([1.0, 2.0, 2.5], 100.0, 1.0)
    falling = lm.models.FallingBody([1.0, 2.0, 2.5], 3.0)
    kepler, pendulum, double = lm.Kepler(), lm.models.Pendulum(), lm.models.DoublePendulum()
    free = lm.LiePoissonSystem(lm.UnitQuaternions(), BODY.hamiltonian)
    systems: dict[str, tuple[Any, Any, set[str]]] = {
        "HeavyTop": (TOP, top, {"run 1/body/top", "run 1/nose", "run 1/vertical trail"}),
        "ReducedHeavyTop": (
            TOP.reduced,
            TOP.reduced.from_top(top),
            {"run 1/body/top", "run 1/nose", "run 1/vertical trail"},
        ),
        "FallingBody": (falling, falling.state([0.5, 1, 0.2, 3, 0, 12], np.eye(4)), {"run 1/body/box", "run 1/path"}),
        "OrbitingBody": (orbiting, orbiting.circular_orbit(5.0), {"run 1/body/box", "run 1/path", "shared/centre"}),
        "Kepler": (kepler, kepler.pericentre(0.5), {"run 1/points", "shared/sun"}),
        "Pendulum": (pendulum, pendulum.state([1.0], [0.0]), {"run 1/rods", "shared/pivot 1"}),
        "DoublePendulum": (double, double.state([1.0, 2.0], [0.0, 0.0]), {"run 1/rods", "run 1/trail 1.1"}),
        "Quaternions": (free, free.state([0.3, 1.0, 0.2], [0.0, 0.0, 0.0, 1.0]), {"run 1/body", "run 1/mu"}),
    }
    system, start, wanted = systems[name]
    scene = lm.integrate(system, lm.RKMK(order=4), start, h=0.05, steps=40, compiled=False).view()
    assert wanted <= paths(scene)
    for panel in scene.panels():  # and everything that moves stays inside
        for node in panel.nodes.values():
            for channel in {"position", "scale"} & {*node.moving}:
                assert np.abs(node.moving[channel]).max() < 1.25


def test_points_of_ones_own() -> None:
    system = lm.models.HenonHeiles()
    run = lm.integrate(system, lm.RKMK(order=4), system.state([0.1, 0.2], [0.3, 0.1]), h=0.1, steps=20, compiled=False)
    scene = Scene(run, show=Points(places=lambda q, p: np.stack([q, p], axis=1)))
    (panel,) = scene.panels()
    assert panel.nodes["panel 1/run 1/points"].moving["cloud"].shape == (21, 2, 3)
    with pytest.raises(InvalidInput, match=r"places gave shape \(21, 2\)"):
        Scene(run, show=Points(places=lambda q, p: q)).panels()


# ------------------------------------------------------------------ animate


def test_animate_computes_what_is_shown_and_nothing_else() -> None:
    scene = animate(BODY, lm.RKMK(order=4), START, "momentum", h=0.01, steps=2000, frames=100)
    assert set(scene.runs[0].states) == {"mu"} and len(scene.runs[0]) == 101
    both = animate(BODY, lm.RKMK(order=4), START, h=0.1, steps=20)
    assert set(both.runs[0].states) == {"mu", "g"}
    adaptive = animate(BODY, lm.RKMK(order=5), START, "momentum", t_end=7.0, frames=50)
    assert np.allclose(adaptive.runs[0].t, np.linspace(0.0, 7.0, 50), rtol=1e-15) and set(adaptive.runs[0].states) == {
        "mu"
    }
    exact = BODY.exact(START, adaptive.runs[0].t)
    assert np.abs(adaptive.runs[0].mu - exact.mu).max() < 1e-4


# ------------------------------------------------------------------ what is refused


def test_bad_input_is_named() -> None:
    mu, t = RUN.mu[:4], RUN.t[:4]
    spoilt = mu.copy()
    spoilt[2, 1] = np.nan
    system = lm.LiePoissonSystem(lm.SU(2), lm.KineticEnergy([1.0, 2.0, 3.0]))
    spin = Motion(system, t, {"mu": mu, "g": np.tile(np.eye(2, dtype=complex), (4, 1, 1))})
    calls: list[tuple[Any, str]] = [
        (lambda: Motion(BODY, t, {"mu": spoilt}), "mu"),
        (lambda: Motion(BODY, t, {"mu": mu[:3]}), r"mu has shape \(3, 3\)"),
        (lambda: Motion(BODY, [0.0, 2.0, 1.0, 3.0], {"mu": mu}), "t must rise"),
        (lambda: Motion(BODY, [0.0, np.inf, 1.0, 3.0], {"mu": mu}), "Motion: t"),
        (lambda: Scene(Motion(BODY, t, {"mu": mu}), show="body"), "Body needs g"),
        (lambda: Scene(RUN, show="momentums"), "'momentums' is not known; there are body, momentum"),
        (lambda: Scene(spin), "there is no moving picture of"),
        (lambda: Motion(BODY, t, {"g": np.full((4, 3, 3), 1j)}), "g must be real numbers"),
        (lambda: Scene(RUN, show=()), "show is empty"),
        (lambda: Scene(RUN, show="links"), "Links shows bodies that joints hold together"),
        (lambda: Scene(RUN, color="blue"), "#rrggbb"),
        (lambda: Scene(RUN, seconds=0.0), "seconds"),
        (lambda: Scene(RUN, frames=1), "frames"),
        (lambda: Scene(RUN, body=1), "the run has one body"),
        (lambda: Scene(RUN, frames="many"), "frames"),
        (lambda: Scene(RUN, view="front"), "view"),
        (
            lambda: animate(BODY, lm.RKMK(order=4), BODY.state(mu=[0.3, 1.0, 0.2]), "body", h=0.1, steps=3),
            "Body needs g",
        ),
        (lambda: Scene().html(), "this scene is empty"),
        (lambda: Scene(RUN).save("body.txt"), "must end in .html or .htm"),
        (lambda: Momentum(levels=-1), "levels"),
        (lambda: Body(size=0.0), "size"),
        (lambda: Scene(RUN, show=Body(mesh="ship.step")).panels(), ".stl, .obj, .dae"),
        (lambda: Scene(RUN, show=Body(mesh="no such ship.obj")).panels(), "cannot be read"),
    ]
    for call, said in calls:
        with pytest.raises((InvalidInput, InvalidType), match=said):
            call()
    with pytest.raises(InvalidType, match="a scene shows what `integrate` returns"):
        Scene(RUN.mu)
    with pytest.raises(InvalidType, match="names or contents"):
        Scene(RUN, show=[3])


def test_numbers_of_every_kind() -> None:
    whole = {"mu": np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]])}
    for kind in (np.int64, np.float32, np.float64):
        scene = described(Scene(Motion(BODY, np.arange(3, dtype=kind), {"mu": whole["mu"].astype(kind)})))
        direction = next(track for track in scene["tracks"] if track["channel"] == "direction")
        assert (direction["values"] == np.eye(3).ravel()).all()


def test_one_of_an_ensemble() -> None:
    many = lm.integrate(BODY, lm.RKMK(order=4), BODY.state(mu=np.eye(3), g=np.eye(3)), h=0.1, steps=10, compiled=False)
    bodies = Scene(many, show="body").panels()[0].nodes["panel 1/run 1/bodies"]
    assert bodies.moving["turns"].shape == (11, 3, 4)
    turned = Rotation.from_quat(bodies.moving["turns"][-1, 1]).as_matrix()
    assert turned == pytest.approx(many.g[-1, 1])
    gaps = np.linalg.norm(np.diff(bodies.still["cloud"], axis=0), axis=1)
    assert gaps.min() > np.linalg.norm(bodies.shape.known["sizes"])  # none stands in another's way
    one = Scene(many, body=1)
    assert (one.shown[0].motion["mu"] == many.mu[:, 1]).all() and "run 1/body" in paths(one)


# ------------------------------------------------------------------ the geometry of it


def test_a_body_is_drawn_as_the_box_with_its_inertia() -> None:
    a, b, c = 1.0, 2.0, 3.0
    J = np.diag([b * b + c * c, c * c + a * a, a * a + b * b]) / 12.0
    edges = box_of_inertia(J)
    assert edges / edges[0] == pytest.approx([1.0, 2.0, 3.0])
    assert np.linalg.norm(edges) / 2 == pytest.approx(0.85)
    assert (box_of_inertia(np.diag([2 / 3, 1.0, 2.0])) > 0.0).all()  # which no body has


def test_quaternions_are_those_of_the_rotations(rng: np.random.Generator) -> None:
    xi = rng.normal(size=(50, 3))
    xi[:3] = np.pi * np.eye(3)  # half turns, where one component of the quaternion vanishes
    R = lm.SO3().exp(xi)
    q = quaternions(R)
    assert np.abs(Rotation.from_quat(q).as_matrix() - R).max() < 1e-15 * 8
    v = rng.normal(size=(50, 3))
    assert np.abs(rotated(q, v) - np.einsum("nij,nj->ni", R, v)).max() < 1e-14


def test_a_trail_is_made_of_the_steps_between_its_points() -> None:
    s = np.linspace(0.0, 5.0, 80)
    curve = np.stack([np.cos(s), np.sin(s), 0.1 * s**2], axis=-1)
    curve[10] = curve[9]  # a point that is repeated
    panel = Canvas("panel 1", "", np.zeros(3), 1.0)
    Drawing(panel, "run 1", "#000000", 0).trail("trail", curve)
    (node,) = panel.nodes.values()
    assert (node.still["cloud"] == curve[:-1]).all()
    assert node.still["cloud"] + node.still["vectors"] == pytest.approx(curve[1:], rel=1e-15)
    assert node.shape is not None
    thick = node.shape.known["sizes"].reshape(79, 3)[:, 0]
    length = np.linalg.norm(node.still["vectors"], axis=1)
    assert (thick * length)[length > 0.0] == pytest.approx(0.024)  # everywhere
    (reveal,) = (track for track in page_module.tracks(node) if track["channel"] == "reveal")
    assert reveal["first"] == 0 and 0.0 < reveal["least"] < 1.0


@lm.record
class Gyrostat(lm.Hamiltonian):
    inertia: lm.Vec
    rotor: lm.Vec

    def energy(self, mu):
        return 0.5 * lm.dot(mu - self.rotor, (mu - self.rotor) / self.inertia)


def test_every_energy_has_its_curves_on_the_sphere() -> None:
    gyrostat = lm.LiePoissonSystem(lm.SO3(), Gyrostat([1, 2, 3], [0.1, 0.2, 0.7]))
    curves = contours(gyrostat.energy, 2.0, 5)
    assert np.abs(np.linalg.norm(curves, axis=2) - 2.0).max() < 1e-14
    energies = gyrostat.energy(curves.reshape(-1, 3))
    everywhere = gyrostat.energy(2.0 * sphere()[0])
    levels = everywhere.min() + np.ptp(everywhere) * (np.arange(5) + 0.5) / 5
    assert np.abs(energies[:, None] - levels).min(axis=1).max() < 5e-3 * np.ptp(everywhere)
    ends, times = np.unique(np.round(curves.reshape(-1, 3), 9) + 0.0, axis=0, return_counts=True)
    # closed: every end of a segment is the end of one other
    assert len(ends) > 300 and (times == 2).all()
    run = lm.integrate(gyrostat, lm.RKMK(order=4), gyrostat.state([0.3, 1.0, 0.2]), h=0.1, steps=5, compiled=False)
    assert "shared/levels" in paths(Scene(run))
    # all directions have the same energy
    assert not len(contours(lm.RigidBody([2.0, 2.0, 2.0]).energy, 1.0, 5))


def test_momenta_of_different_length_have_no_common_sphere() -> None:
    momenta = np.diag([1.0, 2.0, 3.0])
    many = lm.integrate(BODY, lm.RKMK(order=4), BODY.state(mu=momenta), h=0.1, steps=3, compiled=False)
    assert paths(Scene(many)) == {"run 1/mu", *(f"shared/axis {k}" for k in (1, 2, 3))}
    alike = lm.integrate(BODY, lm.RKMK(order=4), BODY.state(mu=np.eye(3)), h=0.1, steps=3, compiled=False)
    assert {"shared/sphere 1.000", "shared/levels"} <= paths(Scene(alike))


# ------------------------------------------------------------------ long runs


def test_samples_far_apart_are_not_joined() -> None:
    """A long run shows its first stretch as it is, and samples that are far apart one by one."""
    t = np.arange(30_000) * 0.1
    attitudes = Rotation.from_rotvec(np.outer(t, [0.0, 0.0, 2.0])).as_matrix()
    momentum = np.tile([0.0, 0.0, 1.0], (len(t), 1))
    run = Motion(BODY, t, {"mu": momentum, "g": attitudes})
    first = Scene(run, show="body").shown[0].motion
    assert (first["g"] == attitudes[:900]).all() and first.joined
    assert described(Scene(run, show="body"))["notes"] == ["shown: the first 900 of 30,000 samples, to t = 89.9"]
    few = Scene(Motion(BODY, t[::10], {"mu": momentum[::10], "g": attitudes[::10]}), show="body")
    assert described(few)["joined"] == [False]  # two radians
    assert "up to 115 degrees apart" in described(few)["notes"][0]
    assert few.seconds == len(few.shown[0].motion) / 3.0  # more than three a second would flicker
    assert Scene(run, show="body", seconds=7.0).seconds == 7.0
    assert described(Scene(RUN))["joined"] == [True] and described(Scene(RUN))["notes"] == []


@pytest.mark.parametrize(
    "name", ["kepler", "pendulum", pytest.param("hanging-rods", marks=pytest.mark.slow), "figure-eight"]
)
def test_nor_are_those_of_planets_pendulums_and_linkages(name: str) -> None:
    """Chords of a planet's orbit are not its motion."""
    scene = SCENES[name]()
    run = scene.run(("q", "p") if "q" in scene.start.parts else ("mu", "g"), 1, False)
    every = dict(run.states)
    whole = Motion(scene.system, run.t, every, run.bodies)
    assert Scene(whole).shown[0].motion.joined
    few = {part: rows[::60] for part, rows in every.items()}
    assert not Scene(Motion(scene.system, run.t[::60], few, run.bodies)).shown[0].motion.joined
    # of the whole of a long one the first stretch, with all its samples
    times = {part: np.concatenate([rows] * 200) for part, rows in every.items()}
    t = scene.h * np.arange(200.0 * len(run.t))
    first = Scene(Motion(scene.system, t, times, run.bodies)).shown[0].motion
    assert first.joined and np.array_equal(first.t, t[: len(first.t)]) and "first" in first.note
