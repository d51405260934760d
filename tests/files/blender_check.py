"""Reads mesh files with Blender and compares them with what they should hold.

blender --background --factory-startup --python blender_check.py -- EXPECTED.json

EXPECTED.json: a list of {"file": path, "faces": [[[x, y, z, u, v], ...], ...], "like": path of a file that must import
to the same objects, materials, skins and so on, or ""}. Faces in any order, corners of a face from any corner on.
Prints "BLENDER_CHECK ok" or what differs.
"""
import json
import sys

import bpy

try:
    import numpy

    numpy.bool = bool  # the importer of Blender 3.4 wants it, numpy 1.24 has it no longer
except ModuleNotFoundError:
    print("BLENDER_CHECK no numpy")
    sys.exit(0)

TOLERANCE = 2e-6


def load(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith((".glb", ".gltf")):
        bpy.ops.import_scene.gltf(filepath=path)
        return lambda p: (p[0], p[2], -p[1])  # Blender's z is up
    if path.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z")
    elif path.endswith(".ply"):
        bpy.ops.import_mesh.ply(filepath=path)
    return tuple


def faces_of(meshes, turn):
    faces = []
    for mesh in meshes:
        layer = mesh.uv_layers[0].data
        for polygon in mesh.polygons:
            face = []
            for loop in polygon.loop_indices:
                vertex = mesh.vertices[mesh.loops[loop].vertex_index]
                face.append(tuple(turn(vertex.co)) + tuple(layer[loop].uv))
            faces.append(face)
    return faces


def same_face(a, b):
    return any(
        all(abs(x - y) < TOLERANCE * max(1, abs(x)) for p, q in zip(a, b[k:] + b[:k]) for x, y in zip(p, q))
        for k in range(len(b))
    )


def compare_faces(found, expected):
    if len(found) != len(expected):
        return f"{len(found)} faces, expected {len(expected)}"
    key = lambda face: tuple(sorted(tuple(round(x, 4) for x in corner) for corner in face))
    for a, b in zip(sorted(found, key=key), sorted(expected, key=key)):
        if not same_face(a, [tuple(c) for c in b]):
            return f"a face is {a}, expected {b}"
    return ""


def summary():
    """What a file holds apart from vertices and UV."""
    return {
        "objects": sorted((o.name, o.type, len(o.vertex_groups)) for o in bpy.data.objects),
        "meshes": sorted(
            (
                m.name,
                len(m.polygons),
                len(m.edges) - len([e for e in m.edges if not e.is_loose]),
                [s.name if s else "" for s in m.materials],
                sorted(a.name for a in m.color_attributes),
                [k.name for k in m.shape_keys.key_blocks] if m.shape_keys else [],
            )
            for m in bpy.data.meshes
        ),
        "material of faces": sorted((m.name, [p.material_index for p in m.polygons]) for m in bpy.data.meshes),
        "normals": sorted((m.name, corner_normals(m)) for m in bpy.data.meshes),
        "weights": sorted((o.name, corner_weights(o)) for o in bpy.data.objects if o.type == "MESH"),
        "shapes": sorted((m.name, corner_shapes(m)) for m in bpy.data.meshes),
        "bones": sorted(b.name for a in bpy.data.armatures for b in a.bones),
        "actions": sorted((a.name, len(a.fcurves)) for a in bpy.data.actions),
        "images": sorted(tuple(i.size) for i in bpy.data.images),
    }


def corner_normals(mesh):
    if not mesh.has_custom_normals:
        return []
    mesh.calc_normals_split()
    return [tuple(round(x, 3) for x in loop.normal) for loop in mesh.loops]


def corner_weights(thing):
    result = []
    for loop in thing.data.loops:
        groups = thing.data.vertices[loop.vertex_index].groups
        result.append(sorted((thing.vertex_groups[g.group].name, round(g.weight, 5)) for g in groups))
    return result


def corner_shapes(mesh):
    if not mesh.shape_keys:
        return []
    blocks = mesh.shape_keys.key_blocks
    return [[tuple(round(x, 5) for x in b.data[l.vertex_index].co) for b in blocks] for l in mesh.loops]


def check(entry):
    turn = load(entry["file"])
    problem = compare_faces(faces_of(bpy.data.meshes, turn), entry["faces"])
    if problem or not entry["like"]:
        return problem
    found = summary()
    load(entry["like"])
    expected = summary()
    for key, value in expected.items():
        if found[key] != value:
            return f"{key}: {found[key]}, expected {value}"
    return ""


def main():
    with open(sys.argv[sys.argv.index("--") + 1], encoding="utf-8") as file:
        entries = json.load(file)
    for entry in entries:
        problem = check(entry)
        if problem:
            print("BLENDER_CHECK", entry["file"], problem)
            return
    print("BLENDER_CHECK ok")


main()
