#!/usr/bin/env python3
"""Makes the zip that Blender installs: the add-on, and in its folder `lib` the Python package `planish`.

    build_addon.py ZIP VERSION PACKAGE_TREE LICENSE
"""

import pathlib
import re
import sys
import zipfile

NAME = "planish_blender"
# A zip of the same files is the same zip.
DATE = (2000, 1, 1, 0, 0, 0)


def files(version: str, tree: pathlib.Path, license: pathlib.Path):
    here = pathlib.Path(__file__).parent / NAME
    numbers = ", ".join(re.findall(r"\d+", version)[:3])
    for path in sorted(here.glob("*.py")):
        text = path.read_text()
        if path.name == "__init__.py":
            text, count = re.subn(r'("version": )\(0, 0, 0\)', rf"\1({numbers})", text)
            if count != 1:
                sys.exit(f"{path} has no version to replace")
        yield f"{NAME}/{path.name}", text.encode()
    yield f"{NAME}/LICENSE", license.read_bytes()
    package = tree / "planish"
    for path in sorted(package.rglob("*")):
        if path.suffix == ".py" or path.name == "py.typed":
            yield f"{NAME}/lib/planish/{path.relative_to(package)}", path.read_bytes()


def main(target: str, version: str, tree: str, license: str) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files(version, pathlib.Path(tree), pathlib.Path(license)):
            archive.writestr(zipfile.ZipInfo(name, DATE), content, zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
