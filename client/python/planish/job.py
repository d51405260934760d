"""What goes into a job and what comes out, as plain dataclasses.

Enumerations are strings, spelled as the command spells them: ``"auto"``, ``"solve"``; states of jobs are in capitals. A value
that only a newer server knows is ``"unknown"``. Field for field these are the messages of ``planish.v1``.
"""

from __future__ import annotations

import dataclasses
import datetime
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional, Type, TypeVar

#: The states in which a job never changes again, but for SUCCEEDED -> EXPIRED.
TERMINAL_STATES = frozenset({"SUCCEEDED", "FAILED", "CANCELLED", "EXPIRED"})


@dataclass(frozen=True)
class UnwrapOptions:
    """What the caller asks for. Every field may be left out; None stands for the server's default."""

    #: ``"auto"``: the given seams, and as many more as keep the stretch below max_stretch. ``"needed"``: more only where a
    #: piece is no disc or no map keeps its borders. ``"keep"``: the given seams, and slits where a piece with holes has no other map. ``"none"``: the mesh is a disc.
    seams: str = "auto"
    #: What ``"auto"`` cuts for: ``"seams"``, few, short and hidden ones; or ``"texture"``, charts that pack well, more of them.
    prefer: str = "seams"
    #: Largest root mean square stretch of a chart, with ``"auto"``. In [1.001, 100]; None: 1.25, and 1.05 for ``"texture"``.
    max_stretch: Optional[float] = None
    #: Edges whose faces' normals are further apart are given seams. Degrees, in (0, 180]; None: none.
    hard_edge_degrees: Optional[float] = None
    #: False: charts stay as they were solved, at the surface's scale, one over the other.
    pack: bool = True
    #: Texels per side of a tile. In [16, 65536]; None: 1024.
    texture_size: Optional[int] = None
    #: Texels between charts, half as many at the rim. In [0, 64]; None: 2.
    padding: Optional[int] = None
    #: Tiles that each atlas may use, UDIM 1001, 1002, ..., ten in a row. In [1, 100]; None: 1.
    tiles: Optional[int] = None
    #: With `face_atlas`: ``"udim"``, each atlas into tiles of its own, all at one texel density; or ``"stacked"``, all into the same
    #: tiles, as textures of their own, each as large as it fits there.
    atlas_layout: str = "udim"
    #: What packing may cost: ``"fast"`` a quarter of the rest of the unwrap, ``"normal"`` a third; ``"best"``, with more charts,
    #: fifty times the rest, or a minute where that is more.
    effort: str = "normal"
    #: ``"auto"``, ``"uzawa"``, ``"minres"`` or ``"direct"``.
    solver: str = "auto"
    #: ``"auto"``, ``"full"`` or ``"reduced"``.
    system: str = "auto"
    #: ``"auto"``, ``"none"``, ``"jacobi"``, ``"cholesky"`` or ``"amg"``.
    preconditioner: str = "auto"
    #: ``"auto"``, ``"convex"`` or ``"exact"``.
    hessian: str = "auto"
    #: ``"free"``, or ``"convex"``: the outline of each chart is a convex polygon.
    boundary: str = "free"
    #: Type of the UV: ``"float"``, ``"double"``, or ``"auto"``: float unless that flips triangles that double keeps.
    precision: str = "auto"
    #: Radians per angle at which a solve is converged. In (0, 1e-2]; None: 1e-9.
    tolerance: Optional[float] = None
    #: In [1, 1000]; None: 100.
    max_newton_iterations: Optional[int] = None
    #: Threads of the job. In [1, 256], at most what the server allows; None: that many. The UV do not depend on it.
    threads: Optional[int] = None


@dataclass(frozen=True)
class Scheduling:
    """When a job runs, and for how long. Changes what comes out only where a limit is met."""

    #: ``"low"``, ``"normal"`` or ``"high"``: a waiting job counts as 10 minutes younger or older; the oldest is next.
    priority: str = "normal"
    #: From acceptance on: a job that has not ended then fails with DEADLINE_EXCEEDED. None: no limit.
    timeout_seconds: Optional[float] = None
    #: Of running: a job that runs longer is stopped, and delivers the best map it has (warning STOPPED). None: no limit.
    compute_budget_seconds: Optional[float] = None
    #: Compute anew even if the server has the result for this mesh and these options.
    fresh: bool = False


