"""Armatures and skins out of glTF files: built here with every defect that real files have."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from PIL import Image
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.errors import BadFileError, PuppetError
from puppet.formats.armature_toml import load_puppet, load_traits
from puppet.formats.gltf import load_model
from puppet.mesh import Model

ROOT = Path(__file__).parents[1]
SHARED = ROOT.parent / "shared" / "armatures"
RIGS = sorted(SHARED.rglob("*.gl[bt]*")) if SHARED.exists() else []

COMPONENTS = {"f": 5126, "B": 5121, "H": 5123, "I": 5125, "b": 5120}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Maker:
    """A glTF document in the making: two bones along +Y, and a square of skin that follows them."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0, 2]}],
            "nodes": [
                {"name": "root", "children": [1], "translation": [0, 1, 0]},
                {"name": "tip", "translation": [0, 1, 0]},
                {"name": "body", "mesh": 0, "skin": 0},
            ],
            "bufferViews": [],
            "accessors": [],
        }
        bind = np.tile(np.eye(4), (2, 1, 1))
        bind[0, 1, 3], bind[1, 1, 3] = -1.0, -2.0
        self.bind = self.add(bind.transpose(0, 2, 1).reshape(-1, 16).astype("f4"))
        self.document["skins"] = [{"joints": [0, 1], "inverseBindMatrices": self.bind}]
        self.corners = np.array([[-1, 1, 0], [1, 1, 0], [1, 3, 0], [-1, 3, 0]], "f4")
        self.document["meshes"] = [{"name": "skin", "primitives": [self.primitive()]}]

    @property
    def nodes(self) -> Any:
        return self.document["nodes"]

    @property
    def attributes(self) -> Any:
        return self.document["meshes"][0]["primitives"][0]["attributes"]

    def primitive(self) -> dict[str, Any]:
        return {
            "attributes": {
                "POSITION": self.add(self.corners),
                "JOINTS_0": self.add(np.array([[0, 0, 0, 0]] * 2 + [[1, 0, 0, 0]] * 2, "u1")),
                "WEIGHTS_0": self.add(np.array([[1, 0, 0, 0]] * 4, "f4")),
            },
            "indices": self.add(np.array([[0], [1], [2], [0], [2], [3]], "u2")),
        }

    def add(self, values: ArrayLike, **more: Any) -> int:
        array = np.ascontiguousarray(values)
        self.document["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        )
        self.data += array.tobytes() + b"\0" * (-array.nbytes % 4)
        self.document["accessors"].append(
            {
                "bufferView": len(self.document["bufferViews"]) - 1,
                "componentType": COMPONENTS[array.dtype.char],
                "count": len(array),
                "type": KINDS[array.shape[1]],
                **more,
            }
        )
        return len(self.document["accessors"]) - 1

    def glb(self) -> bytes:
        document = {**self.document, "buffers": [{"byteLength": len(self.data)}]}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.data), b"BIN\0") + bytes(self.data)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def gltf(self, uri: str) -> str:
        buffers = [{"byteLength": len(self.data), "uri": uri}]
        return json.dumps({**self.document, "buffers": buffers})


@pytest.fixture
def load(tmp_path: Path) -> Callable[[Maker], Model]:
    def write_and_load(maker: Maker) -> Model:
        path = tmp_path / "rig.glb"
        path.write_bytes(maker.glb())
        return load_model(path)

    return write_and_load


Load = Callable[[Maker], Model]


def check_sound(model: Model) -> None:
    """What every model must be, whatever the file was."""
    armature = model.armature
    assert len(set(armature.names)) == len(armature)
    for values in (armature.offsets, armature.rotations, armature.tips, *armature.rest):
        assert np.isfinite(values).all()
    np.testing.assert_allclose(np.linalg.norm(armature.rotations, axis=1), 1.0, atol=1e-6)
    for mesh in model.meshes:
        assert np.isfinite(mesh.positions).all()
        assert np.isfinite(mesh.uvs).all()
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-3)
        np.testing.assert_allclose(mesh.weights.sum(axis=1), 1.0, atol=1e-5)
        assert mesh.weights.min() >= 0.0
        assert mesh.bones.max() < len(armature)
        assert mesh.triangles.max() < len(mesh.positions)
        kinds = [a.dtype.char for a in (mesh.positions, mesh.bones, mesh.weights, mesh.triangles)]
        assert kinds == ["f", "H", "f", "I"]


