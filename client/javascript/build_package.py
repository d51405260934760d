#!/usr/bin/env python3
"""Makes the npm package: what `npm pack` would make of this folder, with the version and the published protos. Needs neither npm nor a network.

    build_package.py TGZ VERSION PROTO_DIR LICENSE
"""

import gzip
import io
import json
import pathlib
import sys
import tarfile

PROTOS = ("google/rpc/status.proto", "google/rpc/error_details.proto", "planish/v1/job.proto", "planish/v1/planish.proto")


def files(version: str, protos: pathlib.Path, license: pathlib.Path):
    here = pathlib.Path(__file__).parent
    package = json.loads((here / "package.json").read_text())
    yield "package.json", (json.dumps({**package, "version": version}, indent=2) + "\n").encode()
    yield "LICENSE", license.read_bytes()
    yield "README.md", (here / "README.md").read_bytes()
    for path in sorted((here / "src").iterdir()):
        yield f"src/{path.name}", path.read_bytes()
    for name in PROTOS:
        yield f"proto/{name}", (protos / name).read_bytes()


def main(target: str, version: str, protos: str, license: str) -> None:
    # A package of the same files is the same package.
    with open(target, "wb") as out, gzip.GzipFile("", "wb", fileobj=out, mtime=0) as packed, tarfile.open(fileobj=packed, mode="w") as archive:
        for name, content in files(version, pathlib.Path(protos), pathlib.Path(license)):
            entry = tarfile.TarInfo(f"package/{name}")
            entry.size, entry.mode = len(content), 0o644
            archive.addfile(entry, io.BytesIO(content))


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
