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


# A PNG of 2 x 2 texels.
PALETTE = (
    "89504e470d0a1a0a0000000d4948445200000002000000020802000000fdd49a730000001449444154789c63f8cfc0c000c20cffffff67"
    "00001eef04fca3c8b4f70000000049454e44ae426082"
)


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

    def test_a_palette_stays_a_picture(self):
        # Each face has one point of an image of 2 x 2 texels: no texel density to keep, and yet four colours.
        (self.path / "from.obj").write_text("mtllib a.mtl\nusemtl a\n" + OBJ % (("0.25 0.75",) * 4))
        (self.path / "a.mtl").write_text("newmtl a\nmap_Kd palette.png\n")
        (self.path / "palette.png").write_bytes(bytes.fromhex(PALETTE))
        report = planish.transfer(self.path / "from.obj", self.path / "to.obj", self.path / "out.obj")
        image = next(file for file in map(pathlib.Path, report["files"]) if file.suffix == ".png").read_bytes()
        self.assertEqual([int.from_bytes(image[at : at + 4], "big") for at in (16, 20)], [512, 512])

    def test_project(self):
        report = planish.transfer(
            self.path / "from.obj", self.path / "to.obj", self.path / "out.gltf", project=True, cage=2, texture_size=64
        )
        self.assertEqual((report["missed"], report["baked"]), (0, ["normals"]))
        self.assertEqual(len(json.loads((self.path / "out.gltf").read_text())["images"]), 1)

    def test_heights_are_a_file_with_its_range(self):
        (self.path / "from.obj").write_text("v 0 0 0.02\nv 1 0 0.02\nv 1 1 0.03\nv 0 1 0.03\nf 1 2 3 4\n")
        report = planish.transfer(
            *(self.path / name for name in ("from.obj", "to.obj", "out.glb")),
            project=True,
            cage=5,
            texture_size=64,
            bake=["height", "occlusion"],
            occlusion_distance=10,
        )
        self.assertEqual(report["baked"], ["occlusion", "height"])
        self.assertEqual(report["height"]["file"], str(self.path / "out_height.png"))
        self.assertEqual(report["files"], [str(self.path / "out_height.png"), str(self.path / "out.glb")])
        self.assertAlmostEqual(report["height"]["low"], 0.02, 3)
        self.assertAlmostEqual(report["height"]["high"], 0.03, 3)
        with self.assertRaisesRegex(planish.InvalidArgument, "--bake=height is for --project"):
            planish.transfer(*(self.path / name for name in ("from.obj", "to.obj", "out.obj")), bake=["height"])

    def test_errors_have_reasons(self):
        (self.path / "to.obj").write_text("v 0 0 0\nv 2 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
        with self.assertRaises(planish.InvalidArgument) as raised:
            planish.transfer(self.path / "from.obj", self.path / "to.obj", self.path / "out.obj")
        self.assertEqual(raised.exception.reason, "SURFACES_DIFFER")
        with self.assertRaises(planish.Unavailable):
            planish.transfer("a.obj", "b.obj", "c.obj", command=str(self.path / "nothing"))


if __name__ == "__main__":
    unittest.main()