def test_joints_become_bones_and_the_skin_stands_where_it_rests(load: Load) -> None:
    model = load(Maker())
    check_sound(model)
    assert model.armature.name == "rig"
    assert model.armature.names == ("root", "tip")
    assert model.armature.parents.tolist() == [-1, 0]
    np.testing.assert_allclose(model.armature.rest[0], [[0, 1, 0], [0, 2, 0]], atol=1e-6)
    np.testing.assert_allclose(model.meshes[0].positions, Maker().corners, atol=1e-6)
    np.testing.assert_allclose(model.meshes[0].normals, [[0, 0, 1]] * 4, atol=1e-6)
    assert model.warnings == ()


def test_a_leaf_ends_where_its_skin_ends(load: Load) -> None:
    np.testing.assert_allclose(load(Maker()).armature.rest_tips, [[0, 2, 0], [0, 3, 0]], atol=1e-5)


def test_root_scales_of_a_hundred_are_baked_away(load: Load) -> None:
    maker = Maker()
    maker.nodes.append({"name": "Armature", "scale": [100, 100, 100], "children": [0]})
    maker.document["scenes"][0]["nodes"] = [3, 2]
    model = load(maker)
    np.testing.assert_allclose(model.armature.rest[0], [[0, 100, 0], [0, 200, 0]], rtol=1e-6)
    np.testing.assert_allclose(model.armature.rotations, [[0, 0, 0, 1]] * 2, atol=1e-9)
    np.testing.assert_allclose(model.meshes[0].positions, 100 * Maker().corners, rtol=1e-5)


def test_a_rest_pose_that_is_not_the_bind_pose_moves_the_skin_with_it(load: Load) -> None:
    maker = Maker()
    turn = Rotation.from_euler("z", 90, degrees=True)
    maker.nodes[1]["rotation"] = turn.as_quat().tolist()
    model = load(maker)
    expected = Maker().corners.astype(float)
    joint = np.array([0, 2, 0])
    expected[2:] = turn.apply(expected[2:] - joint) + joint
    np.testing.assert_allclose(model.meshes[0].positions, expected, atol=1e-6)
    np.testing.assert_allclose(model.armature.rotations[1], turn.as_quat(), atol=1e-6)


def test_the_transform_of_a_skinned_node_is_ignored(load: Load) -> None:
    maker = Maker()
    maker.nodes[2] |= {"translation": [5, 5, 5], "scale": [3, 3, 3]}
    np.testing.assert_allclose(load(maker).meshes[0].positions, Maker().corners, atol=1e-6)


def test_nodes_between_joints_are_folded_in(load: Load) -> None:
    maker = Maker()
    maker.nodes[0]["children"] = [3]
    maker.nodes.append({"name": "between", "translation": [0, 0, 2], "children": [1]})
    armature = load(maker).armature
    assert armature.names == ("root", "tip")
    np.testing.assert_allclose(armature.offsets[1], [0, 1, 2], atol=1e-6)


def test_parents_come_before_children_whatever_the_order_of_joints(load: Load) -> None:
    maker = Maker()
    maker.document["skins"][0] = {"joints": [1, 0]}
    armature = load(maker).armature
    assert armature.names == ("root", "tip")


def test_several_skins_that_share_joints_make_one_armature(load: Load) -> None:
    maker = Maker()
    maker.document["skins"].append({"joints": [1, 0]})
    maker.document["meshes"].append({"primitives": [maker.primitive()]})
    maker.nodes.append({"mesh": 1, "skin": 1})
    maker.document["scenes"][0]["nodes"].append(3)
    model = load(maker)
    assert len(model.armature) == 2
    assert len(model.meshes) == 1  # one material, one mesh
    assert set(model.meshes[0].bones[4:6, 0]) == {1}


def test_several_roots_are_kept(load: Load) -> None:
    maker = Maker()
    del maker.nodes[0]["children"]
    maker.nodes[1]["translation"] = [5, 5, 5]  # near the first, it would be taken for its own
    maker.document["scenes"][0]["nodes"].append(1)
    assert load(maker).armature.parents.tolist() == [-1, -1]


