"""Converts numpy meshes for sending, and UV per corner to UV per vertex."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Optional

import numpy as np

from .errors import ArrayError

if TYPE_CHECKING:
    import numpy.typing as npt

#: Upper bound of triangles in one message.
_MOST_TRIANGLES = (2**31 - 1) // 3


@dataclass(frozen=True, eq=False)
class PackedMesh:
    """A mesh ready for sending. Made by :func:`pack_mesh`, which has checked it."""

    positions: bytes  # float32, little-endian, 12 bytes a vertex
    triangles: bytes  # uint32, little-endian, 12 bytes a triangle
    elements: Dict[str, Any]  # arrays of little-endian numbers, 4 bytes each, by the fields of planish.v1.MeshElements
    indices: Any  # the triangles as an array, (F, 3)

    @property
    def triangle_count(self) -> int:
        return len(self.triangles) // 12

    @property
    def byte_count(self) -> int:
        """The size of the mesh in bytes, as the server's limit counts it."""
        return len(self.positions) + len(self.triangles) + sum(values.nbytes for values in self.elements.values())

    def sha256(self) -> bytes:
        digest = hashlib.sha256(self.positions)
        digest.update(self.triangles)
        return digest.digest()

    @property
    def vertex_count(self) -> int:
        return len(self.positions) // 12

    def draco(self) -> bytes:
        """The same mesh as a Draco file, the format of uploads: sequential, not compressed, in the same order. For
        meshes with no more vertices than corners: Draco's decoder refuses others.

        Bitstream 2.2: header, counts, indices as they are, one attribute of three floats with its values as they are.
        """
        vertices = self.vertex_count
        header = b"DRACO" + bytes([2, 2, 1, 0, 0, 0])  # a mesh, sequential, no flags
        counts = _varint(self.triangle_count) + _varint(vertices) + b"\1"  # indices not compressed
        attribute = bytes([1, 1, 0, 9, 3, 0, 0, 0])  # 1 decoder, 1 attribute: POSITION, FLOAT32, 3, plain, id 0, raw
        return b"".join([header, counts, _draco_indices(self.indices, vertices), attribute, self.positions])


def pack_mesh(
    positions: Any,
    triangles: Any,
    *,
    seam_edges: Any = None,
    seam_corners: Any = None,
    parts: Any = None,
    uncut_corners: Any = None,
    face_polygon: Any = None,
    face_atlas: Any = None,
    face_weights: Any = None,
) -> PackedMesh:
    """Checks the arrays of a mesh and lays them out for the wire. Raises :class:`planish.ArrayError`, which names the argument.

    The parameters are those of :meth:`planish.Client.unwrap`.
    """
    values, xyz = _positions(positions)
    faces = _triangles(triangles, len(xyz))
    origin = _local_origin(values, faces)
    if origin.any():
        xyz = (values - origin).astype("<f4")
    polygon = _of_faces("face_polygon", face_polygon, len(faces), "iu", "integers", 0, len(faces) - 1)
    given = [_corners("seam_corners", seam_corners, len(faces))]
    if seam_edges is not None:
        given.append(_corners_of_edges(seam_edges, faces, polygon))
    if parts is not None:
        given.append(_corners_between_parts(parts, faces))
    return PackedMesh(
        positions=xyz.tobytes(),
        triangles=faces.tobytes(),
        elements={
            "seam_corners": np.concatenate(given).astype("<u4"),
            "uncut_corners": _corners("uncut_corners", uncut_corners, len(faces)).astype("<u4"),
            "face_polygon": polygon.astype("<u4"),
            "face_atlas": _of_faces("face_atlas", face_atlas, len(faces), "iu", "integers", 0, 2**31 - 1).astype("<u4"),
            "face_weights": _of_faces("face_weights", face_weights, len(faces), "fiu", "real numbers", 0.01, 100).astype("<f4"),
        },
        indices=faces,
    )


def _varint(number: int) -> bytes:
    low, rest = number & 127, number >> 7
    return bytes([low | 128]) + _varint(rest) if rest else bytes([low])


def _draco_indices(faces: Any, vertices: int) -> bytes:
    """The indices in the width that Draco has for this many vertices."""
    if vertices >= 1 << 21:
        return faces.astype("<u4").tobytes()  # type: ignore[no-any-return]
    if vertices >= 1 << 16:  # as varints, of three bytes at most
        flat = faces.reshape(-1)
        digits = np.stack([flat, flat >> 7, flat >> 14], axis=1)
        is_there = np.stack([np.ones(len(flat), bool), flat >= 1 << 7, flat >= 1 << 14], axis=1)
        digits &= 127
        digits[:, :2] |= is_there[:, 1:] * np.uint32(128)
        return digits.astype(np.uint8)[is_there].tobytes()  # type: ignore[no-any-return]
    return faces.astype("<u2" if vertices >= 1 << 8 else "u1").tobytes()  # type: ignore[no-any-return]


