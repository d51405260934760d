"""The programs in this package. Uses only the standard library, so that it works without gRPC."""

from __future__ import annotations

import os
from typing import Optional


def is_program(path: str) -> bool:
    return os.path.isfile(path) and os.access(path, os.X_OK)


def own_program(name: str) -> Optional[str]:
    """The path of ``planishd`` or ``planish`` in this package. None if it has none; the wheel for Linux has both."""
    root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "_server")
    program = os.path.join(root, "bin", name)
    # Some unpackers of wheels, such as Blender's, do not keep the modes of files. Sets those of all parts, since one
    # program starts the other.
    parts = [os.path.join(root, "lib", "loader")] + [
        os.path.join(root, folder, each) for folder in ("bin", "libexec") for each in ("planish", "planishd")
    ]
    for part in parts:
        if os.path.isfile(part) and not os.access(part, os.X_OK):
            try:
                os.chmod(part, os.stat(part).st_mode | 0o111)
            except OSError:
                return None  # another user's file
    return program if is_program(program) else None
