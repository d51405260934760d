"""Scripts that were written for xatlas's binding, with the import changed."""

import io
import os
import sys
import tempfile
import types
import unittest
import unittest.mock
import warnings
from contextlib import redirect_stdout

import numpy as np

import planish
import planish as xatlas
import support


class XatlasTest(unittest.TestCase):
    def check_mesh(self, mesh, positions, triangles):
        """Ranks and types of the binding, and the mesh is the one that went in."""
        vmapping, indices, uvs = mesh
        self.assertEqual((vmapping.dtype, vmapping.ndim), (np.uint32, 1))
        self.assertEqual((indices.dtype, indices.shape), (np.uint32, triangles.shape))
        self.assertEqual((uvs.dtype, uvs.shape), (np.float32, (len(vmapping), 2)))
        np.testing.assert_array_equal(vmapping[indices], triangles)
        self.assertTrue(((uvs >= 0) & (uvs <= 1)).all())
        self.assertTrue((support.uv_areas(uvs[indices]) > 0).all())
        self.assertEqual(set(vmapping.tolist()), set(np.unique(triangles).tolist()))
        self.assertEqual(len(np.unique(indices)), len(vmapping))

    @classmethod
    def tearDownClass(cls):
        planish.close_default_server()


class Parametrize(XatlasTest):
    def test_arrays_of_all_kinds(self):
        positions, triangles = support.ball(4)
        expected = xatlas.parametrize(positions, triangles)
        self.check_mesh(expected, positions, triangles)
        for p, t in (
            (positions.astype(np.float32), triangles.astype(np.int32)),
            (positions.tolist(), triangles.astype(float)),  # the binding casts
        ):
            for ours, theirs in zip(xatlas.parametrize(p, t), expected):
                np.testing.assert_array_equal(ours, theirs)
        normals = positions / np.linalg.norm(positions, axis=1, keepdims=True)
        self.check_mesh(xatlas.parametrize(positions, triangles, normals), positions, triangles)

    def test_uv_are_those_of_unwrap(self):
        # With the binding's default of one texel for bilinear sampling and none of padding.
        positions, triangles = support.ball(4)
        vmapping, indices, uvs = xatlas.parametrize(positions, triangles)
        np.testing.assert_array_equal(uvs[indices], planish.unwrap(positions, triangles, padding=1, prefer="texture").uv)

    def test_vertices_without_a_triangle_go(self):
        positions, triangles = support.ball(2)
        holes = np.concatenate([np.zeros((3, 3)), positions, np.ones((2, 3))])
        self.check_mesh(xatlas.parametrize(holes, triangles + 3), holes, triangles + 3)

    def test_no_process_from_the_second_call_on(self):
        xatlas.parametrize(*support.cube())
        server = support.children()
        self.assertEqual(len(server), 1)
        for i in range(3):
            xatlas.parametrize(support.cube()[0] * (i + 2), support.cube()[1])
        self.assertEqual(support.children(), server)

    def test_trimesh_unwrap(self):
        # As trimesh.base.Trimesh.unwrap calls it.
        positions, triangles = support.ball(3)
        mesh = types.SimpleNamespace(vertices=positions.view(), faces=triangles.astype(np.int64))
        with unittest.mock.patch.dict(sys.modules, xatlas=planish):
            import xatlas as imported

            vmap, faces, uv = imported.parametrize(mesh.vertices, mesh.faces)
        result = types.SimpleNamespace(vertices=mesh.vertices[vmap], faces=faces, uv=uv)
        np.testing.assert_array_equal(result.vertices[result.faces], positions[triangles])

    def test_export(self):
        positions, triangles = support.ball(2)
        vmapping, indices, uvs = xatlas.parametrize(positions, triangles)
        with tempfile.TemporaryDirectory() as directory:
            path = os.path.join(directory, "out.obj")
            xatlas.export(path, positions[vmapping], indices, uvs)
            vertices, faces, corner_uv = support.read_obj(path)
            np.testing.assert_array_equal(vertices.astype(np.float32), positions[vmapping].astype(np.float32))
            np.testing.assert_array_equal(faces, indices)
            np.testing.assert_array_equal(corner_uv.astype(np.float32), uvs[indices])