@dataclass(frozen=True)
class Residual:
    """Largest residual of each family of constraints and of the gradient, in radians (wheel: a logarithm)."""

    triangle: float = 0.0
    vertex: float = 0.0
    wheel: float = 0.0
    gradient: float = 0.0


@dataclass(frozen=True)
class Progress:
    """One point of a job's way."""

    #: ``"decode"``, ``"charts"``, ``"solve"``, ``"layout"``, ``"pack"``, ``"verify"`` or ``"encode"``.
    stage: str = "unspecified"
    chart: int = 0  #: 0-based
    chart_count: int = 0
    newton_iteration: int = 0  #: completed
    linear_iterations: int = 0  #: over all Newton steps so far
    linear_residual: float = 0.0  #: relative, of the present linear solve; 0 between solves
    residual: Residual = field(default_factory=Residual)  #: after newton_iteration steps
    energy: float = 0.0
    step_length: float = 0.0  #: fraction of the last Newton step that was taken
    elapsed_seconds: float = 0.0  #: since the worker began
    tolerance: float = 0.0  #: largest residual that ends the solve as converged
    stage_fraction: float = 0.0  #: of the stage that is done, roughly; 0 in stages that do not tell


@dataclass(frozen=True)
class ChartReport:
    """How one chart was flattened."""

    chart: int = 0  #: its number, 0-based
    triangles: int = 0
    method: str = ""
    solver: str = "unspecified"
    system: str = "unspecified"
    preconditioner: str = "unspecified"
    preconditioner_note: str = ""
    hessian: str = "unspecified"
    converged: bool = False
    newton_iterations: int = 0
    linear_iterations: int = 0
    residual: Residual = field(default_factory=Residual)
    stop_message: str = ""
    abf_energy: float = 0.0
    barrier: float = 0.0
    stretch_l2: float = 1.0
    #: The largest residual where Newton's method began, and after each of its steps; older servers do not tell.
    newton_residuals: List[float] = field(default_factory=list)


@dataclass(frozen=True)
class ChartTotals:
    """Over all charts of a job."""

    charts: int = 0
    not_converged: int = 0
    newton_iterations: int = 0
    linear_iterations: int = 0
    residual: Residual = field(default_factory=Residual)
    stretch_l2_max: float = 1.0
    #: The largest of any chart after so many Newton steps; a chart that needed fewer counts with its last.
    newton_residuals: List[float] = field(default_factory=list)


@dataclass(frozen=True)
class AtlasPart:
    """One of several atlases."""

    atlas: int = 0  #: its number in `face_atlas`
    triangles: int = 0
    charts: int = 0  #: 0 where its triangles are without area
    first_tile: int = 0  #: 0 is UDIM 1001
    tiles: int = 1  #: from first_tile to the last that is used
    texels_per_unit: float = 0.0  #: of length on the surface, at weight 1
    packing_efficiency: float = 0.0  #: area of the triangles over that of the tiles


@dataclass(frozen=True)
class AtlasReport:
    """Where the charts went, in texels of the texture that was asked for."""

    pack: str = "on"  #: or "off"
    texture_size: int = 0
    padding: int = 0
    tiles: int = 1  #: up to the last that is used
    #: Of length on the surface, at weight 1, the least of all atlases; 0 without packing.
    texels_per_unit: float = 0.0
    effort: str = "normal"
    layout: str = "udim"
    atlases: List[AtlasPart] = field(default_factory=list)  #: with `face_atlas`: one for each number, 1024 at most
    padding_kept: float = 0.0  #: texels that are free between charts: `padding`, or less where there was no room


@dataclass(frozen=True)
class Quality:
    """Measured on the delivered UV with exact predicates."""

    flipped: int = 0
    degenerate: int = 0
    overlapping: int = 0  #: pairs of UV triangles whose interiors meet
    angle_error_mean_deg: float = 0.0
    angle_error_max_deg: float = 0.0
    abf_energy: float = 0.0
    conformal_distortion_mean: float = 1.0
    conformal_distortion_max: float = 1.0
    stretch_l2: float = 1.0
    packing_efficiency: float = 0.0
    seam_length: float = 0.0  #: on the surface, over the square root of its area
    visible_seam_length: float = 0.0  #: the same, each edge weighted by how much of its surroundings is open, 0 to 1
    seam_turn_deg: float = 0.0  #: mean angle by which seams turn from edge to edge; 0: straight
    seam_symmetry: Optional[float] = None  #: share of the seams whose mirror image is a seam; None without mirror plane


