"""The one door: every kind of file with an armature in it, and every odd one, loads or says why."""

from __future__ import annotations

import re
import time
from pathlib import Path

import numpy as np
import pytest

from puppet.errors import BadFileError
from puppet.formats.armature_toml import load_puppet
from puppet.formats.bone_names import unique_names
from puppet.formats.bvh import read_bvh
from puppet.formats.bvh_armature import bvh_armature
from puppet.formats.model import MODEL_SUFFIXES, load_model
from puppet.mesh import Model
from tests.test_bvh import person
from tests.test_gltf import Maker, check_sound

SHARED = Path(__file__).parents[2] / "shared"
RIGS = [
    path
    for path in sorted([*SHARED.glob("armatures/**/*.*"), *SHARED.glob("bvh/**/*.bvh")])
    # A file that another one includes has no armature of its own.
    if path.suffix in MODEL_SUFFIXES and path.name != "shared.xml" and path.parent.name != "bones"
]

MJCF = '<mujoco><worldbody><body name="a"><freejoint/><geom/></body></worldbody></mujoco>'
URDF = '<robot name="r"><link name="a"/></robot>'
BVH = (
    "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n}\n"
    "MOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n"
)


def lone_glb() -> bytes:
    maker = Maker()
    maker.nodes[0].pop("children")
    maker.document["skins"][0]["joints"] = [0]
    maker.attributes["JOINTS_0"] = maker.add(np.zeros((4, 4), "u1"))
    return maker.glb()


def write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def grown(count: int) -> dict[str, str | bytes]:
    """A chain of `count` bones in each format, all with the same name where that is possible."""
    maker = Maker()
    maker.document["nodes"] = [
        {"name": "bone", "translation": [0, 0.01, 0], "children": [n + 1]} for n in range(count)
    ]
    del maker.nodes[-1]["children"]
    maker.nodes.append({"mesh": 0, "skin": 0})
    maker.document["scenes"][0]["nodes"] = [0, count]
    joints, weights = np.zeros((count, 4), "u2"), np.zeros((count, 4), "f4")
    joints[:, 0], weights[:, 0] = np.arange(count), 1.0
    maker.document["meshes"][0]["primitives"][0] = {
        "attributes": {
            "POSITION": maker.add(np.random.default_rng(0).normal(size=(count, 3)).astype("f4")),
            "JOINTS_0": maker.add(joints),
            "WEIGHTS_0": maker.add(weights),
        }
    }
    maker.document["skins"] = [{"joints": list(reversed(range(count)))}]
    links = "".join(f'<link name="l{n}"/>' for n in range(count))
    held = "".join(
        f'<joint type="continuous"><parent link="l{n}"/><child link="l{n + 1}"/>'
        '<origin xyz="0 0 0.01"/></joint>'
        for n in range(count - 1)
    )
    channels = "OFFSET 0 1 0\nCHANNELS 1 Zrotation\n"
    return {
        "chain.glb": maker.glb(),
        "chain.xml": "<mujoco><worldbody>"
        + '<body name="a" pos="0.01 0 0"><joint axis="0 1 0"/>' * count
        + "</body>" * count
        + "</worldbody></mujoco>",
        "chain.urdf": f"<robot>{links}{held}</robot>",
        "chain.bvh": "HIERARCHY\nROOT a {\n"
        + channels
        + f"JOINT a {{\n{channels}" * (count - 1)
        + "}\n" * count
        + f"MOTION\nFrames: 1\nFrame Time: 0.1\n{'0 ' * count}\n",
    }


# -- what there is ----------------------------------------------------------------------------


@pytest.mark.skipif(not RIGS, reason="the shared rigs are not here")
@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_every_real_rig_goes_on_stage(path: Path) -> None:
    model = load_puppet(path).model
    check_sound(model)
    armature = model.armature
    assert model.meshes
    assert model.height > 0.0
    assert not np.isnan(np.hstack([armature.lower, armature.upper])).any()
    assert (armature.lower <= 0.0).all()
    assert (armature.upper >= 0.0).all()
    if path.suffix not in (".glb", ".gltf"):
        lowest = min(float(mesh.positions[:, 1].min()) for mesh in model.meshes)
        assert lowest == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("platformer_game_pack__Bee.glb", ["'Body', 'Head'", "no weights, of 'Body'", "×100"]),
        ("platformer_game_pack__Bee.glb", ["'Wing2.L', 'Wing2.R'", "rest where they were bound"]),
        ("cesium_man_embedded.gltf", ["without a name", "'bone_2'"]),
        ("animals_pack__Horse.glb", ["5 roots", "'IKBackLeg.L'"]),
    ],
)
def test_the_defects_of_real_files_are_told_by_the_bones(
    shared: Path, file: str, words: list[str]
) -> None:
    warnings = " ".join(load_model(shared / "armatures" / file).warnings)
    assert not [word for word in words if word not in warnings]


# -- the door ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("rig.bvh", BVH),
        ("rig.xml", MJCF),
        ("rig.mjcf", MJCF),
        ("rig.XML", URDF),
        ("rig.urdf", URDF),
        ("rig.glb", lone_glb()),
    ],
)
def test_a_rig_with_one_bone_loads_whatever_its_kind(
    tmp_path: Path, name: str, content: str | bytes
) -> None:
    model = load_puppet(write(tmp_path, name, content)).model
    check_sound(model)
    assert len(model.armature) == 1
    assert model.height > 0.0


