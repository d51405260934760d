"""Inputs and outputs of jobs, as plain dataclasses.

Enumerations are strings, spelled as the command spells them: ``"auto"``, ``"solve"``; states of jobs are in capitals. A
value that only a newer server knows is ``"unknown"``. Field for field these are the messages of ``planish.v1``; the
build makes the classes of options and reports from these messages.
"""

from __future__ import annotations

import dataclasses
import datetime
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional, Type, TypeVar

from ._job_fields import (
    AtlasPart,
    AtlasReport,
    BoundaryReport,
    ChartReport,
    ChartTotals,
    Progress,
    Quality,
    ReportFields,
    Residual,
    StageTimes,
    UnwrapOptions,
)

__all__ = [
    "AtlasPart", "AtlasReport", "BoundaryReport", "Capabilities", "ChartReport", "ChartTotals", "Event", "Job", "JobError",
    "JobEstimate", "JobWarning", "Progress", "Quality", "Report", "Residual", "Scheduling", "StageSeconds", "UnwrapOptions",
]  # fmt: skip

#: The states in which a job never changes again, but for SUCCEEDED -> EXPIRED.
TERMINAL_STATES = frozenset({"SUCCEEDED", "FAILED", "CANCELLED", "EXPIRED"})


@dataclass(frozen=True)
class Scheduling:
    """When a job runs, and for how long. Changes the result only if a limit is reached."""

    #: ``"low"``, ``"normal"`` or ``"high"``: a waiting job counts as 10 minutes younger or older; the oldest is next.
    priority: str = "normal"
    #: Counted from acceptance: a job that has not ended by then fails with DEADLINE_EXCEEDED. None: no limit.
    timeout_seconds: Optional[float] = None
    #: A job that runs longer is stopped, and delivers its best map so far (warning STOPPED). None: no limit.
    compute_budget_seconds: Optional[float] = None
    #: Compute again even if the server has the result for this mesh and these options.
    fresh: bool = False


@dataclass(frozen=True)
class StageSeconds(StageTimes):
    """Wall-clock seconds. The server measured the stages, and this client the rest."""

    upload: float = 0.0  #: check, send, accept
    download: float = 0.0
    total: float = 0.0


@dataclass(frozen=True)
class JobWarning:
    """A promise that was not kept, or something that the caller should know; for reasons see ``planish.v1.Warning``."""

    reason: str = ""
    message: str = ""
    metadata: Dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Report(ReportFields):
    """What the server reports of a job that SUCCEEDED."""

    triangles: int = 0
    vertices: int = 0
    seconds: StageSeconds = field(default_factory=StageSeconds)
    warnings: List[JobWarning] = field(default_factory=list)


@dataclass(frozen=True)
class JobError:
    """Why a job failed, as data; :class:`planish.Error` is the same as an exception."""

    code: str = ""
    reason: str = ""
    message: str = ""
    metadata: Dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Job:
    """A job, as the server reports it."""

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
    attempts: int = 0  #: how many times a worker began to run it
    stop_requested: bool = False
    cancel_requested: bool = False
    result_of: str = ""  #: the job whose result it shares; or empty
    memory_bytes: int = 0  #: reserved while it runs
    tenant: str = ""

    @property
    def is_terminal(self) -> bool:
        """Whether the job has ended."""
        return self.state in TERMINAL_STATES


@dataclass(frozen=True)
class Event:
    """A change of a job: either ``job`` (after a change of state) or ``progress`` is set."""

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
    refusal: Optional[JobError] = None  #: the error with which the server would refuse the job now; or None


@dataclass(frozen=True)
class Capabilities:
    """What a server can do."""

    version: str = ""
    max_mesh_bytes: int = 0
    workers: int = 0
    queue_capacity: int = 0
    threads: int = 0  #: the most that a job may use
    max_triangles: int = 0
    memory_bytes: int = 0  #: the most that running jobs may reserve together
    upload_chunk_bytes: int = 0  #: size of one piece of an upload
    inline_mesh_bytes: int = 0  #: meshes larger than this are better uploaded in pieces
    reattach_grace_seconds: float = 0.0  #: how long the job of a caller that went away waits for its return
    durable: bool = False  #: jobs, meshes and results outlive a restart of the server
    isolated_workers: bool = False  #: jobs run in processes of their own


# From messages to these classes -----------------------------------------------------------------------------------------

_T = TypeVar("_T")

_NESTED: Dict[str, Type[Any]] = {
    "planish.v1.Residual": Residual,
    "planish.v1.Progress": Progress,
    "planish.v1.BoundaryReport": BoundaryReport,
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
    """The reverse of :func:`enum_name`; None for unknown names."""
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
        # None for an optional field that is not set.
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
    from ._status import error_of_status  # imports gRPC, which nothing else here needs

    error = error_of_status(status)
    return JobError(error.code, error.reason, error.message, error.metadata)


def _report(message: Any) -> Report:
    return Report(
        **{each.name: _value(message, message.DESCRIPTOR.fields_by_name[each.name]) for each in dataclasses.fields(ReportFields)},
        triangles=message.input.triangles,
        vertices=message.input.vertices,
        seconds=from_proto(StageSeconds, message.times),
        warnings=[from_proto(JobWarning, warning) for warning in message.warnings],
    )