@dataclass(frozen=True)
class StageSeconds:
    """Wall-clock seconds: upload (check, send, accept), download and total as this client saw them, the rest as the server did."""

    upload: float = 0.0
    queue: float = 0.0
    decode: float = 0.0
    charts: float = 0.0
    solve: float = 0.0
    layout: float = 0.0
    pack: float = 0.0
    verify: float = 0.0
    encode: float = 0.0
    download: float = 0.0
    total: float = 0.0


@dataclass(frozen=True)
class JobWarning:
    """A promise that was not kept, or something that the caller should know; reasons as in ``planish.v1.Warning``."""

    reason: str = ""
    message: str = ""
    metadata: Dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """What became of the mesh."""

    triangles: int = 0
    vertices: int = 0
    #: One for each chart, ascending; of more than 1024 those that did not converge, then those of the largest stretch.
    charts: List[ChartReport] = field(default_factory=list)
    chart_totals: ChartTotals = field(default_factory=ChartTotals)
    atlas: AtlasReport = field(default_factory=AtlasReport)
    quality: Quality = field(default_factory=Quality)
    seconds: StageSeconds = field(default_factory=StageSeconds)
    peak_memory_bytes: int = 0
    threads: int = 0  #: that the job could use
    warnings: List[JobWarning] = field(default_factory=list)


@dataclass(frozen=True)
class JobError:
    """Why a job failed, as data; :class:`planish.Error` is the same thing raised."""

    code: str = ""
    reason: str = ""
    message: str = ""
    metadata: Dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Job:
    """A job, as the server tells of it."""

    name: str = ""  #: "jobs/..."
    #: ``"QUEUED"``, ``"RUNNING"``, ``"STOPPING"``, ``"SUCCEEDED"``, ``"FAILED"``, ``"CANCELLED"`` or ``"EXPIRED"``.
    state: str = "UNSPECIFIED"
    labels: Dict[str, str] = field(default_factory=dict)
    create_time: Optional[datetime.datetime] = None
    start_time: Optional[datetime.datetime] = None
    end_time: Optional[datetime.datetime] = None
    expire_time: Optional[datetime.datetime] = None  #: when SUCCEEDED: its UV are dropped then at the latest
    mesh_bytes: int = 0
    queue_position: int = 0  #: jobs ahead while QUEUED
    progress: Optional[Progress] = None  #: while RUNNING or STOPPING
    error: Optional[JobError] = None  #: when FAILED
    report: Optional[Report] = None  #: when SUCCEEDED
    attempts: int = 0  #: times that a worker began with it
    stop_requested: bool = False
    cancel_requested: bool = False
    result_of: str = ""  #: the job whose work it shares; empty: its own
    memory_bytes: int = 0  #: reserved while it runs
    tenant: str = ""

    @property
    def is_terminal(self) -> bool:
        """Whether the job has ended."""
        return self.state in TERMINAL_STATES


@dataclass(frozen=True)
class Event:
    """Something that happened to a job: exactly one of ``job`` (after a change of state) and ``progress`` is set."""

    sequence: int = 0  #: 1, 2, 3, ... within a job; jumps where events were lost or the server was restarted
    time: Optional[datetime.datetime] = None
    job: Optional[Job] = None
    progress: Optional[Progress] = None


@dataclass(frozen=True)
class JobEstimate:
    """What a job would need, before it is created."""

    triangles: int = 0
    vertices: int = 0
    memory_bytes: int = 0  #: reserved while it runs
    run_time_seconds: float = 0.0  #: on one idle core, roughly
    queue_time_seconds: float = 0.0  #: until a job created now would start, roughly
    refusal: Optional[JobError] = None  #: what creating it now would be refused with


@dataclass(frozen=True)
class Capabilities:
    """What a server can do."""

    version: str = ""
    max_mesh_bytes: int = 0
    workers: int = 0
    queue_capacity: int = 0
    threads: int = 0  #: that a job may use at most
    max_triangles: int = 0
    memory_bytes: int = 0  #: that running jobs may reserve together
    upload_chunk_bytes: int = 0  #: of one piece of an upload
    inline_mesh_bytes: int = 0  #: meshes larger than this are better uploaded in pieces
    reattach_grace_seconds: float = 0.0  #: that the job of a caller that went away waits for it to come back
    durable: bool = False  #: jobs, meshes and results outlive a restart of the server
    isolated_workers: bool = False  #: jobs run in processes of their own