# Checks -----------------------------------------------------------------------------------------------------------------


def _refused(argument: str, message: str, reason: str, metadata: Optional[Dict[str, str]] = None) -> ArrayError:
    return ArrayError(f"{argument}{message}", argument=argument, reason=reason, metadata=metadata)


def _as_array(argument: str, value: Any, kinds: str, wanted: str, reason: str) -> Any:
    try:
        array = np.asarray(value)
    except Exception as error:  # any exception of the library that made the value
        raise _refused(argument, f" cannot be read as an array: {error}", reason) from error
    if array.dtype.kind not in kinds and not (array.size == 0 and array.dtype.kind == "f"):
        raise _refused(argument, f" must be {wanted}, not {array.dtype}", reason)
    return array


def _check_shape(argument: str, array: Any, columns: Optional[int], reason: str) -> None:
    if columns is None:
        if array.ndim != 1:
            raise _refused(argument, f" must have one dimension, not the shape {array.shape}", reason)
    elif array.ndim != 2 or array.shape[1] != columns:
        raise _refused(argument, f" must have the shape (N, {columns}), not {array.shape}", reason)


def _positions(value: Any) -> Any:
    """The array as given, and rounded to float32."""
    reason = "MESH_POSITION_INVALID"
    array = _as_array("positions", value, "fiu", "real numbers", reason)
    _check_shape("positions", array, 3, reason)
    with np.errstate(over="ignore"):
        floats = np.ascontiguousarray(array, dtype="<f4")
    finite = np.isfinite(floats)
    if not finite.all():
        v, k = (int(i) for i in np.argwhere(~finite)[0])
        bad = np.flatnonzero(~finite.all(axis=1))
        ids = ",".join(str(i) for i in bad[:16])
        message = f"[{v}, {k}] is {array[v, k]}, which is no number of single precision"
        if len(bad) > 1:
            message += f"; {len(bad)} vertices have such"
        raise _refused("positions", message, "MESH_POSITION_NOT_FINITE", {"vertices": ids})
    return array, floats


def _local_origin(positions: Any, faces: Any) -> Any:
    """The point to subtract from positions, in double, before they are rounded: the rule of core/mesh/local_origin.h."""
    origin = np.zeros(3)
    if positions.dtype.kind == "f" and positions.dtype.itemsize <= 4:
        return origin
    is_used = np.zeros(len(positions), bool)
    is_used[faces.reshape(-1)] = True
    used = positions[is_used].astype(np.float64)
    low, high = used.min(axis=0), used.max(axis=0)
    side = float((high - low).max())
    if side <= 0 or np.array_equal(used, used.astype(np.float32)):
        return origin
    step = math.ldexp(1.0, math.frexp(side)[1] - 2)
    middle = low / 2 + high / 2
    is_far = (np.abs(middle) > side) & (step > 0)
    origin[is_far] = np.floor(middle[is_far] / step + 0.5) * step
    return origin


def _triangles(value: Any, vertices: int) -> Any:
    array = _as_array("triangles", value, "iu", "integers", "MESH_INDEX_OUT_OF_RANGE")
    if array.size == 0:
        raise _refused("triangles", " is empty: there is nothing to flatten", "MESH_EMPTY")
    _check_shape("triangles", array, 3, "MESH_INDEX_OUT_OF_RANGE")
    if len(array) > _MOST_TRIANGLES:
        raise _refused("triangles", f" has {len(array)} rows, the most is {_MOST_TRIANGLES}", "MESH_TOO_LARGE")
    if int(array.min()) < 0 or int(array.max()) >= vertices:
        bad = (array < 0) | (array >= vertices)
        f, k = (int(i) for i in np.argwhere(bad)[0])
        raise _refused(
            "triangles",
            f"[{f}, {k}] is {array[f, k]}, but there are {vertices} vertices, numbered from 0",
            "MESH_INDEX_OUT_OF_RANGE",
            {"faces": ",".join(str(i) for i in np.flatnonzero(bad.any(axis=1))[:16])},
        )
    return np.ascontiguousarray(array, dtype="<u4")


