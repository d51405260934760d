"""The add-on on meshes of Blender. Runs in Blender: run.sh."""

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
sys.path.insert(0, os.path.join(os.environ["PLANISH_SOURCE_TREE"], "tests/client/blender"))
import addon  # noqa: E402
import support  # noqa: E402
from addon import PREFERENCES, get, uv_of, loop_triangles, corner_uv, uv_borders, edges_where, islands, unwrap  # noqa: E402
from planish_blender import engines, meshes, operator  # noqa: E402

ENGINES = ("PACKAGE", "COMMAND")


class AddOn(addon.Case):
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
    addon.main()
