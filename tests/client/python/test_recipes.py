"""Runs the recipes of client/python/README.md, with stand-ins for modules that are not installed."""

import importlib.util
import io
import os
import re
import runpy
import sys
import tempfile
import types
import unittest
from contextlib import redirect_stdout
from unittest import mock

import numpy as np

import planish
import support

README = support.SOURCE_TREE / "client/python/README.md"
RECIPES = {
    int(number): code
    for number, code in re.findall(r"^### (\d+)\..*?^```python\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
}

# Those that the page begins with.
RECIPES[0] = re.match(r"# [^\n]*\n\n```python\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)[1]


def module(name, **contents):
    made = types.ModuleType(name)
    made.__dict__.update(contents)
    return made


class Tensor:
    """Of torch, as far as recipe 4 goes."""

    def __init__(self, array):
        self._array = np.asarray(array)

    shape = property(lambda self: self._array.shape)
    detach = cpu = lambda self: self
    numpy = lambda self: self._array
    __pow__ = lambda self, n: Tensor(self._array**n)
    __add__ = lambda self, other: Tensor(self._array + other._array)
    __sub__ = lambda self, number: Tensor(self._array - number)


class Recipes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = support.Server("--workers=2")

    @classmethod
    def tearDownClass(cls):
        cls.server.close()
        planish.close_default_server()

    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(directory.name)

    def run_recipe(self, number, stand_ins=None, server=True):
        """What it printed, and its variables."""
        path = f"recipe{number}.py"
        with open(path, "w", encoding="utf-8") as file:
            file.write(RECIPES[number])
        missing = {
            name: made
            for name, made in (stand_ins or {}).items()
            if name.partition(".")[0] not in sys.modules and importlib.util.find_spec(name.partition(".")[0]) is None
        }
        said = io.StringIO()
        environment = {"PLANISH_SERVER": self.server.target} if server else {}
        with mock.patch.dict(sys.modules, missing), mock.patch.dict(os.environ, environment), redirect_stdout(said):
            variables = runpy.run_path(path, run_name="__main__")
        return said.getvalue(), variables

    def save_parts(self, path="parts.npz"):
        positions, triangles = support.bump(8, height=0.1)
        part = (positions[triangles].mean(axis=1)[:, 0] > 0.5).astype(int)
        np.savez(path, positions=positions, triangles=triangles, part=part)
        return positions, triangles

    def test_0(self):
        said, variables = self.run_recipe(0)
        self.assertTrue(said.startswith("(4, 3, 2) "), said)
        self.assertEqual(len(variables["split"].uv), len(variables["split"].source_vertex))

    def test_there_are_ten(self):
        self.assertEqual(sorted(RECIPES), list(range(11)))

    def test_1_arrays(self):
        said, variables = self.run_recipe(1, server=False)
        self.assertEqual(variables["result"].uv.shape, (4, 3, 2))
        self.assertIn(f"{variables['result'].chart_count} charts, stretch 1", said)

    def test_1_arrays_of_a_mesh_whose_steps_take_a_while(self):
        """What takes less than a moment is not told of, so the tetrahedron may show no step at all."""
        arrays = r"^positions = .*\n^triangles = .*\n"
        code, count = re.subn(arrays, "import support\npositions, triangles = support.bump(300)\n", RECIPES[1], flags=re.MULTILINE)
        self.assertEqual(count, 1)
        with mock.patch.dict(RECIPES, {1: code}):
            said, variables = self.run_recipe(1, server=False)
        self.assertRegex(said, r"(?m)^solve \d+ \d+$")
        self.assertEqual(variables["result"].uv.shape, (180000, 3, 2))

    def test_2_xatlas(self):
        said, variables = self.run_recipe(2, server=False)
        self.assertIn("charts", said)
        self.assertEqual(variables["indices"].shape, (4, 3))

    def test_3_trimesh(self):
        positions, triangles = support.ball(4)
        made = []

        class Trimesh(types.SimpleNamespace):
            def export(self, path):
                made.append((path, self))

        def load(path, force, process):
            return Trimesh(vertices=positions, faces=triangles)

        visual = module("trimesh.visual", TextureVisuals=lambda uv: types.SimpleNamespace(uv=uv))
        stand_in = module("trimesh", load=load, Trimesh=Trimesh, visual=visual)
        self.run_recipe(3, {"trimesh": stand_in, "trimesh.visual": visual})
        ((path, mesh),) = made
        self.assertEqual(path, "scan.glb")
        np.testing.assert_array_equal(mesh.vertices[mesh.faces], positions[triangles])
        self.assertEqual(mesh.visual.uv.shape, (len(mesh.vertices), 2))

    def test_4_pytorch(self):
        def marching_cubes(volume, level):
            self.assertEqual((volume.shape, level), ((24, 24, 24), 0.0))
            self.assertLess(volume.min(), level)
            positions, triangles = support.ball(6)
            return positions.astype(np.float32), triangles.astype(np.int32), None, None

        torch = module(
            "torch",
            linspace=lambda a, b, n: Tensor(np.linspace(a, b, n)),
            meshgrid=lambda *axes, indexing: map(Tensor, np.meshgrid(*(axis.numpy() for axis in axes), indexing=indexing)),
            from_numpy=lambda array: Tensor({"int64": array, "float32": array}[str(array.dtype)]),
        )
        measure = module("skimage.measure", marching_cubes=marching_cubes)
        said, variables = self.run_recipe(4, {"torch": torch, "skimage": module("skimage", measure=measure), "skimage.measure": measure})
        self.assertEqual(len(variables["vertices"].shape), 2)
        self.assertEqual(variables["vertices"].shape[0], variables["uv"].shape[0])
        self.assertIn(", 2)", said)

    def test_5_parts(self):
        self.save_parts()
        said, variables = self.run_recipe(5)
        self.assertEqual(said, "2 charts, one for each part\n")
        self.assertEqual(set(variables["chart"].tolist()), {0, 1})

    def test_6_folder(self):
        os.mkdir("meshes")
        for i in range(5):
            positions, triangles = self.save_parts(f"meshes/mesh{i}.npz")
        np.savez("meshes/bad.npz", positions=positions, triangles=triangles + 1)
        said, _ = self.run_recipe(6)
        self.assertTrue(said.startswith("bad.npz MESH_INDEX_OUT_OF_RANGE triangles["), said)
        for i in range(5):
            self.assertEqual(np.load(f"meshes/mesh{i}.uv.npy").shape, (len(triangles), 3, 2))

    def test_7_jobs(self):
        self.save_parts()
        said, variables = self.run_recipe(7)
        self.assertEqual([type(each) for each in variables["created"]], [planish.Job] * 2)
        self.assertEqual(said.count("jobs/"), 2)

    def test_8_pool(self):
        self.save_parts()
        code = RECIPES[8]
        with open("recipe8.py", "w", encoding="utf-8") as file:
            file.write(code)
        said = support.run_python("import runpy; runpy.run_path('recipe8.py', run_name='__main__')")
        self.assertEqual(said, "[1, 1, 1, 1, 1, 1, 1, 1]\n")

    def test_9_houdini(self):
        positions, triangles = support.ball(3)
        written = {}
        prims = [
            types.SimpleNamespace(
                vertices=lambda face=face: [
                    types.SimpleNamespace(point=lambda v=v: types.SimpleNamespace(number=lambda: v)) for v in face
                ]
            )
            for face in triangles[:, ::-1].tolist()  # clockwise
        ]
        geometry = types.SimpleNamespace(
            pointFloatAttribValuesAsString=lambda name: {"P": positions.astype(np.float32).tobytes()}[name],
            prims=lambda: prims,
            addAttrib=lambda kind, name, default: written.update({"attribute": (kind, name, len(default))}),
            setVertexFloatAttribValues=lambda name, values: written.update({name: values}),
        )
        hou = module(
            "hou",
            pwd=lambda: types.SimpleNamespace(geometry=lambda: geometry),
            attribType=types.SimpleNamespace(Vertex="vertex"),
        )
        self.run_recipe(9, {"hou": hou})
        self.assertEqual(written["attribute"], ("vertex", "uv", 3))
        uvw = np.array(written["uv"]).reshape(-1, 3, 3)
        expected = planish.Client(self.server.target).unwrap(positions, triangles).uv
        # Of a corner of a clockwise face: the UV of that corner in the mesh that was unwrapped.
        np.testing.assert_array_equal(uvw[:, ::-1, :2].astype(np.float32), expected)
        self.assertEqual(np.abs(uvw[..., 2]).max(), 0)

    def test_10_maya(self):
        positions, triangles = support.ball(3)
        written = {}

        class MFnMesh:
            def __init__(self, path):
                self.path = path

            def getPoints(self, space):
                return np.c_[positions, np.ones(len(positions))].tolist()

            def getVertices(self):
                return [3] * len(triangles), triangles.ravel().tolist()

            def setUVs(self, us, vs):
                written["uv"] = np.stack([us, vs], 1)

            def assignUVs(self, counts, ids):
                written["ids"] = np.array(ids).reshape(-1, 3)
                written["counts"] = counts

        selection = types.SimpleNamespace(getDagPath=lambda index: "mesh")
        open_maya = module(
            "maya.api.OpenMaya",
            MFnMesh=MFnMesh,
            MSpace=types.SimpleNamespace(kObject=2),
            MGlobal=types.SimpleNamespace(getActiveSelectionList=lambda: selection),
        )
        api = module("maya.api", OpenMaya=open_maya)
        self.run_recipe(10, {"maya": module("maya", api=api), "maya.api": api, "maya.api.OpenMaya": open_maya})
        expected = planish.Client(self.server.target).unwrap(positions, triangles).uv
        np.testing.assert_array_equal(written["uv"][written["ids"]].astype(np.float32), expected)
        self.assertEqual(written["counts"], [3] * len(triangles))


if __name__ == "__main__":
    unittest.main()