def _corners(argument: str, value: Any, faces: int) -> Any:
    if value is None:
        return np.zeros(0, np.int32)
    array = _as_array(argument, value, "iu", "integers", "OPTIONS_INVALID")
    _check_shape(argument, array, None, "OPTIONS_INVALID")
    bad = np.flatnonzero((array < 0) | (array >= 3 * faces))
    if len(bad) > 0:
        corner = int(array[bad[0]])
        raise _refused(
            argument,
            f"[{bad[0]}] is {corner}, but {faces} triangles have the corners 0 to {3 * faces - 1}",
            "OPTIONS_INVALID",
            {"field": argument, "corner": str(corner)},
        )
    return array.astype(np.int32)


def _of_faces(argument: str, value: Any, faces: int, kinds: str, wanted: str, low: float, high: float) -> Any:
    """Checks an array with one number for each triangle, and returns it; an empty one for None."""
    if value is None:
        return np.zeros(0)
    array = _as_array(argument, value, kinds, wanted, "OPTIONS_INVALID")
    _check_shape(argument, array, None, "OPTIONS_INVALID")
    if len(array) != faces:
        raise _refused(argument, f" has {len(array)} numbers for {faces} triangles", "OPTIONS_INVALID", {"field": argument})
    bad = np.flatnonzero(~((array >= low) & (array <= high)))
    if len(bad) > 0:
        f = int(bad[0])
        message = f"[{f}] is {array[f]}; it must be in [{low}, {high}]"
        raise _refused(argument, message, "OPTIONS_INVALID", {"field": argument, "face": str(f)})
    return array


# Seams ------------------------------------------------------------------------------------------------------------------


def _edge_keys(faces: Any) -> Any:
    """The edge that each corner faces, as a number: corner 3 f + k faces the edge between the other two corners of
    f."""
    a = faces[:, [1, 2, 0]].reshape(-1).astype(np.uint64)
    b = faces[:, [2, 0, 1]].reshape(-1).astype(np.uint64)
    return (np.minimum(a, b) << np.uint64(32)) | np.maximum(a, b)


def _corners_of_edges(seam_edges: Any, faces: Any, polygon: Any) -> Any:
    """For each of the edges, a corner that faces it. Diagonals of polygons do not count as edges; `polygon` is empty,
    or has the polygon of each face."""
    array = _as_array("seam_edges", seam_edges, "iu", "integers", "OPTIONS_INVALID")
    if array.size == 0:
        return np.zeros(0, np.int32)
    _check_shape("seam_edges", array, 2, "OPTIONS_INVALID")
    negative = np.flatnonzero((array < 0).any(axis=1) | (array >= 2**32).any(axis=1))
    pairs = np.sort(np.where(array < 0, 0, array).astype(np.uint64), axis=1)
    wanted = (pairs[:, 0] << np.uint64(32)) | (pairs[:, 1] & np.uint64(0xFFFFFFFF))
    edge_of_corner = _edge_keys(faces)
    is_edge = ~_is_diagonal(edge_of_corner, polygon)
    keys, corner = np.unique(edge_of_corner[is_edge], return_index=True)
    corner = np.flatnonzero(is_edge)[corner]
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    missing = np.union1d(np.flatnonzero(keys[at] != wanted), negative)
    if len(missing) > 0:
        a, b = (int(v) for v in array[missing[0]])
        raise _refused(
            "seam_edges",
            f"[{missing[0]}]: no {'triangle' if len(polygon) == 0 else 'polygon'} has the edge from vertex {a} to vertex {b}",
            "OPTIONS_INVALID",
            {"field": "seam_edges", "edges": f"{a}-{b}"},
        )
    return corner[np.unique(at)].astype(np.int32)


def _is_diagonal(edge_of_corner: Any, polygon: Any) -> Any:
    """Whether the edge that each corner faces lies between two triangles of the same polygon."""
    result = np.zeros(len(edge_of_corner), bool)
    if len(polygon) == 0:
        return result
    of_corner = np.repeat(polygon.astype(np.int64), 3)
    order = np.lexsort((of_corner, edge_of_corner))
    same = (np.diff(edge_of_corner[order]) == 0) & (np.diff(of_corner[order]) == 0)
    result[order[1:][same]] = True
    result[order[:-1][same]] = True
    return result