def test_a_toml_finds_the_model_of_its_name_whatever_its_kind(tmp_path: Path) -> None:
    write(tmp_path, "arm.urdf", URDF)
    toml = write(tmp_path, "arm.toml", '[bones.a]\nlimit = 30\nmovement = "fixed"')
    for path in (toml, tmp_path / "arm.urdf"):
        armature = load_puppet(path).model.armature
        assert armature.movements == ("fixed",)
        assert armature.limits[0] == pytest.approx(np.radians(30))


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("rig.fbx", "Kaydara", "(?s)cannot be read.*ends in .glb, .gltf, .bvh, .urdf, .xml"),
        ("rig", "what", "no ending"),
        ("rig.xml", "<sdf/>", "(?s)no armature.*<sdf>"),
        ("rig.xml", "<mujoco", "not XML"),
        ("rig.xml", b"\xff\xfe\x00", "not XML"),
        ("rig.urdf", "", "empty"),
        ("rig.urdf", None, "not there"),
        ("rig.bvh", None, "no such file"),
        ("rig.bvh", "MOTION", "not a BVH"),
    ],
)
def test_what_is_no_armature_is_refused(
    tmp_path: Path, name: str, content: str | bytes | None, says: str
) -> None:
    path = tmp_path / name if content is None else write(tmp_path, name, content)
    with pytest.raises(BadFileError, match=says):
        load_puppet(path)


def test_a_cycle_of_nodes_names_its_bones(tmp_path: Path) -> None:
    maker = Maker()
    maker.nodes[1]["children"] = [0]
    with pytest.raises(BadFileError, match=r"(?s)own ancestor.*root → tip → root"):
        load_model(write(tmp_path, "rig.glb", maker.glb()))


@pytest.mark.parametrize("name", ["chain.glb", "chain.xml", "chain.urdf", "chain.bvh"])
def test_five_thousand_bones_load_while_one_waits(tmp_path: Path, name: str) -> None:
    path = write(tmp_path, name, grown(5000)[name])
    start = time.perf_counter()
    model = load_puppet(path).model
    spent = time.perf_counter() - start
    assert len(model.armature) == 5000
    assert int(model.armature.depths.max()) == 4999
    assert len(model.warnings) < 20  # not one for each
    assert spent < 20.0


# -- warnings that name the bone --------------------------------------------------------------


def test_a_scale_is_told_by_the_bone_that_has_it(tmp_path: Path) -> None:
    maker = Maker()
    maker.nodes[1]["scale"] = [100, 100, 100]
    warnings = load_model(write(tmp_path, "rig.glb", maker.glb())).warnings
    assert [
        text for text in warnings if "×100" in text and "'tip'" in text and "'root'" not in text
    ]


def test_a_bone_that_does_not_rest_where_it_was_bound_is_told(tmp_path: Path) -> None:
    assert load_model(write(tmp_path, "rig.glb", Maker().glb())).warnings == ()
    for change in ({"rotation": [0, 0, 0.7071, 0.7071]}, {"translation": [0, 1.5, 0]}):
        maker = Maker()
        maker.nodes[1] |= change
        warnings = load_model(write(tmp_path, "rig.glb", maker.glb())).warnings
        assert any("'tip'" in text and "were bound" in text for text in warnings)


def test_several_roots_and_weights_that_are_none_are_told_by_the_bones(tmp_path: Path) -> None:
    maker = Maker()
    del maker.nodes[0]["children"]
    maker.document["scenes"][0]["nodes"].append(1)
    maker.attributes["WEIGHTS_0"] = maker.add(np.array([[np.nan, 1, 0, 0]] * 4, "f4"))
    warnings = load_model(write(tmp_path, "rig.glb", maker.glb())).warnings
    assert any("2 roots" in text and "'root', 'tip'" in text for text in warnings)
    assert any("no weights" in text and "'root', 'tip'" in text for text in warnings)


def test_many_repeated_names_are_numbered_and_told_once() -> None:
    told: list[str] = []
    names = unique_names(["a"] * 3000 + ["a_2", None, " "], ["bone"] * 3003, told.append)
    assert len(set(names)) == 3003
    assert names[0] == "a"
    assert names[3000] == "a_2"
    assert names[3001:] == ["bone", "bone_2"]
    assert len(told) == 10  # the nameless, eight of the numbered, and how many more


# -- BVH --------------------------------------------------------------------------------------


def left_of(model: Model) -> np.ndarray:
    armature = model.armature
    places = armature.rest[0]
    left: np.ndarray = places[armature.index("LeftArm")] - places[armature.index("RightArm")]
    return left


def test_a_human_bvh_faces_forward_whatever_its_axes(tmp_path: Path) -> None:
    def turned(text: str) -> str:
        """The same file about +Y by half a turn."""
        return re.sub(
            r"OFFSET\s+(\S+)\s+(\S+)\s+(\S+)",
            lambda m: f"OFFSET {-float(m[1])} {m[2]} {-float(m[3])}",
            text,
        )

    for text in (person(), turned(person())):
        left = left_of(load_model(write(tmp_path, "person.bvh", text)))
        assert left[0] > 0.1
        np.testing.assert_allclose(left[1:], 0.0, atol=1e-6)


def test_a_human_bvh_without_a_stance_of_its_own_rests_in_its_best_frame(shared: Path) -> None:
    motion = read_bvh(shared / "bvh/genoview_mit/Geno_stance.bvh")
    told: list[str] = []
    armature = bvh_armature(motion, told.append)
    places = dict(zip(armature.names, armature.rest[0], strict=True))
    assert any("rests as in frame" in text for text in told)
    assert places["LeftHand"][1] < places["LeftArm"][1]  # with all angles 0 it is over the head
    assert places["LeftHand"][0] > places["RightHand"][0]
