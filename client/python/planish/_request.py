"""Converts arguments of callers to messages of `planish.v1`."""

from __future__ import annotations

import dataclasses
import uuid
from dataclasses import dataclass, field
from typing import Any, Dict, Mapping, Optional

from .errors import InvalidArgument
from .job import Scheduling, UnwrapOptions, enum_number
from .mesh import PackedMesh, pack_mesh
from .v1 import options_pb2, planish_pb2

#: Arguments about corners and faces of the mesh.
OF_MESH = ("seam_edges", "seam_corners", "parts", "uncut_corners", "face_polygon", "face_atlas", "face_weights")
_OPTION_NAMES = frozenset(each.name for each in dataclasses.fields(UnwrapOptions))


@dataclass(frozen=True, eq=False)
class NewJob:
    """A mesh and how to unwrap it."""

    #: (V, 3), real numbers in any unit. They are sent in single precision; from doubles far from the origin, a common
    #: point is subtracted first.
    positions: Any
    triangles: Any  #: (F, 3), integers: three vertices each, 0-based, counter-clockwise seen from outside
    seam_edges: Any = None  #: (E, 2): pairs of vertices between which a given seam runs
    #: Corners that face edges at which a given seam runs: corner 3 f + k, the k-th of triangle f, faces the edge
    #: between the other two.
    seam_corners: Any = None
    parts: Any = None  #: (F,), integers: a given seam runs wherever the labels of two triangles differ
    uncut_corners: Any = None  #: corners that face edges at which no seam is added
    #: (F,), integers below F: the polygon that each triangle comes from. A polygon is never cut, so that each of its
    #: corners has one UV: no seam follows its diagonals.
    face_polygon: Any = None
    face_atlas: Any = None  #: (F,), integers from 0 on: the atlas of each triangle; charts end where it changes
    #: (F,), numbers in [0.01, 100]: factor on the texel density. Charts end where it changes; with seams="keep" they do
    #: not, and get the mean of their triangles by area.
    face_weights: Any = None
    options: UnwrapOptions = field(default_factory=UnwrapOptions)
    scheduling: Scheduling = field(default_factory=Scheduling)
    #: For finding the job again. At most 32; keys of a-z, 0-9, "-" and "_", values of at most 256 bytes.
    labels: Mapping[str, str] = field(default_factory=dict)
    #: Makes repeated calls safe: the same id gets the same job. At most 128 characters; empty: a new UUID.
    request_id: str = ""

    def pack(self) -> PackedMesh:
        """Checks the arrays; raises :class:`planish.ArrayError`."""
        return pack_mesh(
            self.positions,
            self.triangles,
            seam_edges=self.seam_edges,
            seam_corners=self.seam_corners,
            parts=self.parts,
            uncut_corners=self.uncut_corners,
            face_polygon=self.face_polygon,
            face_atlas=self.face_atlas,
            face_weights=self.face_weights,
        )


def new_job(
    positions: Any,
    triangles: Any,
    options: Optional[UnwrapOptions],
    scheduling: Optional[Scheduling],
    labels: Optional[Mapping[str, str]],
    request_id: str,
    more: Dict[str, Any],
) -> NewJob:
    """`more`: keyword arguments of the call, from :data:`OF_MESH` and the fields of UnwrapOptions."""
    of_mesh = {key: more.pop(key, None) for key in OF_MESH}
    unknown = sorted(set(more) - _OPTION_NAMES)
    if unknown:
        raise TypeError(f"there is no option {unknown[0]!r}; planish.UnwrapOptions has those that there are")
    return NewJob(
        positions,
        triangles,
        options=dataclasses.replace(options or UnwrapOptions(), **more),
        scheduling=scheduling or Scheduling(),
        labels=labels or {},
        request_id=request_id,
        **of_mesh,
    )


def new_request_id() -> str:
    return str(uuid.uuid4())


def set_arrays(spec: Any, mesh: PackedMesh) -> None:
    """Puts the mesh itself into the spec."""
    spec.arrays.positions = mesh.positions
    spec.arrays.triangles = mesh.triangles


def spec_message(job: NewJob, mesh: Optional[PackedMesh], upload: str = "") -> Any:
    """The JobSpec of a job. `mesh` None: the spec has no mesh. `upload`: the name of the uploaded mesh; empty: the spec
    holds the mesh itself."""
    spec = planish_pb2.JobSpec()
    if mesh is not None:
        if upload:
            spec.upload = upload
        else:
            set_arrays(spec, mesh)
        for name, values in mesh.elements.items():
            setattr(spec.elements, name, values.tobytes())
    _fill_options(job.options, spec.options)
    _fill_scheduling(job.scheduling, spec.scheduling)
    try:
        for key, value in job.labels.items():
            spec.labels[key] = value
    except (TypeError, ValueError, AttributeError) as error:
        raise _invalid(f"labels must be a mapping of str to str: {error}") from error
    return spec


def _invalid(message: str, name: str = "") -> InvalidArgument:
    return InvalidArgument(message, reason="OPTIONS_INVALID", metadata={"field": name} if name else {})


def _fill_options(options: UnwrapOptions, message: Any) -> None:
    for each in dataclasses.fields(UnwrapOptions):
        value = getattr(options, each.name)
        if each.name == "pack":
            message.pack = options_pb2.PACK_ON if value else options_pb2.PACK_OFF
        elif value is not None:
            _set(message, each.name, value)


def _fill_scheduling(scheduling: Scheduling, message: Any) -> None:
    _set(message, "priority", scheduling.priority)
    for name, seconds in (("timeout", scheduling.timeout_seconds), ("compute_budget", scheduling.compute_budget_seconds)):
        if seconds is None:
            continue
        if not 0 < seconds < 3.15e9:
            raise _invalid(f"{name}_seconds is {seconds}; it must be above 0 and below 100 years", f"{name}_seconds")
        getattr(message, name).FromNanoseconds(int(seconds * 1e9))
    message.fresh = bool(scheduling.fresh)


def _set(message: Any, name: str, value: Any) -> None:
    enum = message.DESCRIPTOR.fields_by_name[name].enum_type
    if enum is not None:
        number = enum_number(enum, value) if isinstance(value, str) else None
        if number is None:
            prefix = len(enum.values_by_number[0].name) - len("UNSPECIFIED")
            choices = ", ".join(v.name[prefix:].lower() for v in enum.values if v.number != 0)
            raise _invalid(f"{name} is {value!r}; it must be one of {choices}", name)
        value = number
    elif hasattr(value, "item"):
        value = value.item()  # a numpy number
    try:
        setattr(message, name, value)
    except (TypeError, ValueError) as error:
        raise _invalid(f"{name} is {value!r}: {error}", name) from error
