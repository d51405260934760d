"""The wheel and the sdist that the build makes, as somebody would install them."""

import email
import os
import pathlib
import subprocess
import sys
import tarfile
import tempfile
import unittest
import zipfile

import support

DIST = pathlib.Path(os.environ["PLANISH_PYTHON_DIST"])
VERSION = os.environ["PLANISH_VERSION"]


class Package(unittest.TestCase):
    def setUp(self):
        (self.wheel,) = DIST.glob("*.whl")
        (self.sdist,) = DIST.glob("*.tar.gz")

    def test_names(self):
        self.assertEqual(self.wheel.name, f"planish-{VERSION}-py3-none-any.whl")
        self.assertEqual(self.sdist.name, f"planish-{VERSION}.tar.gz")

    def test_wheel_works_by_itself(self):
        with tempfile.TemporaryDirectory() as directory:
            with zipfile.ZipFile(self.wheel) as wheel:
                wheel.extractall(directory)
                names = wheel.namelist()
                metadata = email.message_from_bytes(wheel.read(f"planish-{VERSION}.dist-info/METADATA"))
            code = """if True:
                import planish, sys
                from importlib import metadata
                result = planish.unwrap([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
                print(planish.__file__.startswith(sys.argv[1]), metadata.version("planish"), planish.__version__, result.is_usable)
            """
            environment = {**os.environ, "PYTHONPATH": directory}
            self.assertEqual(support.run_python(code, directory, env=environment), f"True {VERSION} {VERSION} True\n")
        sources = {f"planish/{path.name}" for path in (support.SOURCE_TREE / "client/python/planish").glob("*.py")}
        self.assertLessEqual(sources | {"planish/py.typed", "planish/v1/planish_pb2_grpc.py", "planish/v1/job_pb2.pyi"}, set(names))
        self.assertEqual([name for name in names if name.endswith((".so", ".pyc", ".proto"))], [])
        self.assertEqual(metadata["Requires-Python"], ">=3.9")
        requirements = {line.split(">")[0].strip(" (") for line in metadata.get_all("Requires-Dist")}
        self.assertEqual(requirements, {"grpcio", "protobuf", "numpy"})

    def test_sdist_makes_the_same_wheel(self):
        with tempfile.TemporaryDirectory() as directory:
            with tarfile.open(self.sdist) as sdist:
                sdist.extractall(directory)
            code = "from setuptools import build_meta; build_meta.build_wheel('.')"
            tree = os.path.join(directory, f"planish-{VERSION}")
            subprocess.run([sys.executable, "-c", code], cwd=tree, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            with zipfile.ZipFile(os.path.join(tree, self.wheel.name)) as again, zipfile.ZipFile(self.wheel) as wheel:
                files = [name for name in wheel.namelist() if name.startswith("planish/")]
                self.assertEqual(sorted(files), sorted(name for name in again.namelist() if name.startswith("planish/")))
                for name in files:
                    self.assertEqual(wheel.read(name), again.read(name), name)

    def test_others_may_bring_googles_messages(self):
        # Under its own name google/rpc/status.proto can be there once only, and packages of Google's bring it.
        code = """if True:
            import planish
            from google.protobuf import descriptor_pb2, descriptor_pool
            theirs = descriptor_pb2.FileDescriptorProto(name="google/rpc/status.proto", package="google.rpc", syntax="proto3")
            theirs.message_type.add(name="Status").field.add(name="code", number=1, type=5, label=1)
            descriptor_pool.Default().AddSerializedFile(theirs.SerializeToString())
            print(descriptor_pool.Default().FindMessageTypeByName("google.rpc.Status").full_name)
        """
        self.assertEqual(support.run_python(code), "google.rpc.Status\n")


if __name__ == "__main__":
    unittest.main()
