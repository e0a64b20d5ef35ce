"""A ``.glb`` or ``.gltf`` opened for reading: its document, node tree, accessors and images.

Nothing here knows of bones or skins. Whatever a file contains, reading ends in arrays of the right
shape or in a BadFileError that names the place in the document (``accessors[7]``).
"""

from __future__ import annotations

import base64
import binascii
import contextlib
import struct
import warnings
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Final, TypeVar
from urllib.parse import unquote

import numpy as np
import pygltflib
from numpy.typing import NDArray

from puppet.errors import BadFileError
from puppet.kernel import Floats

Item = TypeVar("Item")

#: Extensions that hide the geometry itself; a file that requires one of them cannot be read.
_PACKED: Final = {
    "KHR_draco_mesh_compression": "export it again without Draco compression",
    "EXT_meshopt_compression": "export it again without meshopt compression",
}
_DTYPES: Final = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
#: More elements than any puppet has; a damaged count must not ask for all the memory.
_MOST_ELEMENTS: Final = 20_000_000
#: Of a cycle, the nodes that are named.
_NAMED: Final = 12


class GltfFile:
    """The file at `path`.

    document: pygltflib's view of it. warnings: what was repaired, a sentence each, for people.

    Raises BadFileError if it is missing, empty, cut off, something else than glTF 2, or packed by
    an extension.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._said: dict[str, None] = {}
        self.document = _parse(path, _read(path, "the armature"))
        self._buffers: dict[int, bytes] = {}
        version = getattr(self.document.asset, "version", None)
        if not str(version).startswith("2"):
            raise BadFileError(
                "this version of glTF cannot be read",
                where=path,
                expected="glTF 2.0",
                found=f"glTF {version}",
                hint="open it in Blender and export it as glTF 2.0",
            )
        for name in self.document.extensionsRequired or ():
            if name in _PACKED:
                raise BadFileError(
                    "the meshes are packed by an extension",
                    where=path,
                    found=name,
                    hint=_PACKED[name],
                )

    def bad(self, place: str, what: str, **details: str) -> BadFileError:
        """The error for `place` in the document."""
        return BadFileError(what, where=f"{self.path}: {place}", **details)

    def warn(self, text: str) -> None:
        """Keep a sentence about a repair, once."""
        self._said.setdefault(text)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was said, in order."""
        return tuple(self._said)

    def item(self, items: Sequence[Item], index: object, kind: str) -> Item:
        """``items[index]``. Raises BadFileError if the document points at nothing."""
        if not isinstance(index, int) or not 0 <= index < len(items):
            raise self.bad(
                f"{kind}[{index}]",
                "the file points at something that is not in it",
                expected=f"an index below {len(items)}",
                found=str(index),
            )
        return items[index]

    # -- the node tree -------------------------------------------------------------------------

    @cached_property
    def parents(self) -> list[int]:
        """For each node the node it hangs on, or -1."""
        nodes = self.document.nodes
        parents = [-1] * len(nodes)
        for index, node in enumerate(nodes):
            for child in node.children or ():
                self.item(nodes, child, "nodes")
                if parents[child] >= 0:
                    self.warn(f"node {child} hangs on several nodes; it stays on the first")
                else:
                    parents[child] = index
        return parents

    @cached_property
    def _parents_first(self) -> list[int]:
        """All nodes, each after the one that it hangs on. Raises BadFileError for a cycle."""
        order = [node for node, parent in enumerate(self.parents) if parent < 0]
        below: dict[int, list[int]] = {}
        for node, parent in enumerate(self.parents):
            below.setdefault(parent, []).append(node)
        for node in order:  # it grows while we walk it
            order.extend(below.get(node, ()))
        if len(order) < len(self.parents):
            node = min(set(range(len(self.parents))) - set(order))
            line: dict[int, None] = {}
            while node not in line:
                line[node] = None
                node = self.parents[node]
            cycle = [*list(line)[list(line).index(node) :], node]
            raise self.bad(
                f"nodes[{node}]",
                "a node is its own ancestor",
                found=" → ".join(self.node_name(n) for n in reversed(cycle[:_NAMED])),
                hint="export it again: no program can draw a hierarchy that goes round",
            )
        return order

    def node_name(self, index: int) -> str:
        """What to call a node before people."""
        return str(self.document.nodes[index].name or f"node {index}")

    @cached_property
    def shown(self) -> list[int]:
        """The nodes of the scene that the file opens with, or all nodes if it has no scenes."""
        scenes = self.document.scenes or []
        if not scenes:
            return list(range(len(self.document.nodes)))
        scene = self.item(scenes, self.document.scene or 0, "scenes")
        inside = set(scene.nodes or ())
        for node in self._parents_first:
            if self.parents[node] in inside:
                inside.add(node)
        return sorted(inside & set(range(len(self.parents))))

    def ancestors(self, node: int) -> Iterator[int]:
        """The node's parent, its parent, and so on. Raises BadFileError if the file has a cycle."""
        _ = self._parents_first
        while (node := self.parents[node]) >= 0:
            yield node

    @cached_property
    def world_matrices(self) -> Floats:
        """(N, 4, 4) scene_from_node as the file leaves the nodes, that is, at rest."""
        world = np.zeros((len(self.parents), 4, 4))
        for node in self._parents_first:
            local, parent = self._local_matrix(node), self.parents[node]
            world[node] = local if parent < 0 else world[parent] @ local
        return world

    def _local_matrix(self, index: int) -> Floats:
        node = self.document.nodes[index]
        local = np.eye(4)
        if node.matrix is not None:
            local = np.array(node.matrix, float).reshape(4, 4).T
        else:
            turn = np.array([0, 0, 0, 1] if node.rotation is None else node.rotation, float)
            length = float(np.linalg.norm(turn))
            if length > 1e-6 and np.isfinite(length):
                local[:3, :3] = _matrix(turn / length)
            else:
                self.warn(f"node {node.name or index!r} had a rotation without meaning: ignored")
            if node.scale is not None:
                local[:3, :3] *= np.array(node.scale, float).reshape(3)
            if node.translation is not None:
                local[:3, 3] = np.array(node.translation, float).reshape(3)
        if not np.isfinite(local).all():
            self.warn(f"node {node.name or index!r} had a transform that is not a number: ignored")
            return np.eye(4)
        return local

    # -- arrays --------------------------------------------------------------------------------

    def array(self, index: object) -> NDArray[Any]:
        """The elements of an accessor as they are stored. -> (count, width)"""
        accessor = self.item(self.document.accessors, index, "accessors")
        place = f"accessors[{index}]"
        width = _WIDTHS.get(accessor.type)
        if width is None or accessor.componentType not in _DTYPES:
            raise self.bad(place, "unknown type", found=f"{accessor.componentType} {accessor.type}")
        dtype = np.dtype(_DTYPES[accessor.componentType])
        count = accessor.count
        if not isinstance(count, int) or not 0 <= count <= _MOST_ELEMENTS:
            raise self.bad(place, "the count makes no sense", found=str(count))
        if accessor.bufferView is None:
            values = np.zeros((count, width), dtype)
        else:
            values = self._strided(
                place, accessor.bufferView, accessor.byteOffset or 0, count, width, dtype
            )
        if accessor.sparse is not None:
            sparse = accessor.sparse
            of, to = sparse.indices, sparse.values
            kind = np.dtype(_DTYPES[of.componentType])
            rows = self._strided(place, of.bufferView, of.byteOffset or 0, sparse.count, 1, kind)
            new = self._strided(
                place, to.bufferView, to.byteOffset or 0, sparse.count, width, dtype
            )
            if (rows >= count).any():
                raise self.bad(place, "a sparse index is out of range", found=str(rows.max()))
            values = values.copy()
            values[rows[:, 0]] = new
        return values

    def floats(self, index: object, width: int) -> Floats:
        """The elements of an accessor as float64, normalised integers divided. -> (count, width)"""
        raw = self.array(index)
        if raw.shape[1] != width:
            raise self.bad(
                f"accessors[{index}]",
                "the elements have the wrong width",
                expected=str(width),
                found=str(raw.shape[1]),
            )
        values = raw.astype(float)
        if raw.dtype.kind != "f" and self.document.accessors[index].normalized:
            values = np.maximum(values / np.iinfo(raw.dtype).max, -1.0)
        return values

    def _strided(
        self, place: str, view: object, offset: int, count: int, width: int, dtype: np.dtype[Any]
    ) -> NDArray[Any]:
        data, stride = self._view(view)
        size = width * dtype.itemsize
        step = stride or size
        end = offset + step * (count - 1) + size if count else 0
        if offset < 0 or step < size or end > len(data):
            raise self.bad(
                place,
                "its data reach beyond the end of the buffer: the file was cut off or damaged",
                expected=f"at least {end} bytes",
                found=f"{len(data)} bytes",
            )
        strides = (step, dtype.itemsize)
        return np.ndarray((count, width), dtype, buffer=data, offset=offset, strides=strides)

    def _view(self, index: object) -> tuple[bytes, int]:
        view = self.item(self.document.bufferViews, index, "bufferViews")
        data = self._buffer(view.buffer)
        start, length = view.byteOffset or 0, view.byteLength or 0
        if start < 0 or length < 0 or start + length > len(data):
            raise self.bad(
                f"bufferViews[{index}]",
                "it reaches beyond the end of the buffer: the file was cut off or damaged",
                expected=f"at least {start + length} bytes",
                found=f"{len(data)} bytes",
            )
        return data[start : start + length], view.byteStride or 0

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            buffer = self.item(self.document.buffers, index, "buffers")
            if buffer.uri is None:
                data = self.document.binary_blob()
                if data is None:
                    raise self.bad(
                        f"buffers[{index}]", "its data are missing: the file was cut off"
                    )
                self._buffers[index] = data
            else:
                self._buffers[index] = self._resolve(buffer.uri, f"buffers[{index}]")
        return self._buffers[index]

    def image_bytes(self, index: object) -> bytes:
        """The encoded image (PNG, JPEG, ...), from wherever the document keeps it."""
        image = self.item(self.document.images, index, "images")
        if image.uri is not None:
            return self._resolve(image.uri, f"images[{index}]")
        return self._view(image.bufferView)[0]

    def _resolve(self, uri: str, place: str) -> bytes:
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            if not head.endswith(";base64"):
                return unquote(body).encode("latin-1", "replace")
            try:
                return base64.b64decode(body, validate=True)
            except binascii.Error as error:
                raise self.bad(place, "the embedded data are damaged", found=str(error)) from error
        folder = self.path.parent.resolve()
        # A file from somewhere else must not make the program read, or call, anything outside
        # the folder that it was put into.
        target = folder / unquote(uri)
        if "://" in uri or "\0" in target.name or not target.resolve().is_relative_to(folder):
            raise self.bad(
                place,
                "the file refers to something outside its folder",
                expected="data in the file, or a file beside it",
                found=uri[:80],
                hint="export it as a single .glb",
            )
        return _read(target.resolve(), f"a file that {self.path.name} refers to")