def _corners_between_parts(parts: Any, faces: Any) -> Any:
    labels = _as_array("parts", parts, "iub", "integers", "OPTIONS_INVALID")
    _check_shape("parts", labels, None, "OPTIONS_INVALID")
    if len(labels) != len(faces):
        raise _refused("parts", f" has {len(labels)} labels for {len(faces)} triangles", "OPTIONS_INVALID")
    keys = _edge_keys(faces)
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.r_[True, np.diff(keys[order]) != 0])
    of_corner = np.repeat(labels.astype(np.int64), 3)[order]
    differs = np.minimum.reduceat(of_corner, starts) != np.maximum.reduceat(of_corner, starts)
    return order[starts[differs]].astype(np.int32)


# UV per vertex ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class VertexSplit:
    """A mesh whose vertices have one UV each, as renderers and most file formats want them.

    The given vertices keep their numbers. A vertex with several UV, at a seam, gets a copy for each further UV; the
    copies come after all given vertices. An attribute is carried over by ``attribute[split.source_vertex]``.
    """

    source_vertex: npt.NDArray[np.uint32]  #: (V',): the given vertex of each vertex; begins with 0, 1, 2, ...
    triangles: npt.NDArray[np.uint32]  #: (F, 3), in the given order
    uv: npt.NDArray[Any]  #: (V', 2), of the given type; (0, 0) for vertices without a triangle


def split_vertices(vertex_count: int, triangles: Any, uv: Any) -> VertexSplit:
    """Converts UV per corner, (F, 3, 2) as :attr:`Result.uv`, to UV per vertex. Needs no server. Raises
    :class:`planish.ArrayError`.

    Corners of a vertex share a new vertex if their UV are equal (0 and -0 alike).
    """
    faces = _triangles(triangles, vertex_count)
    corner_uv = _as_array("uv", uv, "f", "floating-point numbers", "OPTIONS_INVALID")
    if corner_uv.shape != (len(faces), 3, 2):
        raise _refused("uv", f" must have the shape {(len(faces), 3, 2)}, not {corner_uv.shape}", "OPTIONS_INVALID")
    flat = corner_uv.reshape(-1, 2) + np.zeros(1, corner_uv.dtype)  # -0 becomes 0
    vertex = faces.reshape(-1)
    order = np.lexsort((flat[:, 1], flat[:, 0], vertex))
    v, p = vertex[order], flat[order]
    is_new = np.r_[True, (v[1:] != v[:-1]) | (p[1:] != p[:-1]).any(axis=1)]
    group = np.cumsum(is_new) - 1  # per corner in `order`: the number of its pair (vertex, UV)
    first = order[is_new]  # the sort is stable: the first corner of each pair
    owner = vertex[first]
    # Of the pairs of one vertex, which are consecutive, that which comes first in the mesh keeps the vertex's number.
    starts = np.flatnonzero(np.r_[True, owner[1:] != owner[:-1]])
    keeps = first == np.repeat(np.minimum.reduceat(first, starts), np.diff(np.r_[starts, len(owner)]))
    number = np.empty(len(first), np.int64)
    number[keeps] = owner[keeps]
    copies = np.flatnonzero(~keeps)
    copies = copies[np.argsort(first[copies], kind="stable")]
    number[copies] = vertex_count + np.arange(len(copies))
    source = np.concatenate([np.arange(vertex_count), owner[copies]]).astype(np.uint32)
    vertex_uv = np.zeros((len(source), 2), corner_uv.dtype)
    vertex_uv[number] = flat[first]
    new_triangles = np.empty(len(vertex), np.uint32)
    new_triangles[order] = number[group]
    return VertexSplit(source, new_triangles.reshape(-1, 3), vertex_uv)


def chart_of_faces(split: VertexSplit) -> npt.NDArray[np.int64]:
    """The chart of each triangle, (F,), numbered by first appearance: triangles that share a vertex of the split."""
    faces = split.triangles.astype(np.int64)
    label = np.arange(len(split.source_vertex))
    while True:
        low = label[faces].min(axis=1)
        before = label.copy()
        # Each vertex takes the lowest label of its triangles; so does the vertex whose number was its label.
        order = np.argsort(-low, kind="stable")
        for k in range(3):
            target = faces[order, k]
            label[target] = np.minimum(label[target], low[order])
            root = before[target]
            label[root] = np.minimum(label[root], low[order])
        label = label[label]
        if np.array_equal(label, before):
            break
    of_face = label[faces[:, 0]]
    _, index, inverse = np.unique(of_face, return_index=True, return_inverse=True)
    rank = np.empty(len(index), np.int64)
    rank[np.argsort(index)] = np.arange(len(index))
    return rank[inverse]
