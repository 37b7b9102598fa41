"""Whole numbers of files, pickles and users that are no sizes and no places: an error that names them, before
native code takes them for places in memory.
"""

from __future__ import annotations

import copy
import os
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import slow
from terms_of_spins import Exchange

import liemech as lm
from liemech.command_line.scene_file import scene_file
from liemech.compiler.machine import guard_words
from liemech.errors import FileWarning, InvalidInput
from liemech.formulas.sites import SiteArray, SiteTable
from liemech.formulas.tables import Table
from liemech.integrators.ending_at_jumps import EndingAtJumps
from liemech.joints import BallJoint, Damper, Linkage, LinkShape, Spring, chain
from liemech.rooms.files import arrays as files
from liemech.rooms.files.encoding import encoded
from liemech.rooms.sites.graphs import Graph

if hasattr(os, "fork"):
    from flipped_numbers import faults, fuzz, fuzz_texts, scenes

CHAIN = chain(4)
SPINS = lm.LiePoissonSystem(
    lm.SO3() ** 12,
    lm.Terms(Exchange(lm.each(np.ones(3))).over(lm.neighbours.edges([(0, 1), (1, 2), (4, 5)], sites=12)), held=[3]),
)


def saved(path: Path, system: Any, method: Any, start: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the file of a short run holds."""
    lm.integrate(system, method, start, h=0.01, steps=2).save(path)
    return files.read(path)


def refused(path: Path, arrays: Any, about: Any, words: str) -> None:
    """A file that holds this is refused when it is read, in these words."""
    files.write(path, arrays, about)
    with pytest.raises(InvalidInput, match=words):
        lm.Trajectory.load(path)


@pytest.mark.parametrize("number", [50, 4, -1, 1_000_000, 2**31, 2**63 - 1])
def test_a_joint_of_a_file_holds_bodies_that_are_there(number: int, tmp_path: Path) -> None:
    arrays, about = saved(tmp_path / "run.npz", CHAIN, lm.LieRATTLE(), CHAIN.state(angles={}))
    about["system"]["fields"]["joints"]["tuple"][2]["fields"]["second"] = number
    refused(
        tmp_path / "run.npz",
        arrays,
        about,
        f"{number}.*4, numbered from 0|second is the number of a body.*{number}|{number} asks for more",
    )


@pytest.mark.parametrize("name", ["conditions", "rotors", "elimination", "places", "held", "touches"])
def test_numbers_that_follow_from_others_are_those_that_follow(name: str, tmp_path: Path) -> None:
    """They are fields of a linkage that nobody gives, and loops of its formulas."""
    arrays, about = saved(tmp_path / "run.npz", CHAIN, lm.LieRATTLE(), CHAIN.state(angles={}))
    value = about["system"]["fields"][name]
    about["system"]["fields"][name] = value + 1 if isinstance(value, int) else {"tuple": [77]}
    refused(tmp_path / "run.npz", arrays, about, f"Linkage: {name} is .*77|Linkage: {name} is 13, and .* 12")


def test_a_pickle_is_checked_too() -> None:
    joint = BallJoint(2, 1, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0])
    linkage = Linkage(CHAIN.links, (*CHAIN.joints[:2], joint, CHAIN.joints[3]))
    assert pickle.loads(pickle.dumps(linkage)) == linkage == copy.copy(linkage)
    object.__setattr__(joint, "second", 77)
    with pytest.raises(InvalidInput, match=r"second=77.* holds body 77; there are 4"):
        pickle.loads(pickle.dumps(linkage))


def test_loads_on_single_bodies_of_a_file(tmp_path: Path) -> None:
    @lm.record
    class Nothing(lm.Potential):
        def energy(self, g: Any) -> float:
            return 0.0

    linkage = Linkage(CHAIN.links, CHAIN.joints, potential={1: Nothing()})
    object.__setattr__(linkage.potential, "bodies", (9,))
    with pytest.raises(InvalidInput, match="no link 9; there are 4"):
        Linkage(CHAIN.links, CHAIN.joints, potential=linkage.potential)


# ------------------------------------------------------------------ sites

FLIPS: dict[str, Callable[[Any, Any], None]] = {
    r"copies = 1000000000 asks for more than 1000000": lambda f, _: f["group"]["fields"].update(copies=10**9),
    r"Exchange: .* is on 12 sites, and SO3\(\) \*\* 11 has 11": lambda f, _: f["hamiltonian"]["fields"]["group"][
        "fields"
    ].update(copies=11),
    r"held names site 12; they are 0 to 11": lambda f, _: f["hamiltonian"]["fields"].update(held={"tuple": [12]}),
    r"held names site -1; they are 0 to 11": lambda f, _: f["hamiltonian"]["fields"].update(held={"tuple": [-1]}),
    r"edge 1, \(1, 12\), names a site that is not there": lambda _, g: g["given"].update(array=[0, 1, 1, 12, 4, 5]),
    r"edge 1, \(1, -2\), names a site that is not there": lambda _, g: g["given"].update(array=[0, 1, 1, -2, 4, 5]),
    r"edge 1, \(1, 1\), ties a site to itself": lambda _, g: g["given"].update(array=[0, 1, 1, 1, 4, 5]),
    r"a parameter has 3 values, and .* has 2 edges": lambda _, g: g["given"].update(array=[0, 1, 1, 2], shape=[2, 2]),
    r"they are 0 to 4|is on 5 sites": lambda _, g: g.update(count=5),
}


@pytest.mark.parametrize("words", FLIPS)
def test_terms_of_a_file_are_on_sites_that_are_there(words: str, tmp_path: Path) -> None:
    start = SPINS.state(mu=np.random.default_rng(1).normal(size=(12, 3)))
    arrays, about = saved(tmp_path / "run.npz", SPINS, lm.RKMK(order=2), start)
    system = about["system"]["fields"]
    graph = system["hamiltonian"]["fields"]["parts"]["tuple"][0]["fields"]["graph"]["fields"]
    FLIPS[words](system, graph)
    refused(tmp_path / "run.npz", arrays, about, words)


def test_a_graph_of_a_user_is_looked_at_before_it_is_walked() -> None:
    @lm.record
    class Wrong(Graph):
        """Edges of which one leads to a site that is not there."""

        @property
        def sites(self) -> int:
            return 12

        @property
        def edges(self) -> np.ndarray:
            return np.array([(0, 1), (5, 2**31 - 1)])

    with pytest.raises(
        InvalidInput, match=r"edge 1, \(5, 2147483647\), names a site that is not there; they are 0 to 11"
    ):
        system = lm.LiePoissonSystem(lm.SO3() ** 12, lm.Terms(Exchange(1.0).over(Wrong())))
        lm.integrate(system, lm.RKMK(order=2), system.state(mu=np.ones((12, 3))), h=0.1, steps=2, compiled=True)


def test_tables_are_as_long_as_their_numbers_say() -> None:
    table, array = SiteTable.of(np.array([[1, 2, 0]])), SiteArray.of(np.ones((3, 2)))
    for one, wrong in (
        (table, {"rows": 2.0}), (table, {"places": 32.0}), (table, {"degree": 7}), (table, {"places": float("nan")}),
        (table, {"reach": table.entries}), (array, {"places": 48.0}), (array, {"dim": 3}), (array, {"places": -16.0}),
        (lm.each(np.ones((4, 3))), {"shape": (5,)}), (lm.each(np.ones((4, 3))), {"shape": (-3,)}),
    ):  # fmt: skip
        fields = {name: getattr(one, name) for name in type(one).__dataclass_fields__} | wrong
        with pytest.raises(InvalidInput):
            type(one)(**fields)


@pytest.mark.slow
def test_springs_and_dampers_of_a_loaded_linkage_go_on(tmp_path: Path) -> None:
    """As in a run that was never saved."""
    hinges = chain(3, axis=[1.0, 0.0, 0.0])
    arm = Linkage(hinges.links, hinges.joints, forces=[Damper(1, 0.1), Spring(2, 0.5)])
    plan, start = lm.Plan(arm, lm.LieRATTLE(), 0.01), arm.state(angles={0: 0.3})
    plan.run(start, steps=2).save(tmp_path / "run.npz")
    run = lm.Trajectory.load(tmp_path / "run.npz")
    longer = lm.Plan(run.system, run.method, run.h).resume(run, steps=3)
    assert np.array_equal(longer.mu[-1], plan.run(start, steps=5).mu[-1])


# ------------------------------------------------------------------ sizes, and files beside


def test_large_matrices_of_a_scene(tmp_path: Path) -> None:
    text = '[system]\nname = "LiePoissonSystem"\ngroup = "SO(20000)"\nhamiltonian = "KineticEnergy([1.0])"\n'
    text += '[start]\nmu = [1.0]\ng = "identity"\n[method]\nname = "RKMK"\n[run]\nh = 0.1\nsteps = 1\n'
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(InvalidInput, match="SO: n = 20000 asks for more than 1000000 numbers"):
        scene_file(tmp_path / "scene.toml")


def test_a_saved_run_says_which_files_its_picture_reads(tmp_path: Path) -> None:
    inside, outside = tmp_path / "runs", tmp_path / "elsewhere"
    for folder in (inside, outside):
        folder.mkdir()
        (folder / "arm.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for folder, name in ((inside, "arm.obj"), (outside, str(re.escape(str(outside / "arm.obj"))))):
        shape = LinkShape("mesh", 1, np.eye(4), [1.0, 1.0, 1.0], None, str(folder / "arm.obj"))
        linkage = Linkage(CHAIN.links, CHAIN.joints, shapes=(shape,))
        lm.integrate(linkage, lm.LieRATTLE(), linkage.state(angles={}), h=0.01, steps=1).save(inside / "run.npz")
        if folder is inside:
            lm.Trajectory.load(inside / "run.npz")
            continue
        with pytest.warns(FileWarning, match=f"outside of its folder, {name}"):
            lm.Trajectory.load(inside / "run.npz")
        lm.Trajectory.load(inside / "run.npz", trusted=True)


def test_a_urdf_file_reads_meshes_of_its_robot_only(tmp_path: Path) -> None:
    folder = tmp_path / "robots" / "arm" / "urdf"
    folder.mkdir(parents=True)
    for place in (folder.parent, folder, tmp_path / "robots", tmp_path):
        (place / "part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    visual = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    for name, there in {
        "part.obj": True, "../part.obj": True, "../../part.obj": False, f"file://{tmp_path}/part.obj": False,
        "package://arm/part.obj": True, "package://arm/../../part.obj": False, f"{tmp_path}/part.obj": False,
        f"file://{folder}/part.obj": True,
    }.items():  # fmt: skip
        text = (
            f'<robot><link name="a"/><link name="b">{mass}{visual.format(name)}</link><joint name="j" type="revolute">'
        )
        text += '<parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint></robot>'
        (folder / "arm.urdf").write_text(text)
        if there:
            (shape,) = Linkage.from_urdf(folder / "arm.urdf").shapes
            assert shape.file is not None and shape.file.endswith("part.obj")
            continue
        with pytest.warns(FileWarning, match=f"outside of the folders of the robot .*{re.escape(name)}"):
            assert not Linkage.from_urdf(folder / "arm.urdf").shapes
        if not name.startswith("package"):
            assert len(Linkage.from_urdf(folder / "arm.urdf", packages={"mine": tmp_path}).shapes) == 1


def test_what_is_made_for_a_run_is_no_part_of_files(tmp_path: Path) -> None:
    """Its tables say where native code reads, and nobody has made them again."""
    arrays, about = saved(tmp_path / "run.npz", CHAIN, lm.LieRATTLE(), CHAIN.state(angles={}))
    about["method"] = encoded(EndingAtJumps(lm.RKMK(order=2), Table([0.5]), 1e9, False, False, None))
    refused(tmp_path / "run.npz", arrays, about, "EndingAtJumps is made for a run, and no part of files")


# ------------------------------------------------------------------ any number


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="every trial is a process of its own, by os.fork")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("kinds", "cases", "seed"), [(("chain", "pairs"), 60, 1), *[slow(None, 200, seed) for seed in range(2, 52)]]
)
def test_no_number_of_a_file_ends_the_process(
    kinds: Any, cases: int, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor writes outside of its buffers, nor takes memory that it does not need: runs and pickles, read and gone
    on with natively.
    """
    monkeypatch.setattr(guard_words, "ON", True)
    ended = fuzz([*(kinds or scenes())], cases, seed, tmp_path, seconds=20 if kinds is None else 1)
    assert not faults(ended), ended
    assert sum(ended.values()) == cases and ended["done"] > 0


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="every trial is a process of its own, by os.fork")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("cases", "seed"), [(40, 3), *[slow(100, seed) for seed in range(4, 24)]])
def test_no_number_of_a_text_ends_the_process(
    cases: int, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Robots and scenes, read and moved."""
    monkeypatch.setattr(guard_words, "ON", True)
    ended = fuzz_texts(cases, seed, tmp_path, compiled=cases > 40)
    assert not faults(ended), ended
    assert sum(ended.values()) == cases and ended["done"] > 0
