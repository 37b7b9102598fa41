"""What is drawn can be seen: contrast, colours that every kind of colour vision tells apart, a
picture that fills its stage, and what lies behind the sphere is fainter than what lies in front.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from viewer.browser import Tab

import liemech as lm
from liemech.command_line.scenes import SCENES
from liemech.models.curves import ASIDE, across
from liemech.plots import COLORS
from liemech.plots.style import GREY, INK
from liemech.viewer import Body, Content, Drawing, Momentum, Motion, Scene
from liemech.viewer.chromium import Chromium
from liemech.viewer.contents.vectors import AXES, LEVEL, SEPARATRIX
from liemech.viewer.page import part
from liemech.viewer.shapes import rgb

VISIONS = {
    "usual": np.eye(3),
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
}
"""How each kind of colour vision sees linear red, green and blue.

Source: Machado, Oliveira, Fernandes, A physiologically-based model for simulation of color vision
deficiency, IEEE Trans. Visualization and Computer Graphics 15 (2009), severity 1.
"""


def linear(color: str) -> np.ndarray:
    """A colour of a page as amounts of light.  Source: IEC 61966-2-1 (sRGB)."""
    c = np.array(rgb(color)) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lightness(light: Any) -> np.ndarray:
    """L*, a*, b* of CIE 1976, in which equal distances look alike."""
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    x = np.array(to_xyz) @ np.clip(light, 0.0, 1.0) / [0.9505, 1.0, 1.089]
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def contrast(color: str, ground: str = "#ffffff") -> float:
    """Source: Web Content Accessibility Guidelines 2.2, relative luminance and contrast ratio."""
    dark, light = sorted(0.05 + linear(c) @ [0.2126, 0.7152, 0.0722] for c in (color, ground))
    return float(light / dark)


def apart(colors: Any, vision: str) -> float:
    """The least distance between two of the colours as this kind of vision sees them."""
    seen = [lightness(np.array(VISIONS[vision]) @ linear(color)) for color in colors]
    return min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(seen, 2))


def test_the_measures_know_the_classic_cases() -> None:
    assert contrast("#000000") == pytest.approx(21.0)
    assert contrast("#777777") == pytest.approx(4.48, abs=0.01)
    red_and_green = ("#b06000", "#708000")  # alike without the receptors for green
    assert apart(red_and_green, "usual") > 40.0 > 10.0 > apart(red_and_green, "deuteranopia")


@pytest.mark.parametrize("vision", VISIONS)
def test_every_kind_of_colour_vision_tells_curves_and_axes_apart(vision: str) -> None:
    assert apart(COLORS, vision) > 20.0
    assert apart((COLORS[0], *AXES), vision) > 25.0


def _pictures() -> dict[str, Any]:
    """Pictures with several curves, of every kind that the library draws in a plane."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    methods = (lm.RKMK(order=2), lm.CovariantVariational(lm.Cayley()), lm.RKMK())
    plain = {"h": 0.1, "steps": 60, "compiled": False}
    runs = {str(k): lm.integrate(body, m, start, **plain) for k, m in enumerate(methods)}
    hs = np.array([0.4, 0.2, 0.1])
    errors = {f"{k}": hs**k for k in range(1, 7)}
    return {
        "drift": lm.plots.drift(runs),
        "invariants": lm.plots.invariants(runs["0"]),
        "components": lm.plots.components(runs["0"]),
        "euler_angles": lm.plots.euler_angles(runs["0"]),
        "orders": lm.plots.orders(hs, errors),
        "work_precision": lm.plots.work_precision({k: (e, 1.0 / hs) for k, e in errors.items()}),
    }


def test_printed_in_grey_the_curves_of_a_picture_are_told_apart() -> None:
    """By their dashes, by their marks, or by how dark they are."""
    for name, drawn in _pictures().items():
        for ax in np.atleast_1d(drawn.figure.axes).flat:
            curves = [line for line in ax.lines if line.get_label()[:1] != "_"]
            for one, other in itertools.combinations(curves, 2):
                dark = [lightness(linear(to_hex(c.get_color())))[0] for c in (one, other)]
                looks = [(c._dash_pattern, str(c.get_marker())) for c in (one, other)]
                assert looks[0] != looks[1] or abs(dark[0] - dark[1]) > 20.0, name


