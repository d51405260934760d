"""planish.transfer: the command, called from Python."""

import json
import pathlib
import tempfile
import unittest

import planish

OBJ = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt %s
vt %s
vt %s
vt %s
f 1/1 2/2 3/3
f 1/1 3/3 4/4
"""


class Transfer(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        (self.path / "from.obj").write_text(OBJ % ("0 0", "1 0", "1 1", "0 1"))
        (self.path / "to.obj").write_text(OBJ % ("0 0", "0.5 0", "0.5 0.5", "0 0.5"))

    def test_same_triangles(self):
        report = planish.transfer(self.path / "from.obj", self.path / "to.obj", self.path / "out.obj")
        self.assertEqual(report["triangles"], 2)
        self.assertIn("vt 0.5 0.5", (self.path / "out.obj").read_text())

    def test_project(self):
        report = planish.transfer(
            self.path / "from.obj", self.path / "to.obj", self.path / "out.gltf", project=True, cage=2, texture_size=64
        )
        self.assertEqual(report["missed"], 0)
        self.assertEqual(len(json.loads((self.path / "out.gltf").read_text())["images"]), 1)

    def test_errors_have_reasons(self):
        (self.path / "to.obj").write_text("v 0 0 0\nv 2 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
        with self.assertRaises(planish.InvalidArgument) as raised:
            planish.transfer(self.path / "from.obj", self.path / "to.obj", self.path / "out.obj")
        self.assertEqual(raised.exception.reason, "SURFACES_DIFFER")
        with self.assertRaises(planish.Unavailable):
            planish.transfer("a.obj", "b.obj", "c.obj", command=str(self.path / "nothing"))


if __name__ == "__main__":
    unittest.main()
