#!/usr/bin/env python3
"""Makes the Python package out of its sources and the published protos. Needs no network.

    build_package.py tree   OUT VERSION PROTOC GRPC_PYTHON_PLUGIN PROTO_DIR LICENSE FIELDS
    build_package.py wheel  OUT
    build_package.py server WHEEL ROOT OUT

`tree` writes OUT/tree, which can be imported: the sources, the modules made from the protos, and FIELDS, the module
that `planish_fields python` writes. `wheel` makes OUT/dist/*.whl and OUT/dist/*.tar.gz from OUT/tree, by setuptools.
`server` makes OUT/*.whl, the wheel with the server for Linux on this architecture, from such a WHEEL and from ROOT, a
directory that deploy/relocatable.sh made.
"""

import base64
import hashlib
import pathlib
import platform
import shutil
import subprocess
import sys
import textwrap
import zipfile

# google/rpc is compiled under a name within this package: two packages with the same file under the same name cannot be
# imported by one process, and other packages have these files under Google's name.
RENAMED = (("google/rpc/", "planish/rpc/"), ("google.rpc", "planish.rpc"))
MESSAGES = ("google/rpc/status.proto", "google/rpc/error_details.proto", "planish/v1/about.proto", "planish/v1/options.proto", "planish/v1/job.proto", "planish/v1/planish.proto")
SERVICE = "planish/v1/planish.proto"
SOURCES = ("README.md", "pyproject.toml")


def renamed(text: str) -> str:
    for old, new in RENAMED:
        text = text.replace(old, new)
    return text


def for_docstrings(proto: str) -> str:
    """The text of a .proto for protoc, which turns comments into docstrings: these need two backslashes for one."""
    return renamed(proto).replace("\\", "\\\\")


def fields_of(message: bytes):
    """Yields number and content of each field of a serialized message that is a string or a message; skips others."""
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while at < len(message):
        key = varint()
        size = {0: None, 1: 8, 5: 4}.get(key & 7, 0)
        if size is None:
            varint()
            continue
        if key & 7 == 2:
            size = varint()
            yield key >> 3, message[at : at + size]
        at += size


def files_of(descriptor_set: bytes) -> "list[bytes]":
    return [content for number, content in fields_of(descriptor_set) if number == 1]


def name_and_imports(file: bytes) -> "tuple[str, list[str]]":
    fields = list(fields_of(file))
    return fields[0][1].decode(), [content.decode() for number, content in fields if number == 3]


def messages_module(name: str, imports: "list[str]", file: bytes) -> str:
    modules = tuple(each.replace(".proto", "_pb2").replace("/", ".") for each in imports)
    lines = "\n".join(f'    "{line}"' for line in textwrap.wrap(base64.b64encode(file).decode(), 120))
    return (
        f'"""The messages of {name}. Made by the build."""\n\nfrom planish import _messages\n\n'
        f"_messages.build(\n    globals(),\n    {name!r},\n    {modules!r},\n{lines},\n)\n"
    )


def make_tree(out: pathlib.Path, version: str, protoc: str, plugin: str, protos: pathlib.Path, license: str, fields: str) -> None:
    here = pathlib.Path(__file__).parent
    tree, work = out / "tree", out / "protos"
    for directory in (tree, work):
        shutil.rmtree(directory, ignore_errors=True)
    tree.mkdir(parents=True)
    for name in SOURCES:
        shutil.copy(here / name, tree)
    shutil.copy(license, tree / "LICENSE")
    shutil.copytree(here / "planish", tree / "planish", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(fields, tree / "planish/_job_fields.py")
    (tree / "planish/_version.py").write_text(f'"""Made by the build."""\n\n__version__ = "{version}"\n')
    for name in MESSAGES:
        target = work / renamed(name)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(for_docstrings((protos / name).read_text()))
    names = [renamed(name) for name in MESSAGES]
    described = work / "descriptors"
    subprocess.run([protoc, f"-I{work}", f"--pyi_out={tree}", f"--descriptor_set_out={described}", *names], cwd=work, check=True)
    for file in files_of(described.read_bytes()):
        name, imports = name_and_imports(file)
        (tree / name.replace(".proto", "_pb2.py")).write_text(messages_module(name, imports, file))
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
    if done.returncode != 0:  # setuptools prints much even on success
        sys.exit(done.stdout)
    for leftover in ("build", "planish.egg-info"):
        shutil.rmtree(tree / leftover, ignore_errors=True)


# The programs include their C library. The tag tells pip that they need Linux with glibc 2.17 or newer, which Python
# itself needs.
TAG = f"py3-none-manylinux_2_17_{platform.machine()}"
DATE = (2000, 1, 1, 0, 0, 0)  # for reproducible wheels
SCRIPT = '''#!python
"""Starts the program of this name that the package planish brings."""

import importlib.util
import os
import signal
import sys

name = os.path.basename(__file__)
spec = importlib.util.find_spec("planish")  # without importing it
program = os.path.join(os.path.dirname(spec.origin), "_server", "bin", name) if spec and spec.origin else ""
if not os.path.isfile(program):
    sys.exit(f"{name}: the package planish of {sys.executable} brings no {name}; install its wheel for Linux again")
signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # Python ignores it, and the program would inherit that
os.execv(program, [program, *sys.argv[1:]])
'''


def make_server_wheel(pure: pathlib.Path, root: pathlib.Path, out: pathlib.Path) -> None:
    name, version = pure.name.split("-")[:2]
    info = f"{name}-{version}.dist-info"
    target = out / f"{name}-{version}-{TAG}.whl"
    record = []
    with zipfile.ZipFile(pure) as source, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as wheel:

        def add(path: str, content: bytes, is_program: bool = False) -> None:
            entry = zipfile.ZipInfo(path, DATE)
            entry.external_attr = (0o100755 if is_program else 0o100644) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            wheel.writestr(entry, content)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record.append(f"{path},sha256={digest},{len(content)}\n")

        for path in sorted(root.rglob("*")):
            if path.is_file():
                is_program = bool(path.stat().st_mode & 0o111)
                add(f"{name}/_server/{path.relative_to(root)}", path.read_bytes(), is_program)
        for program in sorted((root / "bin").iterdir()):
            add(f"{name}-{version}.data/scripts/{program.name}", SCRIPT.encode(), True)
        for path in source.namelist():
            if path not in (f"{info}/WHEEL", f"{info}/RECORD") and not path.endswith("/"):
                add(path, source.read(path))
        add(f"{info}/WHEEL", f"Wheel-Version: 1.0\nGenerator: planish\nRoot-Is-Purelib: false\nTag: {TAG}\n".encode())
        wheel.writestr(zipfile.ZipInfo(f"{info}/RECORD", DATE), "".join(record) + f"{info}/RECORD,,\n", zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    if sys.argv[1:2] == ["tree"] and len(sys.argv) == 9:
        make_tree(pathlib.Path(sys.argv[2]), *sys.argv[3:6], pathlib.Path(sys.argv[6]), *sys.argv[7:])
    elif sys.argv[1:2] == ["wheel"] and len(sys.argv) == 3:
        make_wheel(pathlib.Path(sys.argv[2]))
    elif sys.argv[1:2] == ["server"] and len(sys.argv) == 5:
        make_server_wheel(*map(pathlib.Path, sys.argv[2:]))
    else:
        sys.exit(__doc__)
