#!/usr/bin/env python3
"""Makes the npm package: what `npm pack` would make of this folder, with the version and the published protos. Needs
neither npm nor a network. OPTIONS is the file that `planish_fields typescript` writes.

    build_package.py TGZ VERSION PROTO_DIR LICENSE OPTIONS
"""

import gzip
import io
import json
import pathlib
import sys
import tarfile

PROTOS = ("google/rpc/status.proto", "google/rpc/error_details.proto", "planish/v1/about.proto", "planish/v1/options.proto", "planish/v1/job.proto", "planish/v1/planish.proto")


def files(version: str, protos: pathlib.Path, license: pathlib.Path, options: pathlib.Path):
    here = pathlib.Path(__file__).parent
    package = json.loads((here / "package.json").read_text())
    yield "package.json", (json.dumps({**package, "version": version}, indent=2) + "\n").encode()
    yield "LICENSE", license.read_bytes()
    yield "README.md", (here / "README.md").read_bytes()
    for path in sorted((here / "src").iterdir()):
        yield f"src/{path.name}", path.read_bytes()
    yield "src/options.d.ts", options.read_bytes()
    for name in PROTOS:
        yield f"proto/{name}", (protos / name).read_bytes()


def main(target: str, version: str, protos: str, license: str, options: str) -> None:
    # mtime=0, so that the same files give the same package, byte for byte.
    with open(target, "wb") as out, gzip.GzipFile("", "wb", fileobj=out, mtime=0) as packed, tarfile.open(fileobj=packed, mode="w") as archive:
        for name, content in files(version, pathlib.Path(protos), pathlib.Path(license), pathlib.Path(options)):
            entry = tarfile.TarInfo(f"package/{name}")
            entry.size, entry.mode = len(content), 0o644
            archive.addfile(entry, io.BytesIO(content))


if __name__ == "__main__":
    if len(sys.argv) != 6:
        sys.exit(__doc__)
    main(*sys.argv[1:])
