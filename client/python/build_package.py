#!/usr/bin/env python3
"""Makes the Python package out of its sources and the published protos. Needs no network.

    build_package.py tree  OUT VERSION PROTOC GRPC_PYTHON_PLUGIN PROTO_DIR LICENSE
    build_package.py wheel OUT

`tree` writes OUT/tree: the sources with the modules that protoc makes, ready to be imported. `wheel` makes OUT/dist/*.whl and
OUT/dist/*.tar.gz of it, by setuptools.
"""

import pathlib
import shutil
import subprocess
import sys

# google/rpc is compiled under a name of the package's own. Two packages that bring the same file under the same name cannot be
# imported by one process, and others bring Google's.
RENAMED = (("google/rpc/", "planish/rpc/"), ("google.rpc", "planish.rpc"))
MESSAGES = ("google/rpc/status.proto", "google/rpc/error_details.proto", "planish/v1/job.proto", "planish/v1/planish.proto")
SERVICE = "planish/v1/planish.proto"
SOURCES = ("README.md", "pyproject.toml")


def renamed(text: str) -> str:
    for old, new in RENAMED:
        text = text.replace(old, new)
    return text


def for_docstrings(proto: str) -> str:
    """Comments become docstrings, in which a backslash must be written as two."""
    return renamed(proto).replace("\\", "\\\\")


def make_tree(out: pathlib.Path, version: str, protoc: str, plugin: str, protos: pathlib.Path, license: str) -> None:
    here = pathlib.Path(__file__).parent
    tree, work = out / "tree", out / "protos"
    for directory in (tree, work):
        shutil.rmtree(directory, ignore_errors=True)
    tree.mkdir(parents=True)
    for name in SOURCES:
        shutil.copy(here / name, tree)
    shutil.copy(license, tree / "LICENSE")
    shutil.copytree(here / "planish", tree / "planish", ignore=shutil.ignore_patterns("__pycache__"))
    (tree / "planish/_version.py").write_text(f'"""Made by the build."""\n\n__version__ = "{version}"\n')
    for name in MESSAGES:
        target = work / renamed(name)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(for_docstrings((protos / name).read_text()))
    command = [protoc, f"-I{work}", f"--python_out={tree}", f"--pyi_out={tree}"]
    subprocess.run([*command, *(str(work / renamed(name)) for name in MESSAGES)], check=True)
    grpc = [f"--plugin=protoc-gen-grpc_python={plugin}", f"--grpc_python_out={tree}"]
    subprocess.run([protoc, f"-I{work}", *grpc, str(work / SERVICE)], check=True)
    for name in ("rpc", "v1"):
        (tree / f"planish/{name}/__init__.py").write_text('"""Made by protoc from the published protos."""\n')
    shutil.rmtree(work)


def make_wheel(out: pathlib.Path) -> None:
    dist = (out / "dist").absolute()
    shutil.rmtree(dist, ignore_errors=True)
    dist.mkdir(parents=True)
    tree = out / "tree"
    code = "import sys; from setuptools import build_meta as b; d = sys.argv[1]; b.build_sdist(d); b.build_wheel(d)"
    done = subprocess.run(
        [sys.executable, "-c", code, str(dist)], cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if done.returncode != 0:  # setuptools says much where all is well
        sys.exit(done.stdout)
    for leftover in ("build", "planish.egg-info"):
        shutil.rmtree(tree / leftover, ignore_errors=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["tree"] and len(sys.argv) == 8:
        make_tree(pathlib.Path(sys.argv[2]), *sys.argv[3:6], pathlib.Path(sys.argv[6]), sys.argv[7])
    elif sys.argv[1:2] == ["wheel"] and len(sys.argv) == 3:
        make_wheel(pathlib.Path(sys.argv[2]))
    else:
        sys.exit(__doc__)