def test_lines_have_contrast_three_and_texts_four_and_a_half() -> None:
    assert min(contrast(color) for color in (*COLORS, *AXES, LEVEL, SEPARATRIX)) >= 3.0
    assert min(contrast(c) for c in (INK, GREY)) >= 4.5
    themes = [dict(re.findall(r"--(\w+): (#\w{6})", theme)) for theme in part("page.html").split(":root")[1:]]
    assert len(themes) == 2  # light and dark
    for theme in themes:
        for ground in (theme["paper"], theme["bar"]):
            assert min(contrast(theme[words], ground) for words in ("ink", "pale")) >= 4.5
        assert contrast(theme["blue"], theme["paper"]) >= 4.5


def test_the_eye_looks_across_the_plane_of_a_motion() -> None:
    s = np.linspace(0.0, 6.0, 50)
    still = 0.0 * s
    azimuth, elevation = across(np.stack([2.0 * np.cos(s), still, np.sin(s)], axis=1))
    assert -90.0 <= azimuth <= -60.0 and elevation <= 15.0  # upright: from the front
    azimuth, elevation = across(np.stack([still, 2.0 * np.cos(s), np.sin(s)], axis=1))
    assert min(abs(azimuth), abs(azimuth + 180.0)) <= 20.0  # the other upright plane
    assert across(np.stack([2.0 * np.cos(s), np.sin(s), still], axis=1))[1] >= 50.0  # from above
    assert across(np.concatenate([np.eye(3), -np.eye(3)])) == ASIDE


