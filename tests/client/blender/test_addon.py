"""The add-on, installed from its zip, on meshes of Blender. Runs in Blender: run.sh."""

import contextlib
import ctypes
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import bpy
import numpy as np

# Blender does not look at PYTHONPATH.
for folder in ("tests/client/python", "tests/testing"):
    sys.path.insert(0, os.path.join(os.environ["PLANISH_SOURCE_TREE"], folder))
import support  # noqa: E402

bpy.ops.preferences.addon_install(filepath=os.environ["PLANISH_ADDON"])
bpy.ops.preferences.addon_enable(module="planish_blender")

from planish_blender import engines, meshes, operator  # noqa: E402  (they are there from here on)

PREFERENCES = bpy.context.preferences.addons["planish_blender"].preferences
ENGINES = ("PACKAGE", "COMMAND")


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


class AddOn(unittest.TestCase):
    def setUp(self):
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for each in list(bpy.data.objects):
            bpy.data.objects.remove(each)
        PREFERENCES.where, PREFERENCES.address = "PRIVATE", ""
        PREFERENCES.tls_ca_file = PREFERENCES.token_file = PREFERENCES.token = ""
        PREFERENCES.planishd, PREFERENCES.command = support.PLANISHD, support.PLANISH
        PREFERENCES.engine = "AUTO"

    def monkey(self):
        bpy.ops.mesh.primitive_monkey_add()
        return bpy.context.object

    def test_the_lines_that_the_page_begins_with(self):
        page = (support.SOURCE_TREE / "client/blender/README.md").read_text()
        exec(re.match(r"# [^\n]*\n\n```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)[1], {})
        self.assertGreater(len(np.unique(uv_of(bpy.context.object.data), axis=0)), 100)

    def cube(self, **arguments):
        bpy.ops.mesh.primitive_cube_add(**arguments)
        return bpy.context.object

    def mesh(self, positions, polygons):
        mesh = bpy.data.meshes.new("mesh")
        mesh.from_pydata(positions, [], polygons)
        made = bpy.data.objects.new("made", mesh)
        bpy.context.collection.objects.link(made)
        self.select(made)
        return made

    def select(self, *objects):
        for each in bpy.data.objects:
            each.select_set(each in objects)
        bpy.context.view_layer.objects.active = objects[0]

    def assert_proper(self, mesh):
        """No triangle is flipped or degenerate, and all lie in the texture."""
        areas = support.uv_areas(corner_uv(mesh).astype(float))
        self.assertGreater(areas.min(), 0)
        self.assertTrue(0 <= uv_of(mesh).min() and uv_of(mesh).max() <= 1)

    # What comes out

    def test_marked_seams_are_kept_exactly(self):
        mesh = self.monkey().data
        unwrap()
        charts = islands(mesh)
        marked = uv_borders(mesh)
        self.assertGreater(len(marked), 50)
        for edge in mesh.edges:
            edge.use_seam = tuple(sorted(edge.vertices)) in marked
        mesh.uv_layers.active.data.foreach_set("uv", np.zeros(2 * len(mesh.loops), np.float32))
        unwrap(cuts="KEEP")
        self.assertEqual(uv_borders(mesh), marked)
        self.assertEqual(islands(mesh), charts)
        self.assertEqual(edges_where(mesh, "use_seam"), marked)
        self.assert_proper(mesh)

    def test_uv_are_those_of_the_command_for_the_same_polygons(self):
        mesh = self.monkey().data
        mesh.edges[100].use_seam = True
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory)
            lines = ["v %.9g %.9g %.9g" % tuple(vertex.co) for vertex in mesh.vertices]
            lines += ["f " + " ".join(str(v + 1) for v in polygon.vertices) for polygon in mesh.polygons]
            (path / "in.obj").write_text("\n".join(lines) + "\n")
            (path / "seams").write_text("".join(f"{a + 1} {b + 1}\n" for a, b in edges_where(mesh, "use_seam")))
            command = [support.PLANISH, "unwrap", path / "in.obj", "-o", path / "out.obj", "--precision=float"]
            command += [f"--seams=auto,edges:{path}/seams"]
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL, env={**os.environ, "PLANISHD": support.PLANISHD})
            written = (path / "out.obj").read_text().splitlines()
        uv = np.array([line.split()[1:3] for line in written if line.startswith("vt ")], np.float64).astype(np.float32)
        corners = [corner for line in written if line.startswith("f ") for corner in line.split()[1:]]
        PREFERENCES.engine = "COMMAND"
        unwrap()
        np.testing.assert_array_equal(uv_of(mesh).reshape(-1, 2), uv[[int(corner.split("/")[1]) - 1 for corner in corners]])

    def test_uv_are_those_of_the_command_for_the_same_triangles(self):
        mesh = self.monkey().data
        mesh.edges[100].use_seam = True
        positions = get(mesh.vertices, "co", 3)
        faces = get(mesh.loops, "vertex_index", 1, np.int32)[loop_triangles(mesh)]
        polygon_edges = {tuple(sorted(edge.vertices)) for edge in mesh.edges}
        triangle_edges = {tuple(sorted((int(f[k]), int(f[k - 1])))) for f in faces for k in range(3)}
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory)
            support.write_obj(path / "in.obj", positions, faces)
            for name, edges in (("seams", edges_where(mesh, "use_seam")), ("uncut", triangle_edges - polygon_edges)):
                (path / name).write_text("".join(f"{a + 1} {b + 1}\n" for a, b in edges))
            seams = f"--seams=auto,edges:{path}/seams,uncut:{path}/uncut"
            command = [support.PLANISH, "unwrap", path / "in.obj", "-o", path / "out.obj", seams, "--precision=float"]
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL, env={**os.environ, "PLANISHD": support.PLANISHD})
            _, _, expected = support.read_obj(path / "out.obj")
        PREFERENCES.engine = "PACKAGE"  # sends Blender's triangles; the command cuts polygons up itself
        unwrap()
        np.testing.assert_array_equal(corner_uv(mesh), expected.astype(np.float32))

    def test_what_else_a_mesh_has_stays(self):
        bpy.ops.mesh.primitive_cylinder_add(vertices=13)  # with polygons of 13 corners
        cylinder = bpy.context.object
        mesh = cylinder.data
        for name in ("red", "blue"):
            mesh.materials.append(bpy.data.materials.new(name))
        mesh.polygons[3].material_index = 1
        other = mesh.uv_layers.active.name
        mesh.uv_layers.active = mesh.uv_layers.new(name="second")
        mesh.edges[0].use_edge_sharp = mesh.edges[1].use_seam = True

        def state():
            return (
                uv_of(mesh, mesh.uv_layers[other]).tobytes(),
                [layer.name for layer in mesh.uv_layers],
                [tuple(polygon.vertices) for polygon in mesh.polygons],
                [polygon.material_index for polygon in mesh.polygons],
                [(edge.use_seam, edge.use_edge_sharp) for edge in mesh.edges],
                [tuple(vertex.co) for vertex in mesh.vertices],
                [material.name for material in mesh.materials],
            )

        before = state()
        unwrap(seams={"SHARP", "MATERIAL", "SEAM"})
        self.assertEqual(state(), before)
        self.assertEqual(mesh.uv_layers.active.name, "second")
        self.assert_proper(mesh)
        self.assertLessEqual(edges_where(mesh, "use_seam") | edges_where(mesh, "use_edge_sharp"), uv_borders(mesh))

    def test_concave_polygons_and_loose_parts(self):
        outline = [(0, 0, 0), (4, 0, 0), (4, 3, 0), (3, 3, 0), (3, 1, 0), (1, 1, 0), (1, 3, 0), (0, 3, 0)]
        made = self.mesh([(9, 9, 9), *outline, (2, -1, 1)], [list(range(1, 9)), [2, 1, 9]])
        self.assertIsNone(made.data.uv_layers.active)
        unwrap()
        self.assert_proper(made.data)
        self.assertEqual(len(made.data.polygons), 2)

    def test_sources_of_seams(self):
        cube = self.cube()
        mesh = cube.data
        all_edges = {tuple(sorted(edge.vertices)) for edge in mesh.edges}
        cross = uv_borders(mesh)  # as Blender makes it
        self.assertEqual(len(cross), 7)
        unwrap(seams={"UV"}, cuts="KEEP")
        self.assertEqual(uv_borders(mesh), cross)
        for index, polygon in enumerate(mesh.polygons):
            mesh.materials.append(None)
            polygon.material_index = index
        unwrap(seams={"MATERIAL"}, cuts="KEEP")
        self.assertEqual(uv_borders(mesh), all_edges)
        unwrap(seams={"UV"}, cuts="NEEDED")
        self.assertEqual(islands(mesh), 6)
        for edge in mesh.edges:
            edge.use_edge_sharp = tuple(sorted(edge.vertices)) in cross
        unwrap(seams={"SHARP"}, cuts="KEEP")
        self.assertEqual(uv_borders(mesh), cross)
        self.assert_proper(mesh)

    def test_one_atlas_for_all_or_one_each(self):
        small = self.cube()
        large = self.cube(location=(5, 0, 0))
        large.scale = (2, 2, -2)  # mirrored
        bpy.context.view_layer.update()
        linked = bpy.data.objects.new("linked", small.data)
        bpy.context.collection.objects.link(linked)
        self.select(small, large, linked)
        for PREFERENCES.engine in ENGINES:
            unwrap(one_atlas=True)
            areas = [support.uv_areas(corner_uv(each.data).astype(float)).sum() for each in (small, large)]
            self.assertAlmostEqual(areas[1] / areas[0], 4, delta=0.05)
            self.assertLess(sum(areas), 1)
            unwrap(one_atlas=False)
            areas = [support.uv_areas(corner_uv(each.data).astype(float)).sum() for each in (small, large)]
            self.assertAlmostEqual(areas[1] / areas[0], 1, delta=0.01)
        for each in (small, large):
            self.assert_proper(each.data)

    def test_texels_per_unit(self):
        mesh = self.cube(size=2).data
        for PREFERENCES.engine in ENGINES:
            unwrap(texels_per_unit=100, finds_texture_size=False, texture_size=1024)
            self.assertAlmostEqual(1024 * np.sqrt(support.uv_areas(corner_uv(mesh).astype(float)).sum() / 24), 100, 3)
            unwrap(texels_per_unit=100, texture_size=64)  # in 1024 texels: six squares of 200 do not fit into 512
            self.assertAlmostEqual(1024 * np.sqrt(support.uv_areas(corner_uv(mesh).astype(float)).sum() / 24), 100, 3)
            with self.assertRaisesRegex(RuntimeError, "of the 1000 asked for"):
                unwrap(texels_per_unit=1000, finds_texture_size=False, texture_size=1024)

    def test_edit_mode(self):
        monkey = self.monkey()
        unwrap()
        expected, borders, meshes_before = uv_of(monkey.data), uv_borders(monkey.data), len(bpy.data.meshes)
        monkey.data.uv_layers.remove(monkey.data.uv_layers.active)
        bpy.ops.object.mode_set(mode="EDIT")
        unwrap()
        self.assertEqual(bpy.context.mode, "EDIT_MESH")
        bpy.ops.object.mode_set(mode="OBJECT")
        np.testing.assert_array_equal(uv_of(monkey.data), expected)
        bpy.ops.object.mode_set(mode="EDIT")
        unwrap(seams={"UV"}, cuts="KEEP", padding=9)  # the UV of a mesh that is edited can be read as well
        bpy.ops.object.mode_set(mode="OBJECT")
        self.assertEqual(uv_borders(monkey.data), borders)
        self.assertEqual(len(bpy.data.meshes), meshes_before)

    # What goes wrong

    def test_faulty_elements_are_selected(self):
        for PREFERENCES.engine in ENGINES:
            cube = self.cube()
            before = uv_of(cube.data)
            with self.assertRaisesRegex(RuntimeError, r"Cube.*: 1 piece .* at face (\d+).*\(selected\)") as raised:
                unwrap(cuts="KEEP")
            (selected,) = [polygon.index for polygon in cube.data.polygons if polygon.select]
            self.assertRegex(str(raised.exception), f"at face {selected}\\b")
            np.testing.assert_array_equal(uv_of(cube.data), before)

            cube.data.vertices[5].co.x = float("nan")
            with self.assertRaisesRegex(RuntimeError, r"Cube.*: 1 vertex has .*at vertex 5 \(selected\)"):
                unwrap()
            self.assertEqual([vertex.index for vertex in cube.data.vertices if vertex.select], [5])

    def test_one_that_fails_hurts_no_other(self):
        good, bad = self.cube(), self.cube()
        for edge in good.data.edges:
            edge.use_seam = True
        self.select(bad, good)
        with self.assertRaisesRegex(RuntimeError, bad.name):
            unwrap(cuts="KEEP", one_atlas=False)
        self.assertEqual(islands(good.data), 6)

    def test_objects_that_cannot_be_unwrapped(self):
        self.mesh([(0, 0, 0), (1, 0, 0)], [])
        with self.assertRaisesRegex(RuntimeError, "made has no faces"):
            unwrap()
        self.mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [[0, 1, 2]])
        with self.assertRaisesRegex(RuntimeError, "has no UV map"):
            unwrap(seams={"UV"})
        self.select(self.mesh([], []))
        bpy.ops.object.select_all(action="DESELECT")
        self.assertFalse(operator.UV_OT_planish_unwrap.poll(bpy.context))

    def test_servers(self):
        self.cube()
        server = support.Server()
        self.addCleanup(server.close)
        PREFERENCES.where = "SERVER"
        for PREFERENCES.engine in ENGINES:
            PREFERENCES.address = server.target
            self.assertEqual(unwrap(), {"FINISHED"})
            PREFERENCES.address = "unix:/nowhere/at/all"
            with self.assertRaisesRegex(RuntimeError, "/nowhere/at/all"):
                unwrap()
            PREFERENCES.address = ""
            with self.assertRaisesRegex(RuntimeError, "name none"):
                unwrap()
        PREFERENCES.where, PREFERENCES.command = "PRIVATE", "/nowhere/planish"
        with self.assertRaisesRegex(RuntimeError, "/nowhere/planish is not a program"):
            unwrap()
        PREFERENCES.engine, PREFERENCES.planishd = "PACKAGE", "/nowhere/planishd"
        with self.assertRaisesRegex(RuntimeError, "/nowhere/planishd is not a program"):
            unwrap()

    def test_tls_and_token(self):
        self.cube()
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        server, path = support.secure_server(directory.name)
        self.addCleanup(server.close)
        PREFERENCES.where, PREFERENCES.address, PREFERENCES.tls_ca_file = "SERVER", server.target, path("ca.pem")
        for PREFERENCES.engine in ENGINES:
            PREFERENCES.token_file = path("token")
            self.assertEqual(unwrap(), {"FINISHED"})
            PREFERENCES.token_file, PREFERENCES.token = "", pathlib.Path(path("token")).read_text().strip()
            self.assertEqual(unwrap(), {"FINISHED"})
            PREFERENCES.token = "wrong"
            with self.assertRaisesRegex(RuntimeError, "does not know these credentials"):
                unwrap()

    def test_without_grpcio_the_command_is_used(self):
        self.cube()
        hidden = {name: sys.modules.pop(name) for name in list(sys.modules) if name.partition(".")[0] in ("planish", "grpc")}
        sys.modules["grpc"] = None  # its import fails from here on
        self.addCleanup(sys.modules.update, hidden)
        with self.assertRaises(engines._NoPackage):
            engines._package()
        self.assertEqual(unwrap(), {"FINISHED"})
        PREFERENCES.engine = "PACKAGE"
        with self.assertRaisesRegex(RuntimeError, "grpcio and protobuf must be installed"):
            unwrap()

    def test_cancelling(self):
        positions, triangles = support.ball(60)
        made = self.mesh(positions.tolist(), triangles.tolist())
        sheets = [meshes.Sheet([meshes.read(made, {"SEAM"})]) for _ in range(6)]
        for PREFERENCES.engine in ENGINES:
            start = engines.engine(engines.Settings("PRIVATE", engine=PREFERENCES.engine, planishd=support.PLANISHD, command=support.PLANISH))
            batch = engines.Batch(start, sheets, engines.Options(max_stretch=1.001))
            self.assertFalse(batch.step())
            self.assertRegex(str(batch), "^0 of 6 done; ")
            batch.cancel()
            while not batch.step():
                batch.wait(0.1)
            self.assertEqual({outcome.reason for _, outcome in batch.outcomes}, {"CANCELLED"})
            self.assertEqual(len(batch.outcomes), engines.MOST_AT_A_TIME)
        engines.close()
        self.assertEqual([name for name in os.listdir(os.environ["TMPDIR"]) if name.startswith("planish-")], [])


