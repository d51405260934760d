#!/usr/bin/env python3
"""Makes the zips that Blender installs, both from the same sources.

    build_addon.py addon     ZIP VERSION PACKAGE_TREE LICENSE          for all versions: the package `planish` is in its folder `lib`
    build_addon.py extension ZIP VERSION LICENSE PLATFORM WHEEL...     for 4.2 and later: the wheels are in it; PLATFORM as Blender names it

The wheels are that of `planish`, and those of grpcio and protobuf if available. With the wheel of `planish` that
contains the server, the extension works without the other two wheels: it runs the command in that wheel.
"""

import pathlib
import re
import sys
import zipfile

NAME = "planish_blender"
# For reproducible zips.
DATE = (2000, 1, 1, 0, 0, 0)
MANIFEST = "blender_manifest.toml"


def sources(version: str):
    here = pathlib.Path(__file__).parent / NAME
    numbers = ", ".join(re.findall(r"\d+", version)[:3])
    for path in sorted(here.glob("*.py")):
        text = path.read_text()
        if path.name == "__init__.py":
            text, count = re.subn(r'("version": )\(0, 0, 0\)', rf"\1({numbers})", text)
            if count != 1:
                sys.exit(f"{path} has no version to replace")
        yield path.name, text.encode()


def addon(version: str, tree: str, license: str):
    for name, content in sources(version):
        yield f"{NAME}/{name}", content
    yield f"{NAME}/LICENSE", pathlib.Path(license).read_bytes()
    package = pathlib.Path(tree) / "planish"
    for path in sorted(package.rglob("*")):
        if path.suffix == ".py" or path.name == "py.typed":
            yield f"{NAME}/lib/planish/{path.relative_to(package)}", path.read_bytes()


def extension(version: str, license: str, platform: str, *wheels: str):
    yield from sources(version)
    yield "LICENSE", pathlib.Path(license).read_bytes()
    names = sorted(pathlib.Path(wheel).name for wheel in wheels)
    listed = "".join(f'  "./wheels/{name}",\n' for name in names)
    manifest = (pathlib.Path(__file__).parent / NAME / MANIFEST).read_text()
    for old, new in (('"0.0.0"', f'"{version}"'), ("platforms = []", f'platforms = ["{platform}"]'), ("wheels = []", f"wheels = [\n{listed}]")):
        if manifest.count(old) != 1:
            sys.exit(f"{MANIFEST} has no {old} to replace")
        manifest = manifest.replace(old, new)
    yield MANIFEST, manifest.encode()
    for wheel in sorted(map(pathlib.Path, wheels), key=lambda path: path.name):
        yield f"wheels/{wheel.name}", wheel.read_bytes()


def main(kind, target: str, *arguments: str) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in kind(*arguments):
            archive.writestr(zipfile.ZipInfo(name, DATE), content, zipfile.ZIP_STORED if name.endswith(".whl") else zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    if sys.argv[1:2] == ["addon"] and len(sys.argv) == 6:
        main(addon, *sys.argv[2:])
    elif sys.argv[1:2] == ["extension"] and len(sys.argv) >= 7:
        main(extension, *sys.argv[2:])
    else:
        sys.exit(__doc__)