FILLED = """(() => { const found = player.panels.map(panel => {
    player.aim(panel);
    const camera = player.viewer.camera, low = [9, 9], high = [-9, -9];
    camera.updateMatrixWorld();
    for (const point of panel.extent) {
        const v = point.clone().project(camera);
        [v.x, v.y].forEach((x, k) => { low[k] = Math.min(low[k], x); high[k] = Math.max(high[k], x); });
    }
    return [...low, ...high];
}); return found; })()"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kirchhoff", "falling-body", "pendulum", "sleigh", "figure-eight"])
def test_scenes_fill_their_stage(browser: Chromium, tmp_path: Path, name: str) -> None:
    scene = SCENES[name]()
    run = lm.integrate(scene.system, scene.method, scene.start, h=scene.h, steps=scene.steps)
    with Tab.of(browser, Scene(run).save(tmp_path / "scene.html")) as tab:
        tab.wait("window.ready || window.failed")
        for left, bottom, right, top in tab.evaluate(FILLED):
            assert 0.6 < max(right - left, top - bottom) / 2.0 <= 0.9
            assert min(left, bottom) >= -1.0 and max(right, top) <= 1.0
        assert tab.complaints() == []


def _thrown() -> Motion:
    """A body on its parabola, and turning."""
    t, s = np.linspace(0.0, 2.0, 81), np.linspace(0.0, 3.0, 81)
    g = np.tile(np.eye(4), (81, 1, 1))
    g[:, :3, :3] = lm.SO3().exp(np.outer(s, [0.6, 0.0, 0.8]))
    g[:, 0, 3], g[:, 2, 3] = 3.0 * t, 9.80665 * (t - 0.5 * t**2)
    return Motion(lm.models.FallingBody([1.0, 2.0, 2.5], 3.0), t, {"g": g})


def test_a_floor_lies_where_gravity_pulls() -> None:
    for name in ("heavy-top", "falling-body", "double-pendulum", "chain", "hanging-rods", "kepler", "figure-eight"):
        scene = SCENES[name]()
        states = {part: np.asarray(x)[None] for part, x in scene.start.parts.items() if x is not None}
        panel = Scene(Motion(scene.system, np.zeros(1), states)).panels()[0]
        assert panel.known["floor"] == (name not in ("kepler", "figure-eight")), name
        assert bool(panel.known["ruler"]) == (name != "heavy-top")
    ball = SCENES["rolling-ball"]()
    panel = Scene(Motion(ball.system, np.zeros(1), {"g": np.asarray(ball.start.g)[None]})).panels()[0]
    assert panel.known["floor"] == pytest.approx(panel.inside([0.0, 0.0, 0.0])[2])  # it rolls on x3 = 0


@pytest.mark.slow
def test_shadow_scale_and_the_eye_that_follows(browser: Chromium, tmp_path: Path) -> None:
    motion = _thrown()
    with Tab.of(browser, Scene(motion).save(tmp_path / "thrown.html")) as tab:
        tab.wait("window.ready || window.failed")
        body = "player.tracks.find(t => t.path.endsWith('/body')).object.getWorldPosition(new MeshCat.THREE.Vector3())"
        shadows = []
        for t in (0.3, 1.0):  # the shadow is below the body
            seen = tab.seek(t)
            tab.evaluate(
                "player.viewer.scene.traverse(o => { o.visible &&= !(o.material?.type === 'ShadowMaterial'); })"
            )
            tab.evaluate("player.viewer.needs_render = true")
            rows, columns = np.nonzero(np.abs(seen - tab.drawn()).sum(axis=-1) > 15)
            tab.evaluate("player.viewer.scene.traverse(o => { o.visible ||= o.material?.type === 'ShadowMaterial'; })")
            x, y = tab.evaluate(
                f"(() => {{ const p = player.panels[0], v = {body}.project((player.aim(p), player.viewer.camera));"
                " return [p.rect[0] + (v.x + 1) / 2 * p.rect[2], p.rect[1] + (1 - v.y) / 2 * p.rect[3]]; })()"
            )
            assert len(rows) > 30 and rows.min() > y and abs(columns.mean() - x) < 60
            shadows.append(columns.mean())
        assert shadows[1] > shadows[0] + 50
        # the bar is as long as what it says, at the distance of the middle
        apart = tab.evaluate(
            """(() => { const panel = player.panels[0], [, bar, text] = panel.caption.childNodes;
            const { camera, controls } = player.viewer, length = parseFloat(text.data) / panel.ruler;
            const right = new MeshCat.THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
            player.aim(panel);
            const middle = (s) => controls.target.clone().addScaledVector(right, s).project(camera);
            const ends = [0, length].map((s) => middle(s).x * panel.rect[2] / 2);
            return [ends[1] - ends[0], bar.getBoundingClientRect().width, text.data]; })()"""
        )
        assert apart[0] == pytest.approx(apart[1], abs=1.0) and apart[2].endswith(" m")
        tab.click("#follow")
        for t in (0.2, 1.0, 1.8):
            tab.seek(t)
            v = tab.evaluate(f"{body}.project((player.aim(player.panels[0]), player.viewer.camera)).toArray()")
            assert np.abs(v[:2]) == pytest.approx(0.0, abs=1e-6)
        assert tab.complaints() == []


@dataclass(frozen=True)
class Lines(Content):
    """Two points that move evenly on lines, one above the other, with trails of which the upper one tapers."""

    panel = "lines"

    def needs(self, system: lm.System) -> tuple[str, ...]:
        return ("mu",)

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        s = np.linspace(-1.0, 1.0, len(motion))
        for height, least in ((0.2, 0.3), (-0.2, 1.0)):
            drawing.trail(f"to {least}", np.stack([s, 0.0 * s, height + 0.0 * s], axis=1), least=least)


@pytest.mark.slow
def test_trails_taper(browser: Chromium, tmp_path: Path) -> None:
    motion = Motion(lm.RigidBody([1.0, 2.0, 3.0]), np.linspace(0.0, 1.0, 101), {"mu": np.ones((101, 3))})
    with Tab.of(browser, Scene(motion, show=Lines(), view=(-90.0, 0.0)).save(tmp_path / "lines.html")) as tab:
        tab.wait("window.ready || window.failed")
        seen = np.abs(tab.seek(1.0) - tab.seek(0.0)).sum(axis=-1)[60:420] > 40
        middle = int(np.nonzero(seen)[0].mean())  # between the lines
        for half, tapers in ((seen[:middle], True), (seen[middle:], False)):
            thick = half.sum(axis=0)
            columns = np.nonzero(thick)[0]
            tail, nearer, head = (
                thick[round(columns[0] + share * (columns[-1] - columns[0]))] for share in (0.3, 0.8, 0.97)
            )
            assert (0 < tail < nearer < head) if tapers else (tail == nearer == head)


@pytest.mark.slow
def test_a_scene_is_few_draw_calls_and_triangles(browser: Chromium, tmp_path: Path) -> None:
    body = lm.RigidBody([1.0, 2.0, 3.0])
    t = np.linspace(0.0, 60.0, 900)
    exact = Motion(body, t, body.exact(body.state(mu=[0.3, 1.0, 0.2], g=np.eye(3)), t))
    five = Scene(exact, name="1")
    for k in range(2, 6):
        five.add(exact, name=f"{k}")
    for name, scene, calls, triangles in (
        ("one", Scene(exact), 30, 70_000),
        ("five", five, 95, 200_000),
        ("thrown", Scene(_thrown()), 20, 15_000),
    ):
        with Tab.of(browser, scene.save(tmp_path / f"{name}.html")) as tab:
            tab.wait("window.ready || window.failed")
            drawn = tab.evaluate(
                "(() => { const { info } = player.viewer.renderer; info.autoReset = false; seekTo(player.duration); info.reset();"
                " player.draw(); return [info.render.calls, info.render.triangles]; })()"
            )
            assert drawn[0] <= calls and drawn[1] <= triangles, (name, drawn)


@pytest.mark.slow
def test_a_dark_page_where_the_reader_has_one(browser: Chromium, tmp_path: Path) -> None:
    body = lm.RigidBody([1.0, 2.0, 3.0])
    still = Motion(body, np.zeros(1), {"mu": np.array([[0.3, 1.0, 0.2]]), "g": np.eye(3)[None]})
    page = Scene(still, name="ink", color="#1a1a1a").save(tmp_path / "dark.html")
    with Tab.of(browser, page) as tab:
        tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
        tab.evaluate("window.ready = false")
        tab.call("Page.reload")
        tab.wait("document.readyState === 'complete' && window.ready")
        pixels = tab.drawn()
        assert pixels[2, 2].max() < 40  # the page
        assert (pixels.min(axis=-1) > 200)[60:430].sum() > 100  # the arrow of a run that is black on white
        assert tab.complaints() == []


@pytest.mark.slow
def test_what_lies_behind_the_sphere_is_faint(browser: Chromium, tmp_path: Path) -> None:
    """The same point of the momentum, towards the eye and away from it."""
    body = lm.RigidBody([1.0, 2.0, 3.0])
    azimuth, elevation = np.radians(ASIDE)
    eye = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth)]
    front = np.array([*eye, np.sin(elevation)]) + [0.0, 0.0, 0.3]
    front /= np.linalg.norm(front)
    darkest = []
    for mu in (front, -front):
        still = Motion(body, np.zeros(1), {"mu": mu[None]})
        page = Scene(still, show=Momentum(trail=True, levels=0)).save(tmp_path / "sphere.html")
        with Tab.of(browser, page) as tab:
            tab.wait("window.ready || window.failed")
            pixels = tab.drawn()
            darkest.append(pixels[..., 0][pixels[..., 2] > pixels[..., 1] + 25].min())
    assert darkest[0] < 20 and darkest[1] > 80


@pytest.mark.slow
def test_a_mesh_without_normals_is_lit(browser: Chromium, tmp_path: Path) -> None:
    """Many programs write STL files whose normals are all zero."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="<f4")
    faces = corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    data = np.zeros(4, dtype=facet)
    data["corners"] = faces
    file = tmp_path / "corner.stl"
    file.write_bytes(b"\0" * 80 + np.uint32(4).tobytes() + data.tobytes())
    body = lm.RigidBody([1.0, 2.0, 3.0])
    still = Motion(body, np.zeros(1), {"g": np.eye(3)[None]})
    page = Scene(still, show=Body(mesh=file, triad=False)).save(tmp_path / "mesh.html")
    with Tab.of(browser, page) as tab:
        tab.wait("window.ready || window.failed")
        middle = tab.drawn()[180:260, 280:360]
        assert middle.min() > 60  # black before
        assert tab.complaints() == []


@pytest.mark.slow
def test_the_first_view_comes_back_and_the_motion_begins_anew(browser: Chromium, tmp_path: Path) -> None:
    scene = SCENES["kepler"]()
    run = lm.integrate(scene.system, scene.method, scene.start, h=scene.h, steps=200)
    page = Scene(run, seconds=1.0).save(tmp_path / "planet.html")
    with Tab.of(browser, page) as tab:
        tab.wait("window.ready || window.failed")
        first = tab.seek(1.0)
        tab.drag((300.0, 200.0), (420.0, 260.0))
        assert (tab.drawn() != first).any()
        tab.click("#reset")
        assert (tab.drawn() == first).all()
        label = tab.evaluate("document.getElementById('label').textContent")
        assert re.fullmatch(r"t = [\d.]+", label)  # of a planet without units
        tab.click("#loop")
        tab.evaluate(f"player.seek({0.95 * 200 * scene.h!r}); player.play()")
        tab.wait(f"player.time < {0.5 * 200 * scene.h!r}", 10.0)
        assert tab.evaluate("player.playing")