@contextlib.contextmanager
def printed():
    """Collects what Blender prints meanwhile: an operator's reports, among others."""
    lines, kept = [], os.dup(1)
    flush = ctypes.CDLL(None).fflush
    with tempfile.TemporaryFile("w+") as file:
        flush(None)
        os.dup2(file.fileno(), 1)
        try:
            yield lines
        finally:
            flush(None)
            os.dup2(kept, 1)
            os.close(kept)
            file.seek(0)
            lines += file.read().splitlines()


def waves(n, channels=3):
    """Smooth texels, (n, n, 4) float32 from the lower left, that tile."""
    x = np.arange(n) * 2 * np.pi / n
    bands = [np.sin((k + 1) * x[None, :] + k) * np.cos((k + 2) * x[:, None]) for k in range(3)]
    texels = np.ones((n, n, 4), np.float32)
    texels[..., :channels] = np.stack(bands, axis=-1)[..., :channels] * 0.4 + 0.5
    return np.rint(texels * 255) / np.float32(255)


def image(name, texels, space="sRGB"):
    """Packed, as PNG."""
    made = bpy.data.images.new(name, texels.shape[1], texels.shape[0], alpha=False)
    made.colorspace_settings.name = space
    made.pixels.foreach_set(texels.astype(np.float32).reshape(-1))
    made.pack()
    return made


