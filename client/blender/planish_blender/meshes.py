"""Converts Blender's meshes to arrays of triangles, and UV back to loops of polygons."""

import math
from dataclasses import dataclass
from typing import Any

import bmesh
import bpy
import numpy as np

#: UV of one vertex that differ by more belong to different islands.
_UV_GAP = 1e-5
#: Maximal number of elements in a message.
_MOST_NAMED = 4


class Unusable(Exception):
    """A mesh that cannot be unwrapped; the message is for people."""


@dataclass(eq=False)
class Part:
    """One mesh, as triangles. Corner 3 f + k is corner k of triangle f, and faces the edge between the other two."""

    object: Any
    positions: Any  # (V, 3) float32, in the size that the object has in the scene
    triangles: Any  # (F, 3) vertices
    loops: Any  # (F, 3) loops of the mesh
    polygon: Any  # (F,) polygons of the mesh, ascending
    loop_vertex: Any  # (L,) vertex of each loop
    loop_total: Any  # (P,) loops of each polygon, which are consecutive
    seam_corners: Any  # corners that face an edge which the user wants to cut
    loop_count: int
    # For textures:
    uv_map: Any = None  # name of the active UV map; None if there is none
    render_uv_map: Any = None  # of the one that materials read which name none
    uv: Any = None  # (L, 2) of the active UV map
    own_positions: Any = None  # (V, 3) in the object's own space
    normals: Any = None  # (L, 3)
    material: Any = None  # (P,) slot of each polygon


def _get(collection, name, columns, kind):
    values = np.empty(len(collection) * columns, kind)
    collection.foreach_get(name, values)
    return values.reshape(-1, columns) if columns > 1 else values


def read(object, sources, for_textures=False):
    """The mesh of an object. `sources`: "SEAM", "SHARP", "MATERIAL", "UV": the edges that are seams."""
    if object.data.library is not None:
        raise Unusable(f"the mesh of {object.name} is linked from another file and cannot be changed")
    if object.mode != "EDIT":
        return _read(object, object.data, sources, for_textures)
    object.update_from_editmode()
    copy = object.data.copy()  # while a mesh is edited, Blender hides its UV
    try:
        return _read(object, copy, sources, for_textures)
    finally:
        bpy.data.meshes.remove(copy)


def _read(object, mesh, sources, for_textures):
    mesh.calc_loop_triangles()
    if len(mesh.loop_triangles) == 0:
        raise Unusable(f"{object.name} has no faces")
    loops = _get(mesh.loop_triangles, "loops", 3, np.int32)
    loop_vertex = _get(mesh.loops, "vertex_index", 1, np.int32)
    loop_edge = _get(mesh.loops, "edge_index", 1, np.int32)
    after = _next_loop(mesh)
    from_loop, to_loop = loops[:, [1, 2, 0]], loops[:, [2, 0, 1]]
    edge = np.where(after[from_loop] == to_loop, loop_edge[from_loop], -1)
    edge = np.where(after[to_loop] == from_loop, loop_edge[to_loop], edge).reshape(-1)
    is_seam = _seam_edges(object, mesh, sources, loop_vertex, loop_edge, after)
    more = {}
    active = mesh.uv_layers.active
    if for_textures and active is not None:
        more = {
            "uv_map": active.name,
            "render_uv_map": next((layer.name for layer in mesh.uv_layers if layer.active_render), None),
            "uv": _get(active.data, "uv", 2, np.float32),
            "own_positions": _get(mesh.vertices, "co", 3, np.float32),
            "normals": _corner_normals(mesh),
            "material": _get(mesh.polygons, "material_index", 1, np.int32),
        }
    return Part(
        object=object,
        positions=_scaled(object, _get(mesh.vertices, "co", 3, np.float32)),
        triangles=loop_vertex[loops],
        loops=loops,
        polygon=_get(mesh.loop_triangles, "polygon_index", 1, np.int32),
        loop_vertex=loop_vertex,
        loop_total=_get(mesh.polygons, "loop_total", 1, np.int32),
        seam_corners=np.flatnonzero((edge >= 0) & is_seam[edge]).astype(np.int32),
        loop_count=len(mesh.loops),
        **more,
    )


def _corner_normals(mesh):
    if hasattr(mesh, "corner_normals"):  # 4.1 and later
        return _get(mesh.corner_normals, "vector", 3, np.float32)
    mesh.calc_normals_split()
    return _get(mesh.loops, "normal", 3, np.float32)


def _next_loop(mesh):
    start = _get(mesh.polygons, "loop_start", 1, np.int32)
    total = _get(mesh.polygons, "loop_total", 1, np.int32)
    after = np.arange(1, len(mesh.loops) + 1, dtype=np.int32)
    after[start + total - 1] = start
    return after


