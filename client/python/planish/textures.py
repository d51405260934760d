"""Moves images from one map to another, by the command ``planish``, which has the only resampler."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from typing import Any, Dict, List, Optional, Sequence, Union

from ._programs import is_program, own_program
from .errors import Error, InvalidArgument, Unavailable

_Path = Union[str, "os.PathLike[str]"]


def find_command() -> Optional[str]:
    """The command ``planish``: the one that ``PLANISH_COMMAND`` names, else the one in this package, else one in
    ``PATH``. None if there is none."""
    named = os.environ.get("PLANISH_COMMAND")
    if named:
        return named if is_program(named) else None
    return own_program("planish") or shutil.which("planish")


def transfer(
    source: _Path,
    target: _Path,
    output: _Path,
    *,
    project: bool = False,
    cage: Optional[float] = None,
    texture_size: Optional[int] = None,
    allow_outside: bool = False,
    merge_materials: bool = False,
    bake: Sequence[str] = (),
    occlusion_distance: Optional[float] = None,
    command: Optional[str] = None,
    timeout: Optional[float] = None,
) -> Dict[str, Any]:
    """Writes the file ``output``: ``source`` with the UV of ``target``, and with its images resampled for these UV. The
    files ``source`` and ``target`` must have the same triangles.

    With ``project`` the surfaces need only lie close, like a scan and its decimated copy: ``output`` is ``target`` with what
    ``source`` shows as images. ``cage``: how far apart they may be, in percent of target's diagonal. ``bake``: which images,
    of ``"colors"``, ``"normals"``, ``"height"`` and ``"occlusion"``; by default the first two. Heights are a file beside
    ``output``. ``occlusion_distance``: up to which distance ``source`` hides the sky from itself, in percent of its diagonal.

    Without it, ``bake=["colors"]`` paints the colours of vertices into an image of base colours. ``merge_materials``:
    materials of a glTF that differ only in images and factors become one; not with ``project``.

    Returns what ``planish transfer --json`` prints: ``triangles``, ``seconds``, ``files``, ``warnings``; with ``project`` also
    ``texels``, ``missed``, ``baked`` and, of heights, ``height`` (``file``, ``low``, ``high``).
    """
    program = command or find_command()
    if program is None:
        raise Unavailable(
            "the command planish was not found: install it, or set PLANISH_COMMAND to its path", reason="COMMAND_MISSING"
        )
    call: List[str] = [program, "transfer", "--json", "--quiet", "-o", os.fspath(output)]
    if project:
        call.append("--project")
    if cage is not None:
        call.append(f"--cage={cage}")
    if texture_size is not None:
        call.append(f"--texture-size={texture_size}")
    if allow_outside:
        call.append("--allow-outside")
    if merge_materials:
        call.append("--merge-materials")
    if bake:
        call.append("--bake=" + ",".join(bake))
    if occlusion_distance is not None:
        call.append(f"--occlusion-distance={occlusion_distance}")
    call += ["--", os.fspath(source), os.fspath(target)]
    try:
        done = subprocess.run(
            call, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=timeout, check=False
        )
    except OSError as error:
        raise Unavailable(f"{program}: {error.strerror}", reason="COMMAND_MISSING") from error
    report: Dict[str, Any] = {}
    try:
        report = json.loads(done.stdout)
    except ValueError:
        pass
    if done.returncode == 0:
        return report
    failure = report.get("error") or {}
    message = str(failure.get("message") or done.stderr.decode(errors="replace").strip() or "planish transfer failed")
    kind = InvalidArgument if done.returncode in (1, 2) else Error
    raise kind(message, reason=str(failure.get("reason") or ""))
