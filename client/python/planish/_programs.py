"""The programs that this package brings. Of the standard library alone, so that it can be used where gRPC is missing."""

from __future__ import annotations

import os
from typing import Optional


def is_program(path: str) -> bool:
    return os.path.isfile(path) and os.access(path, os.X_OK)


def own_program(name: str) -> Optional[str]:
    """The program ``planishd`` or ``planish`` that this package brings: its wheel for Linux has them. None if it brings none."""
    root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "_server")
    program = os.path.join(root, "bin", name)
    # Not all that unpacks wheels keeps the modes of files: Blender does not. One program starts the other.
    parts = [os.path.join(root, "lib", "loader")] + [
        os.path.join(root, folder, each) for folder in ("bin", "libexec") for each in ("planish", "planishd")
    ]
    for part in parts:
        if os.path.isfile(part) and not os.access(part, os.X_OK):
            try:
                os.chmod(part, os.stat(part).st_mode | 0o111)
            except OSError:
                return None  # of another user
    return program if is_program(program) else None