def _scaled(object, positions):
    """Positions as in the scene, except for the translation. Mirrored objects keep their own orientation."""
    matrix = np.array(object.matrix_world.to_3x3(), np.float64)
    determinant = np.linalg.det(matrix)
    if determinant == 0 or not np.isfinite(determinant) or np.array_equal(matrix, np.eye(3)):
        return positions
    scaled = positions.astype(np.float64) @ (np.sign(determinant) * matrix).T
    return (scaled - _local_origin(scaled)).astype(np.float32)


def _local_origin(positions):
    """The point to subtract from doubles before they are rounded to float32: the rule of core/mesh/local_origin.h."""
    origin = np.zeros(3)
    finite = np.where(np.isfinite(positions), positions, np.nan)
    if len(positions) == 0 or np.isnan(finite).all(axis=0).any():
        return origin
    low, high = np.nanmin(finite, axis=0), np.nanmax(finite, axis=0)
    side = float((high - low).max())
    if side <= 0 or np.array_equal(positions, positions.astype(np.float32)):
        return origin
    step = math.ldexp(1.0, math.frexp(side)[1] - 2)
    middle = low / 2 + high / 2
    is_far = (np.abs(middle) > side) & (step > 0)
    origin[is_far] = np.floor(middle[is_far] / step + 0.5) * step
    return origin


# Seams ------------------------------------------------------------------------------------------------------------------


def _seam_edges(object, mesh, sources, loop_vertex, loop_edge, after):
    is_seam = np.zeros(len(mesh.edges), bool)
    if "SEAM" in sources:
        is_seam |= _get(mesh.edges, "use_seam", 1, bool)
    if "SHARP" in sources:
        is_seam |= _get(mesh.edges, "use_edge_sharp", 1, bool)
    if "MATERIAL" in sources:
        material = _get(mesh.polygons, "material_index", 1, np.int32)
        of_loop = np.repeat(material, _get(mesh.polygons, "loop_total", 1, np.int32))
        is_seam |= _differs(of_loop[:, None], loop_edge, len(is_seam), 0)
    if "UV" in sources:
        if mesh.uv_layers.active is None:
            raise Unusable(f"{object.name} has no UV map whose islands could be seams")
        uv = _get(mesh.uv_layers.active.data, "uv", 2, np.float32)
        is_forward = (loop_vertex < loop_vertex[after])[:, None]
        ends = np.where(is_forward, np.hstack([uv, uv[after]]), np.hstack([uv[after], uv]))
        is_seam |= _differs(ends, loop_edge, len(is_seam), _UV_GAP)
    return is_seam


def _differs(value, loop_edge, edges, gap):
    """The edges at which values of loops, (L, N), differ by more than `gap`."""
    order = np.argsort(loop_edge, kind="stable")
    sorted_edge = loop_edge[order]
    starts = np.flatnonzero(np.r_[True, sorted_edge[1:] != sorted_edge[:-1]])
    value = value[order]
    spread = np.maximum.reduceat(value, starts) - np.minimum.reduceat(value, starts)
    result = np.zeros(edges, bool)
    result[sorted_edge[starts]] = (spread > gap).any(axis=1)
    return result


# Jobs -------------------------------------------------------------------------------------------------------------------