class AtlasScripts(XatlasTest):
    def test_two_meshes(self):
        first, second = support.ball(4), support.bump(6)
        atlas = xatlas.Atlas()
        atlas.add_mesh(*first)
        atlas.add_mesh(*second)
        atlas.add_mesh(np.zeros((3, 3)), np.zeros((0, 3), int))
        self.assertEqual(atlas.mesh_count, 3)
        chart_options, pack_options = xatlas.ChartOptions(), xatlas.PackOptions()
        pack_options.resolution = 512
        pack_options.padding = 3
        said = io.StringIO()
        with redirect_stdout(said):
            atlas.generate(chart_options=chart_options, pack_options=pack_options, verbose=True)
        self.assertIn(f"Charts: {atlas.chart_count}", said.getvalue())
        self.check_mesh(atlas[0], *first)
        self.check_mesh(atlas[1], *second)
        self.assertEqual([len(each) for each in atlas[2]], [0, 0, 0])
        self.assertEqual((len(atlas), atlas.atlas_count, atlas.width, atlas.height), (3, 1, 512, 512))
        area = sum(support.uv_areas(uvs[indices]).sum() for _, indices, uvs in (atlas[0], atlas[1]))
        self.assertAlmostEqual(atlas.utilization, area, places=5)
        self.assertEqual(atlas.utilization, atlas.get_utilization(0))
        self.assertGreater(atlas.texels_per_unit, 0)
        counts = [atlas.get_mesh_chart_count(i) for i in range(3)]
        self.assertEqual(counts[2], 0)
        self.assertEqual(sum(counts), atlas.chart_count)
        faces = np.concatenate([atlas.get_mesh_chart(0, i).faces for i in range(counts[0])])
        np.testing.assert_array_equal(np.sort(faces), np.arange(len(first[1])))
        atlas_index, chart_index = atlas.get_mesh_vertex_assignment(1)
        self.assertEqual(set(atlas_index.tolist()), {0})
        self.assertEqual(set(chart_index.tolist()), set(range(counts[0], counts[0] + counts[1])))
        again = [list(mesh) for mesh in (atlas[0], atlas[1])]  # for the loops that scripts write
        self.assertEqual(len(again), 2)
        self.assertEqual(len(list(atlas)), 3)

    def test_options_without_a_meaning_are_warned_of_once(self):
        planish.xatlas._warned.clear()
        for expected in (["ChartOptions.max_cost", "ChartOptions.max_iterations", "PackOptions.blockAlign"], []):
            atlas = xatlas.Atlas()
            atlas.add_mesh(*support.cube())
            chart_options, pack_options = xatlas.ChartOptions(), xatlas.PackOptions()
            chart_options.max_cost = 4.0
            chart_options.max_iterations = 4
            pack_options.blockAlign = True
            pack_options.rotate_charts = True  # as it is anyhow
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                atlas.generate(chart_options, pack_options)
            self.assertEqual([str(each.message).split()[0] for each in caught], expected)
            self.assertEqual({each.category for each in caught}, {planish.OptionIgnored} if expected else set())
            self.assertEqual({each.filename for each in caught}, {__file__} if expected else set())
        with self.assertRaises((AttributeError, TypeError)):
            xatlas.PackOptions().brute_force = True

    def test_options_with_a_meaning(self):
        positions, triangles = support.ball(4)
        counts = []
        for stretch in (1.02, 1.5):
            atlas = xatlas.Atlas()
            atlas.add_mesh(positions, triangles)
            options = xatlas.ChartOptions()
            options.max_stretch = stretch
            pack = xatlas.PackOptions()
            pack.bruteForce = True
            pack.bilinear = False
            atlas.generate(options, pack)
            counts.append(atlas.chart_count)
        self.assertGreater(counts[0], counts[1])

    def test_errors_of_the_binding(self):
        positions, triangles = support.cube()
        atlas = xatlas.Atlas()
        for arguments, text in (
            ((positions[:, :2], triangles), "Position array expected to be Nx3."),
            ((positions, triangles.ravel()), "Index array expected to be Nx3."),
            ((positions, triangles, positions[:2]), "first dimension"),
            ((positions, triangles, None, positions), "Nx2"),
        ):
            with self.assertRaisesRegex(ValueError, text):
                atlas.add_mesh(*arguments)
        with self.assertRaisesRegex(RuntimeError, "out of range"):
            atlas.add_mesh(positions[:3], triangles)
        for index in (0, -1):
            with self.assertRaisesRegex(IndexError, "out of bounds"):
                atlas.get_mesh(index)
        with self.assertRaises(IndexError):
            atlas.utilization
        with self.assertRaises(RuntimeError):
            atlas.chart_image
        with self.assertRaisesRegex(NotImplementedError, "planish pack"):
            atlas.add_uv_mesh(positions[:, :2], triangles)
        atlas.generate()  # of nothing
        self.assertEqual((len(atlas), atlas.chart_count), (0, 0))
        atlas.add_mesh(positions, triangles[:0])
        atlas.generate()
        self.assertEqual((len(atlas), atlas.chart_count, atlas.get_mesh_chart_count(0)), (1, 0, 0))
        atlas.add_mesh(positions * np.nan, triangles)
        with self.assertRaises(planish.ArrayError):
            atlas.generate()


if __name__ == "__main__":
    unittest.main()