def test_a_mesh_under_a_bone_follows_that_bone_alone(load: Load) -> None:
    maker = Maker()
    prop = maker.primitive()
    del prop["attributes"]["JOINTS_0"], prop["attributes"]["WEIGHTS_0"]
    maker.document["meshes"].append({"name": "hat", "primitives": [prop]})
    maker.nodes.append({"mesh": 1, "translation": [0, 0, 1]})
    maker.nodes[1]["children"] = [3]
    model = load(maker)
    hat = slice(4, 8)
    assert model.meshes[0].bones[hat, 0].tolist() == [1] * 4
    expected = Maker().corners + np.array([0, 2, 1], "f4")
    np.testing.assert_allclose(model.meshes[0].positions[hat], expected, atol=1e-6)
    assert model.warnings == ()


def test_a_mesh_under_no_bone_follows_the_root_and_says_so(load: Load) -> None:
    maker = Maker()
    maker.document["meshes"].append({"name": "hat", "primitives": [maker.primitive()]})
    maker.nodes.append({"mesh": 1})
    maker.document["scenes"][0]["nodes"].append(3)
    assert any("'hat'" in text and "'root'" in text for text in load(maker).warnings)


def test_unnamed_and_repeated_bones_get_names(load: Load) -> None:
    maker = Maker()
    del maker.nodes[0]["name"]
    model = load(maker)
    assert model.armature.names == ("bone_0", "tip")
    assert any("bone_0" in text for text in model.warnings)
    maker = Maker()
    maker.nodes[0]["name"] = "tip"
    model = load(maker)
    assert model.armature.names == ("tip", "tip_2")
    assert any("'tip'" in text for text in model.warnings)


@pytest.mark.parametrize(
    ("weights", "word"),
    [
        ([[np.nan, 1, 0, 0]] * 4, "no weights"),
        ([[-1.0, 1, 0, 0]] * 4, "no weights"),
        ([[0.7, 0.7, 0, 0]] * 4, "sum"),
        ([[0, 0, 0, 0]] * 4, "nearest"),
    ],
)
def test_bad_weights_are_repaired_with_a_warning(load: Load, weights: Any, word: str) -> None:
    maker = Maker()
    maker.attributes["WEIGHTS_0"] = maker.add(np.array(weights, "f4"))
    model = load(maker)
    check_sound(model)
    assert any("'skin'" in text and word in text for text in model.warnings)


def test_vertices_without_a_bone_take_the_nearest(load: Load) -> None:
    maker = Maker()
    maker.attributes["WEIGHTS_0"] = maker.add(np.zeros((4, 4), "f4"))
    assert load(maker).meshes[0].bones[:, 0].tolist() == [0, 0, 1, 1]


def test_integer_weights_are_fractions_of_their_range(load: Load) -> None:
    maker = Maker()
    weights = np.array([[191, 64, 0, 0]] * 4, "u1")
    maker.attributes["WEIGHTS_0"] = maker.add(weights, normalized=True)
    maker.attributes["JOINTS_0"] = maker.add(np.array([[0, 1, 0, 0]] * 4, "u2"))
    model = load(maker)
    np.testing.assert_allclose(model.meshes[0].weights[0, :2], [191 / 255, 64 / 255], atol=1e-5)
    assert model.warnings == ()


def test_of_eight_influences_the_strongest_four_stay(load: Load) -> None:
    maker = Maker()
    for name, weights in (("0", [0.05, 0.05, 0.3, 0.1]), ("1", [0.2, 0.2, 0.1, 0.0])):
        maker.attributes[f"JOINTS_{name}"] = maker.add(np.array([[0, 1, 0, 1]] * 4, "u1"))
        maker.attributes[f"WEIGHTS_{name}"] = maker.add(np.array([weights] * 4, "f4"))
    mesh = load(maker).meshes[0]
    np.testing.assert_allclose(mesh.weights[0], np.array([0.3, 0.2, 0.2, 0.1]) / 0.8, atol=1e-5)
    assert mesh.bones[0].tolist() == [0, 0, 1, 1]


def test_sparse_accessors_change_what_they_name(load: Load) -> None:
    maker = Maker()
    rows = maker.add(np.array([[3]], "u1"))
    values = maker.add(np.array([[-1, 5, 0]], "f4"))
    maker.document["accessors"][maker.attributes["POSITION"]]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": rows, "componentType": 5121},
        "values": {"bufferView": values},
    }
    np.testing.assert_allclose(load(maker).meshes[0].positions[3], [-1, 5, 0], atol=1e-6)