class Sheet:
    """The parts that share an atlas, sent as one mesh."""

    def __init__(self, parts):
        self.parts = parts
        self.transfer = None  # transfer.Transfer, if its textures are to be moved
        self._first_vertex = np.cumsum([0] + [len(part.positions) for part in parts])
        self._first_face = np.cumsum([0] + [len(part.triangles) for part in parts])
        self.positions = np.concatenate([part.positions for part in parts])
        self.triangles = np.concatenate([part.triangles + first for part, first in zip(parts, self._first_vertex)])
        self.seam_corners = self._corners([part.seam_corners for part in parts])
        first_polygon = np.cumsum([0] + [len(part.loop_total) for part in parts])
        self.polygon = np.concatenate([part.polygon + first for part, first in zip(parts, first_polygon)])
        first_loop = np.cumsum([0] + [part.loop_count for part in parts])
        self.loops = np.concatenate([part.loops + first for part, first in zip(parts, first_loop)])
        self.loop_vertex = np.concatenate([part.loop_vertex + first for part, first in zip(parts, self._first_vertex)])
        self.loop_total = np.concatenate([part.loop_total for part in parts])

    def _corners(self, lists):
        return np.concatenate([3 * first + corners for corners, first in zip(lists, self._first_face)])

    @property
    def name(self):
        names = [part.object.name for part in self.parts]
        return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"

    def ranges(self):
        """Each part with its triangles: first, and end."""
        return zip(self.parts, self._first_face, self._first_face[1:])

    def write(self, uv, new_map=None, with_new_map=()):
        """Puts UV, (F, 3, 2), into the active layers, or into new ones called `new_map` in the parts `with_new_map`. Skips
        objects that were changed meanwhile and returns their names; with them the number of polygons whose corners would
        need several UV each."""
        changed, torn = [], 0
        for part, begin, end in self.ranges():
            of_loop = np.zeros((part.loop_count, 2), np.float32)
            of_loop[part.loops] = uv[begin:end]
            differs = (of_loop[part.loops] != uv[begin:end]).any(axis=(1, 2))
            torn += len(np.unique(part.polygon[differs]))
            if not _write(part, of_loop, new_map if part in with_new_map else None):
                changed.append(part.object.name)
        return changed, torn

    # Elements, as the server counts them

    def polygon_of(self, face):
        p = int(np.searchsorted(self._first_face, face, side="right")) - 1
        return p, int(self.parts[p].polygon[face - self._first_face[p]])

    def vertex_of(self, vertex):
        p = int(np.searchsorted(self._first_vertex, vertex, side="right")) - 1
        return p, int(vertex - self._first_vertex[p])

    def places(self, faces, edges, vertices):
        """Lists the first few of these elements, numbered as in Blender; may be empty."""

        def number(p, *elements):
            own = "-".join(map(str, elements))
            return own if len(self.parts) == 1 else f"{own} of {self.parts[p].object.name}"

        ends = [(self.vertex_of(a), self.vertex_of(b)[1]) for a, b in edges]
        kinds = {
            "face": [number(*self.polygon_of(face)) for face in faces],
            "edge": [number(p, a, b) for (p, a), b in ends],
            "vertex": [number(*self.vertex_of(vertex)) for vertex in vertices],
        }
        words = [f"{kind} {own}" for kind, numbers in kinds.items() for own in dict.fromkeys(numbers)]
        return ", ".join(words[:_MOST_NAMED]) + (", ..." if len(words) > _MOST_NAMED else "")

    def select(self, faces, edges, vertices):
        """Selects only these elements in the objects of this sheet. Returns whether there were any."""
        found = [([], [], []) for _ in self.parts]
        for face in faces:
            p, polygon = self.polygon_of(face)
            found[p][0].append(polygon)
        for a, b in edges:
            p, first = self.vertex_of(a)
            found[p][1].append((first, self.vertex_of(b)[1]))
        for vertex in vertices:
            p, own = self.vertex_of(vertex)
            found[p][2].append(own)
        for part, elements in zip(self.parts, found):
            _select(part.object, *elements)
        return bool(faces or edges or vertices)


def _write(part, of_loop, new_map):
    mesh = part.object.data
    if part.object.mode == "EDIT":
        edited = bmesh.from_edit_mesh(mesh)
        if sum(len(face.loops) for face in edited.faces) != part.loop_count:
            return False
        layer = edited.loops.layers.uv.verify()
        values = iter(of_loop.tolist())
        for face in edited.faces:
            for loop in face.loops:
                loop[layer].uv = next(values)
        bmesh.update_edit_mesh(mesh, loop_triangles=False, destructive=False)
        return True
    if len(mesh.loops) != part.loop_count:
        return False
    if new_map is not None:
        mesh.uv_layers.active = mesh.uv_layers.new(name=new_map, do_init=False)
    layer = mesh.uv_layers.active or mesh.uv_layers.new(do_init=False)
    layer.data.foreach_set("uv", of_loop.reshape(-1))
    mesh.update()
    return True


def _select(object, polygons, edges, vertices):
    mesh = object.data
    is_face = np.zeros(len(mesh.polygons), bool)
    is_face[polygons] = True
    ends = _get(mesh.edges, "vertices", 2, np.int32)
    wanted = {tuple(sorted(edge)) for edge in edges}
    is_edge = np.array([tuple(sorted(pair)) in wanted for pair in ends.tolist()], bool) if wanted else np.zeros(len(ends), bool)
    loop_face = np.repeat(is_face, _get(mesh.polygons, "loop_total", 1, np.int32))
    is_edge[_get(mesh.loops, "edge_index", 1, np.int32)[loop_face]] = True
    is_vertex = np.zeros(len(mesh.vertices), bool)
    is_vertex[ends[is_edge].reshape(-1)] = True
    is_vertex[vertices] = True
    if object.mode != "EDIT":
        for collection, selected in ((mesh.vertices, is_vertex), (mesh.edges, is_edge), (mesh.polygons, is_face)):
            collection.foreach_set("select", selected)
        return
    edited = bmesh.from_edit_mesh(mesh)
    for sequence, selected in ((edited.verts, is_vertex), (edited.edges, is_edge), (edited.faces, is_face)):
        for element, flag in zip(sequence, selected.tolist()):
            element.select = flag
    bmesh.update_edit_mesh(mesh, loop_triangles=False, destructive=False)