# From messages to these classes -----------------------------------------------------------------------------------------

_T = TypeVar("_T")

_NESTED: Dict[str, Type[Any]] = {
    "planish.v1.Residual": Residual,
    "planish.v1.Progress": Progress,
    "planish.v1.ChartReport": ChartReport,
    "planish.v1.ChartTotals": ChartTotals,
    "planish.v1.Atlas": AtlasReport,
    "planish.v1.AtlasPart": AtlasPart,
    "planish.v1.Quality": Quality,
    "planish.v1.StageTimes": StageSeconds,
    "planish.v1.Warning": JobWarning,
    "planish.v1.Report": Report,
    "planish.v1.Job": Job,
}


def enum_name(descriptor: Any, number: int) -> str:
    """``"solve"`` for STAGE_SOLVE; states of jobs stay in capitals."""
    value = descriptor.values_by_number.get(number)
    if value is None:
        return "unknown"
    prefix = descriptor.values_by_number[0].name[: -len("UNSPECIFIED")]
    name = str(value.name)[len(prefix) :]
    return name if descriptor.name == "JobState" else name.lower()


def enum_number(descriptor: Any, name: str) -> Optional[int]:
    """The reverse of :func:`enum_name`; None for a name that is none."""
    prefix = descriptor.values_by_number[0].name[: -len("UNSPECIFIED")]
    value = descriptor.values_by_name.get(prefix + name.upper())
    return None if value is None or value.number == 0 else int(value.number)


def from_proto(cls: Type[_T], message: Any) -> _T:
    """The dataclass of a message: fields of the same name; ``x_seconds`` of a duration ``x``."""
    if cls is Report:
        return _report(message)  # type: ignore[return-value]
    known = message.DESCRIPTOR.fields_by_name
    values: Dict[str, Any] = {}
    for each in dataclasses.fields(cls):
        name = each.name
        if name not in known and name.endswith("_seconds"):
            name = name[: -len("_seconds")]
        if name in known:
            values[each.name] = _value(message, known[name])
    return cls(**values)


def _value(message: Any, descriptor: Any) -> Any:
    value = getattr(message, descriptor.name)
    if hasattr(value, "items"):
        return dict(value)
    if hasattr(value, "MergeFrom") and hasattr(value, "__len__"):  # repeated
        if descriptor.message_type is None:
            return list(value)
        return [from_proto(_NESTED[descriptor.message_type.full_name], each) for each in value]
    if descriptor.enum_type is not None:
        return enum_name(descriptor.enum_type, value)
    if descriptor.message_type is None:
        # An optional field that is not set.
        return value if descriptor.containing_oneof is None or message.HasField(descriptor.name) else None
    name = descriptor.message_type.full_name
    if name == "google.protobuf.Duration":
        return value.seconds + 1e-9 * value.nanos
    is_set = message.HasField(descriptor.name)
    if name == "google.protobuf.Timestamp":
        return value.ToDatetime().replace(tzinfo=datetime.timezone.utc) if is_set else None
    if name == "planish.rpc.Status":
        return _job_error(value) if is_set else None
    cls = _NESTED[name]
    return from_proto(cls, value) if is_set or cls not in (Progress, Report, Job) else None


def _job_error(status: Any) -> JobError:
    from ._status import error_of_status  # that module needs ours

    error = error_of_status(status)
    return JobError(error.code, error.reason, error.message, error.metadata)


def _report(message: Any) -> Report:
    return Report(
        triangles=message.input.triangles,
        vertices=message.input.vertices,
        charts=[from_proto(ChartReport, chart) for chart in message.charts],
        chart_totals=from_proto(ChartTotals, message.chart_totals),
        atlas=from_proto(AtlasReport, message.atlas),
        quality=from_proto(Quality, message.quality),
        seconds=from_proto(StageSeconds, message.times),
        peak_memory_bytes=message.peak_memory_bytes,
        threads=message.threads,
        warnings=[from_proto(JobWarning, warning) for warning in message.warnings],
    )