def bumps(n):
    """A normal map of shallow bumps."""
    height = waves(n)[..., :2] - 0.5
    normal = np.concatenate([height * 0.8, np.ones((n, n, 1), np.float32)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.concatenate([normal * 0.5 + 0.5, np.ones((n, n, 1), np.float32)], axis=-1)


def sampled(image, uv):
    """Texels, (N, 4), at UV, (N, 2): linear, repeated."""
    width, height = image.size
    texels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(texels)
    texels = texels.reshape(height, width, 4)
    place = uv.astype(np.float64) * (width, height) - 0.5
    low = np.floor(place).astype(int)
    fx, fy = (place - low).T[..., None]
    at = lambda dx, dy: texels[(low[:, 1] + dy) % height, (low[:, 0] + dx) % width]
    return (at(0, 0) * (1 - fx) + at(1, 0) * fx) * (1 - fy) + (at(0, 1) * (1 - fx) + at(1, 1) * fx) * fy


def map_of(mesh, node):
    """The UV map that an image node reads."""
    links = node.inputs["Vector"].links
    named = links[0].from_node.uv_map if links else ""
    return mesh.uv_layers[named] if named else next(layer for layer in mesh.uv_layers if layer.active_render)


class Textures(unittest.TestCase):
    select = AddOn.select

    def setUp(self):
        AddOn.setUp(self)
        for each in (*bpy.data.meshes, *bpy.data.materials, *bpy.data.images, *bpy.data.node_groups):
            bpy.data.batch_remove([each])

    def ball(self, **arguments):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, **arguments)
        bpy.ops.object.shade_smooth()
        return bpy.context.object

    def material(self, *objects, name="paint"):
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        for each in objects:
            each.data.materials.append(material)
        return material

    def node(self, tree, image, to=None, **settings):
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        for key, value in settings.items():
            setattr(node, key, value)
        if to is not None:
            tree.links.new(node.outputs["Color"], to)
        return node

    def shader(self, material):
        return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")

    def normal_map(self, material, image):
        """The image node, and the node that reads it."""
        tree = material.node_tree
        node = tree.nodes.new("ShaderNodeNormalMap")
        tree.links.new(node.outputs["Normal"], self.shader(material).inputs["Normal"])
        return self.node(tree, image, node.inputs["Color"]), node

    def points(self, mesh, node, count=20000):
        """What an image node shows at random points of the surface, the same ones each time."""
        random = np.random.default_rng(7)
        corners = get(mesh.vertices, "co", 3)[get(mesh.loops, "vertex_index", 1, np.int32)[loop_triangles(mesh)]]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        face = random.choice(len(area), count, p=area / area.sum())
        weight = random.dirichlet((1, 1, 1), count)
        uv = uv_of(mesh, map_of(mesh, node))[loop_triangles(mesh)][face]
        return sampled(node.image, (uv * weight[..., None]).sum(axis=1))

    def assert_close(self, before, after, channels=3):
        difference = 255 * np.abs(before - after)[:, :channels]
        self.assertLess(difference.mean(), 2)
        self.assertLess(np.percentile(difference, 99), 12)

    def assert_same_picture(self, before, after):
        difference = np.abs(before - after)
        self.assertLess(difference.mean(), 0.25)
        self.assertLess(np.percentile(difference, 99), 5)
        self.assertGreater(before.std(), 20, "it shows something")

    def rendered(self, *objects):
        """By Cycles, with light from one side."""
        scene = bpy.context.scene
        scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 16, "CPU"
        scene.cycles.use_denoising, scene.cycles.max_bounces, scene.cycles.seed = False, 1, 3
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 96 * len(objects), 96, 100
        scene.view_settings.view_transform, scene.render.image_settings.color_mode = "Standard", "RGB"
        made = []
        for name, data in (("camera", bpy.data.cameras.new("camera")), ("sun", bpy.data.lights.new("sun", "SUN"))):
            made.append(bpy.data.objects.new(name, data))
            bpy.context.collection.objects.link(made[-1])
        camera, sun = made
        middle = np.mean([each.location for each in objects], axis=0)
        camera.data.type, camera.data.ortho_scale = "ORTHO", 2.4 * len(objects)
        camera.location, camera.rotation_euler = middle + (0, -9, 0), (np.pi / 2, 0, 0)
        sun.rotation_euler, sun.data.energy, sun.data.angle = (0.9, 0, 0.6), 3, 0
        scene.camera = camera
        with tempfile.TemporaryDirectory() as directory:
            scene.render.filepath = os.path.join(directory, "image.png")
            with printed():
                bpy.ops.render.render(write_still=True)
            picture = bpy.data.images.load(scene.render.filepath)
            texels = np.empty(len(picture.pixels), np.float32)
            picture.pixels.foreach_get(texels)
            bpy.data.images.remove(picture)
        for each in made:
            bpy.data.objects.remove(each)
        return 255 * texels.reshape(96, 96 * len(objects), 4)[..., :3]

    def test_images_are_drawn_for_the_new_map(self):
        ball = self.ball()
        mesh, material = ball.data, self.material(ball)
        tree, shader = material.node_tree, self.shader(material)
        color = self.node(tree, image("wood.png", waves(256)), shader.inputs["Base Color"])
        rough = self.node(tree, image("rough", waves(128, 1), "Non-Color"), shader.inputs["Roughness"])
        directions, normal_map = self.normal_map(material, image("bumps", bumps(256), "Non-Color"))
        nodes = (color, rough, directions)
        old_map, old_uv, old_images = mesh.uv_layers.active.name, uv_of(mesh), [node.image for node in nodes]
        before, look = [self.points(mesh, node) for node in nodes], self.rendered(ball)
        self.assertEqual(unwrap(), {"FINISHED"})
        new_map = mesh.uv_layers.active.name
        self.assertEqual(new_map, old_map + ".planish")
        self.assertTrue(mesh.uv_layers.active.active_render)
        np.testing.assert_array_equal(uv_of(mesh, mesh.uv_layers[old_map]), old_uv)
        self.assertLess(islands(mesh), 12)
        self.assertEqual([node.image.name for node in nodes], ["wood.planish", "rough.planish", "bumps.planish"])
        for node, old in zip(nodes, old_images):
            self.assertEqual(map_of(mesh, node).name, new_map)
            self.assertEqual(node.image.colorspace_settings.name, old.colorspace_settings.name)
            self.assertEqual(node.image.alpha_mode, old.alpha_mode)
            self.assertIsNotNone(node.image.packed_file)
            self.assertTrue(old.use_fake_user)
            np.testing.assert_array_equal(sampled(old, np.zeros((1, 2))), sampled(bpy.data.images[old.name], np.zeros((1, 2))))
        self.assert_close(before[0], self.points(mesh, color))
        self.assert_close(before[1], self.points(mesh, rough))
        self.assertEqual(normal_map.uv_map, new_map)
        self.assertGreater(255 * np.abs(before[2] - self.points(mesh, directions))[:, :2].mean(), 5, "in another frame")
        self.assert_same_picture(self.rendered(ball), look)
        self.assertEqual([each.name for each in bpy.data.materials if each.name.startswith(material.name)], [material.name])

    def test_what_cannot_be_moved_reads_the_old_map(self):
        ball = self.ball()
        mesh, material = ball.data, self.material(ball)
        tree, shader = material.node_tree, self.shader(material)
        links = tree.links

        def new(kind, where=tree, **settings):
            node = where.nodes.new(kind)
            for key, value in settings.items():
                setattr(node, key, value)
            return node

        def mixed(a, b):
            node = new("ShaderNodeMixRGB")
            node.inputs["Fac"].default_value = 0.5
            links.new(a, node.inputs["Color1"])
            links.new(b, node.inputs["Color2"])
            return node.outputs["Color"]

        coordinates = new("ShaderNodeTexCoord")
        # Moved: one that a mapping node repeats, and one in a group.
        mapping = new("ShaderNodeMapping")
        mapping.inputs["Scale"].default_value, mapping.inputs["Location"].default_value = (3, 2, 1), (0.3, 0.1, 0)
        mapping.inputs["Rotation"].default_value = (0, 0, 0.5)
        links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
        repeated = self.node(tree, image("repeated", waves(64)))
        links.new(mapping.outputs["Vector"], repeated.inputs["Vector"])
        group = bpy.data.node_groups.new("group", "ShaderNodeTree")
        group.outputs.new("NodeSocketColor", "Color")
        inner = self.node(group, image("inner", waves(128)))
        group.links.new(inner.outputs["Color"], group.nodes.new("NodeGroupOutput").inputs["Color"])
        grouped = new("ShaderNodeGroup", node_tree=group)
        # Kept: one that Blender generates, one at computed places, a pattern, and a normal map with something between.
        grid = bpy.data.images.new("grid", 64, 64)
        grid.generated_type = "COLOR_GRID"
        generated = self.node(tree, grid)
        bent = self.node(tree, image("bent", waves(64)))
        add = new("ShaderNodeVectorMath", operation="SINE")
        links.new(coordinates.outputs["UV"], add.inputs[0])
        links.new(add.outputs[0], bent.inputs["Vector"])
        checker = new("ShaderNodeTexChecker")
        links.new(coordinates.outputs["UV"], checker.inputs["Vector"])
        directions, normal_map = self.normal_map(material, image("bumps", bumps(128), "Non-Color"))
        gamma = new("ShaderNodeGamma")
        gamma.inputs["Gamma"].default_value = 1.3
        links.new(directions.outputs["Color"], gamma.inputs["Color"])
        links.new(gamma.outputs["Color"], normal_map.inputs["Color"])
        tiles = bpy.data.images.new("tiles", 64, 64, tiled=True)
        tiled = self.node(tree, tiles, shader.inputs["Roughness"])
        color = mixed(repeated.outputs["Color"], grouped.outputs["Color"])
        for node in (generated, bent, checker):
            color = mixed(color, node.outputs["Color"])
        links.new(color, shader.inputs["Base Color"])

        look = self.rendered(ball)
        with printed() as lines:
            unwrap()
        said = "\n".join(lines)
        self.assert_same_picture(look, self.rendered(ball))
        self.assertTrue(mesh.uv_layers.active.active_render)
        old, new_map = (layer.name for layer in mesh.uv_layers)
        self.assertRegex(said, "Info: Sphere: 3 images drawn for UV map UVMap.planish: .*repeated.planish")
        for name, why in (("grid", "is generated"), ("bent", "is read at places that other nodes compute"), ("tiles", "has tiles")):
            self.assertRegex(said, f"Warning: Sphere: paint: image {name} {why}; it reads UV map {old} as before")
        for node in (repeated, directions):
            self.assertEqual(map_of(mesh, node).name, new_map)
        for node in (generated, tiled):
            self.assertEqual(map_of(mesh, node).name, old)
        self.assertEqual(normal_map.uv_map, old)
        self.assertEqual(map_of(mesh, inner).name, new_map)

    def test_others_that_use_a_material_keep_it(self):
        ball, other = self.ball(), self.ball(location=(3, 0, 0))
        material = self.material(ball, other)
        color = self.node(material.node_tree, image("wood", waves(128)), self.shader(material).inputs["Base Color"])
        old = color.image
        own = self.material(ball, name="own")  # on every other polygon
        ball.data.polygons.foreach_set("material_index", np.arange(len(ball.data.polygons)) % 2)
        self.node(own.node_tree, image("metal", waves(64)), self.shader(own).inputs["Base Color"])
        look, other_uv = self.rendered(ball, other), uv_of(other.data)
        self.select(ball)
        with printed() as lines:
            unwrap()
        self.assertIn("Info: Sphere: material paint was copied as paint.001, since others use it too", "\n".join(lines))
        self.assertEqual([each.name for each in ball.data.materials], ["paint.001", "own"])
        self.assertEqual([each.name for each in other.data.materials], ["paint"])
        self.assertEqual((color.image, old.use_fake_user, len(other.data.uv_layers)), (old, False, 1))
        np.testing.assert_array_equal(uv_of(other.data), other_uv)
        self.assert_same_picture(look, self.rendered(ball, other))
        # Both in one atlas: one image for what they share.
        images = len(bpy.data.images)
        self.select(ball, other)
        ball.data.materials[0] = material
        ball.data.uv_layers.remove(ball.data.uv_layers[1])
        ball.data.materials[1] = material
        unwrap()
        self.assertEqual(len(bpy.data.images), images + 1)
        self.assertEqual([each.data.materials[0].name for each in (ball, other)], ["paint", "paint"])
        self.assert_same_picture(look[:, 96:], self.rendered(ball, other)[:, 96:])

    def test_undo_takes_textures_back(self):
        for mode in ("OBJECT", "EDIT"):
            ball = self.ball()
            material = self.material(ball)
            color = self.node(material.node_tree, image("wood", waves(64)), self.shader(material).inputs["Base Color"])
            name, old, node, look = ball.name, color.image.name, color.name, self.rendered(ball)
            bpy.ops.object.mode_set(mode=mode)
            bpy.ops.ed.undo_push(message="before")
            unwrap()
            bpy.ops.ed.undo_push(message="Unwrap with planish")  # calls of scripts push none
            self.assertEqual(bpy.context.mode, "OBJECT")
            self.assert_same_picture(look, self.rendered(bpy.data.objects[name]))
            bpy.ops.ed.undo()
            ball = bpy.data.objects[name]
            self.assertEqual(ball.mode, mode)
            bpy.ops.object.mode_set(mode="OBJECT")
            self.assertEqual(len(ball.data.uv_layers), 1)
            self.assertEqual(ball.data.materials[0].node_tree.nodes[node].image.name, old)
            self.assert_same_picture(look, self.rendered(ball))

    def test_textures_that_stay(self):
        ball = self.ball()
        mesh, material = ball.data, self.material(ball)
        color = self.node(material.node_tree, image("wood", waves(64)), self.shader(material).inputs["Base Color"])
        before, old = self.points(mesh, color), color.image
        unwrap(transfer_textures=False)
        self.assertEqual((len(mesh.uv_layers), color.image), (1, old))
        self.assertGreater(255 * np.abs(before - self.points(mesh, color)).mean(), 20)
        # An image that nobody can read: the look stays, and a map is added.
        with tempfile.TemporaryDirectory() as directory:
            path = os.path.join(directory, "cut.png")
            old.filepath_raw, old.file_format = path, "PNG"
            old.save()
            with open(path, "r+b") as file:
                file.truncate(200)
            color.image = bpy.data.images.load(path)
            with printed() as lines:
                unwrap()
        self.assertRegex("\n".join(lines), "Warning: Sphere: no texture was moved, and materials read the old UV map: .*0.png")
        self.assertEqual(map_of(mesh, color), mesh.uv_layers[0])
        self.assertEqual(len(mesh.uv_layers), 2)
        # No command, and no room.
        color.image = old
        mesh.uv_layers.active_index = 0
        PREFERENCES.engine, PREFERENCES.command = "PACKAGE", "/nowhere/planish"
        with self.assertRaisesRegex(RuntimeError, "moved by the command planish, and /nowhere/planish is not a program"):
            unwrap()
        while len(mesh.uv_layers) < 8:
            mesh.uv_layers.new(do_init=False)
        mesh.uv_layers.active_index = 0
        with self.assertRaisesRegex(RuntimeError, "Sphere has 8 UV maps"):
            unwrap()
        self.assertEqual([name for name in os.listdir(os.environ["TMPDIR"]) if name.startswith("planish-blender-")], [])


class Words(unittest.TestCase):
    def test_elements_are_numbered_as_in_blender(self):
        class Named:
            def __init__(self, name):
                self.name = name

        def part(name, polygon, vertices):
            empty = np.zeros(0, np.int32)
            faces = np.zeros((len(polygon), 3), np.int32)
            loop_total = np.full(max(polygon) + 1, 3)
            return meshes.Part(Named(name), np.zeros((vertices, 3)), faces, faces, np.array(polygon), empty, loop_total, empty, 0)

        one = meshes.Sheet([part("a", [0, 0, 1], 4)])
        self.assertEqual(one.places([2], [], [3]), "face 1, vertex 3")
        self.assertEqual(one.places([0, 1, 2], [], []), "face 0, face 1", "triangles of one polygon")
        self.assertEqual(one.places([], [], []), "")
        two = meshes.Sheet([part("a", [0, 0, 1], 4), part("b", [7, 7], 9)])
        self.assertEqual(two.places([1, 4], [(4, 6)], []), "face 0 of a, face 7 of b, edge 0-2 of b")
        self.assertEqual(two.places([], [], range(5)), "vertex 0 of a, vertex 1 of a, vertex 2 of a, vertex 3 of a, ...")


if __name__ == "__main__":
    outcome = unittest.main(argv=sys.argv[sys.argv.index("--") + 1 :], exit=False, verbosity=1).result
    engines.close()
    sys.exit(0 if outcome.wasSuccessful() and outcome.testsRun > 0 else 1)