def _matrix(turn: Floats) -> Floats:
    x, y, z, w = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _read(path: Path, role: str) -> bytes:
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise BadFileError(f"{role} is not there", where=path, hint="check the path") from None
    except (OSError, ValueError) as error:
        raise BadFileError(f"{role} cannot be read", where=path, found=str(error)) from error
    if not data:
        raise BadFileError(f"{role} is empty", where=path, expected="a .glb or .gltf file")
    return data


def _parse(path: Path, data: bytes) -> pygltflib.GLTF2:
    foreign = BadFileError(
        "this is not a glTF file",
        where=path,
        expected="a .glb (its first bytes are 'glTF') or a .gltf (JSON)",
        found=f"a file that begins with {data[:12]!r}",
        hint="in Blender: File, Export, glTF 2.0 (.glb), with Skinning on",
    )
    binary = data[:4] == b"glTF"
    if not binary and not data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        raise foreign
    if binary and (len(data) < 20 or struct.unpack_from("<I", data, 8)[0] > len(data)):
        raise BadFileError(
            "the file was cut off",
            where=path,
            expected=f"{struct.unpack_from('<I', data, 8)[0] if len(data) >= 12 else 20} bytes",
            found=f"{len(data)} bytes",
            hint="copy or export it again",
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # chunks and versions it does not know: checked by us
        with contextlib.suppress(Exception):  # any kind of nonsense: answered below
            document = (
                pygltflib.GLTF2.load_from_bytes(data)
                if binary
                else pygltflib.GLTF2.gltf_from_json(data.decode("utf-8-sig"))
            )
            if isinstance(document, pygltflib.GLTF2):
                return document
    raise BadFileError(
        "the glTF document cannot be understood: the file was cut off or damaged",
        where=path,
        hint="copy or export it again",
    )
