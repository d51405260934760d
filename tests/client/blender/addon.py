"""The add-on, installed from its zip, and meshes for its tests. Imported in Blender: run.sh."""

import os
import sys
import unittest

import bpy
import numpy as np

for folder in ("tests/client/python", "tests/testing"):
    sys.path.insert(0, os.path.join(os.environ["PLANISH_SOURCE_TREE"], folder))
import support  # noqa: E402

bpy.ops.preferences.addon_install(filepath=os.environ["PLANISH_ADDON"])
bpy.ops.preferences.addon_enable(module="planish_blender")

from planish_blender import engines  # noqa: E402  (it is there from here on)

PREFERENCES = bpy.context.preferences.addons["planish_blender"].preferences


def get(collection, name, columns, kind=np.float32):
    values = np.empty(len(collection) * columns, kind)
    collection.foreach_get(name, values)
    return values.reshape(-1, columns) if columns > 1 else values


def uv_of(mesh, layer=None):
    return get((layer or mesh.uv_layers.active).data, "uv", 2)


def loop_triangles(mesh):
    mesh.calc_loop_triangles()
    return get(mesh.loop_triangles, "loops", 3, np.int32)


def corner_uv(mesh):
    return uv_of(mesh)[loop_triangles(mesh)]


def uv_borders(mesh):
    """The edges, as pairs of vertices, between two polygons with different UV at an end."""
    uv, sides = uv_of(mesh), {}
    for polygon in mesh.polygons:
        loops = list(polygon.loop_indices)
        for a, b in zip(loops, loops[1:] + loops[:1]):
            ends = {mesh.loops[a].vertex_index: tuple(uv[a]), mesh.loops[b].vertex_index: tuple(uv[b])}
            sides.setdefault(tuple(sorted(ends)), []).append(ends)
    return {edge for edge, found in sides.items() if any(ends != found[0] for ends in found)}


def edges_where(mesh, name):
    return {tuple(sorted(edge.vertices)) for edge in mesh.edges if getattr(edge, name)}


def islands(mesh):
    """How many parts the UV borders leave of the polygons."""
    borders, label = uv_borders(mesh), list(range(len(mesh.polygons)))

    def root(f):
        while label[f] != f:
            f = label[f]
        return f

    first = {}
    for polygon in mesh.polygons:
        for key in polygon.edge_keys:
            if key not in borders:
                label[root(polygon.index)] = root(first.setdefault(key, polygon.index))
    return len({root(f) for f in range(len(label))})


def unwrap(**arguments):
    return bpy.ops.uv.planish_unwrap(**arguments)


class Case(unittest.TestCase):
    def setUp(self):
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for each in list(bpy.data.objects):
            bpy.data.objects.remove(each)
        PREFERENCES.where, PREFERENCES.address = "PRIVATE", ""
        PREFERENCES.tls_ca_file = PREFERENCES.token_file = PREFERENCES.token = ""
        PREFERENCES.planishd, PREFERENCES.command = support.PLANISHD, support.PLANISH
        PREFERENCES.engine = "AUTO"

    def select(self, *objects):
        for each in bpy.data.objects:
            each.select_set(each in objects)
        bpy.context.view_layer.objects.active = objects[0]


def main():
    outcome = unittest.main(argv=sys.argv[sys.argv.index("--") + 1 :], exit=False, verbosity=1).result
    engines.close()
    sys.exit(0 if outcome.wasSuccessful() and outcome.testsRun > 0 else 1)