def test_triangles_without_area_and_without_vertices_are_left_out(load: Load) -> None:
    maker = Maker()
    index = np.array([[0], [1], [2], [0], [0], [2], [0], [1], [99]], "u2")
    maker.document["meshes"][0]["primitives"][0]["indices"] = maker.add(index)
    model = load(maker)
    assert model.meshes[0].triangles.tolist() == [[0, 1, 2]]
    assert len(model.warnings) == 2


def test_a_mirrored_skin_is_not_turned_inside_out(load: Load) -> None:
    maker = Maker()
    maker.attributes["NORMAL"] = maker.add(np.array([[0, 0, 1]] * 4, "f4"))
    maker.nodes.append({"scale": [-1, 1, 1], "children": [0]})
    maker.document["scenes"][0]["nodes"] = [3, 2]
    mesh = load(maker).meshes[0]
    a, b, c = mesh.positions[mesh.triangles[0]]
    face = np.cross(b - a, c - a)
    assert face @ mesh.normals[mesh.triangles[0, 0]] > 0.0


@pytest.mark.parametrize("bad", [{"rotation": [0, 0, 0, 0]}, {"scale": [0, 0, 0]}])
def test_transforms_without_meaning_do_not_spread(load: Load, bad: dict[str, Any]) -> None:
    maker = Maker()
    maker.nodes[1] |= bad
    check_sound(load(maker))


def test_base_colour_textures_are_decoded(load: Load) -> None:
    maker = Maker()
    png = io.BytesIO()
    Image.new("RGB", (3, 2), (10, 20, 30)).save(png, "PNG")
    uri = "data:image/png;base64," + base64.b64encode(png.getvalue()).decode()
    pbr = {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 0.4}
    maker.document |= {
        "images": [{"uri": uri}],
        "textures": [{"source": 0}],
        "materials": [{"name": "paint", "pbrMetallicRoughness": pbr}],
    }
    maker.document["meshes"][0]["primitives"][0]["material"] = 0
    maker.attributes["TEXCOORD_0"] = maker.add(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], "f4"))
    mesh = load(maker).meshes[0]
    assert mesh.material.texture is not None
    assert mesh.material.texture.shape == (2, 3, 4)
    assert mesh.material.texture[0, 0].tolist() == [10, 20, 30, 255]
    assert mesh.material.roughness == pytest.approx(0.4)
    assert mesh.uvs[2].tolist() == [1, 1]

    maker.document["images"] = [{"uri": "data:image/png;base64,AAAA"}]
    model = load(maker)
    assert model.meshes[0].material.texture is None
    assert any("'paint'" in text for text in model.warnings)


def test_a_gltf_reads_its_buffer_from_beside_it_or_from_itself(tmp_path: Path) -> None:
    maker = Maker()
    (tmp_path / "my data.bin").write_bytes(maker.data)
    inside = "data:application/octet-stream;base64," + base64.b64encode(maker.data).decode()
    for uri in ("my%20data.bin", inside):
        path = tmp_path / "rig.gltf"
        path.write_text(maker.gltf(uri))
        check_sound(load_model(path))


@pytest.mark.parametrize(
    "uri", ["../secret.bin", "/etc/hostname", "http://a.b/c.bin", "file:///etc/passwd", "%2e%2e/x"]
)
def test_nothing_outside_the_folder_is_read(tmp_path: Path, uri: str) -> None:
    folder = tmp_path / "inner"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(Maker().data)
    path = folder / "rig.gltf"
    path.write_text(Maker().gltf(uri))
    with pytest.raises(BadFileError, match="outside its folder"):
        load_model(path)


def test_a_file_without_a_skin_says_how_to_get_one(tmp_path: Path) -> None:
    maker = Maker()
    del maker.document["skins"], maker.nodes[2]["skin"]
    path = tmp_path / "rock.glb"
    path.write_bytes(maker.glb())
    with pytest.raises(BadFileError, match=r"no skin[\s\S]*Skinning"):
        load_model(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "not there"),
        (b"", "empty"),
        (b"BM not a model at all", "not a glTF file"),
        (b"{}", "no skin"),
        (b'{"asset": {"version": "2.0"}}', "no skin"),
        (b'{"asset": {"version": "1.0"}}', "version"),
        (b'{"asset": {"version": "2.0"}, "nodes": 7}', "glTF document"),
        (b'{"asset": [', "cut off or damaged"),
    ],
)
def test_files_that_are_not_armatures_are_refused(
    tmp_path: Path, content: bytes | None, message: str
) -> None:
    path = tmp_path / "rig.glb"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadFileError, match=message):
        load_model(path)


def test_a_hierarchy_that_bites_its_tail_is_refused(load: Load) -> None:
    maker = Maker()
    maker.nodes[1]["children"] = [0]
    with pytest.raises(BadFileError, match="its own ancestor"):
        load(maker)


def test_packed_meshes_are_refused_by_name(load: Load) -> None:
    maker = Maker()
    maker.document["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    with pytest.raises(BadFileError, match="draco"):
        load(maker)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_a_damaged_file_is_refused_or_repaired_but_never_crashes(
    tmp_path: Path, data: st.DataObject
) -> None:
    whole = bytearray(Maker().glb())
    for _ in range(data.draw(st.integers(0, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(whole))) if data.draw(st.booleans()) else len(whole)
    path = tmp_path / "damaged.glb"
    path.write_bytes(whole[:cut])
    with contextlib.suppress(PuppetError):
        check_sound(load_model(path))


@pytest.mark.skipif(not RIGS, reason="the shared armatures are not here")
@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_every_real_rig_loads(path: Path) -> None:
    model = load_model(path)
    check_sound(model)
    assert model.meshes
    skin = np.concatenate([mesh.positions for mesh in model.meshes])
    middle, size = skin.mean(axis=0), float(np.ptp(skin, axis=0).max())
    # Bones and skin are at the same place and of the same size: nothing was scaled apart.
    used = np.unique(np.concatenate([m.bones[m.weights > 0.1] for m in model.meshes]))
    away = np.linalg.norm(model.armature.rest[0][used] - middle, axis=1)
    assert away.max() < 1.5 * size


# -- the .toml beside the .glb -----------------------------------------------------------------


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.glb"
    path.write_bytes(Maker().glb())
    return path


def test_without_a_toml_everything_is_free(rig: Path) -> None:
    puppet = load_puppet(rig)
    assert np.isinf(puppet.model.armature.limits).all()
    assert not puppet.traits.grounded


def test_limits_are_degrees_in_the_file_and_radians_in_the_armature(rig: Path) -> None:
    rig.with_suffix(".toml").write_text("grounded = true\n[bones.tip]\nlimit = 60\n")
    puppet = load_puppet(rig)
    limits = puppet.model.armature.limits
    assert np.isinf(limits[0])
    assert limits[1] == pytest.approx(np.pi / 3)
    assert not limits.flags.writeable
    assert puppet.traits.grounded


@pytest.mark.parametrize("forward", ["+x", "-x", "-z"])
def test_a_puppet_that_faces_elsewhere_is_turned_to_face_forward(rig: Path, forward: str) -> None:
    rig.with_suffix(".toml").write_text(f'forward = "{forward}"\n')
    plain, turned = load_model(rig), load_puppet(rig).model
    way = np.array([1.0, 0.0, 0.0] if forward[1] == "x" else [0.0, 0.0, 1.0])
    way = way if forward[0] == "+" else -way
    # A step ahead in the file becomes a step along +Z; heights and shapes stay.
    ahead = plain.meshes[0].positions @ way
    np.testing.assert_allclose(turned.meshes[0].positions[:, 2], ahead, atol=1e-6)
    np.testing.assert_allclose(turned.armature.rest[0][:, 1], plain.armature.rest[0][:, 1])
    check_sound(turned)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("grounded = 1", r"grounded"),
        ("colour = 'red'", "colour"),
        ("[bones.tip]\nlimits = 4", r"bones\.tip[\s\S]*limits"),
        ("[bones.tip]\nlimit = 'far'", r"bones\.tip[\s\S]*limit"),
        ("[bones.tip]\nlimit = 400", r"bones\.tip[\s\S]*180"),
        ("[bones.tail]\nlimit = 4", r"no such bone[\s\S]*root, tip"),
        ("forward = 'up'", "forward"),
        ("forward = ", "not TOML"),
    ],
)
def test_a_bad_toml_is_refused_with_the_place(rig: Path, text: str, message: str) -> None:
    rig.with_suffix(".toml").write_text(text)
    with pytest.raises(BadFileError, match=message):
        load_puppet(rig)


def test_a_toml_that_is_not_there_is_an_error_when_asked_for(tmp_path: Path) -> None:
    armature = Armature.build("a", ["root"], [-1], np.zeros((1, 3)))
    with pytest.raises(BadFileError, match="cannot be read"):
        load_traits(tmp_path / "none.toml", armature)
