"""The exceptions of this package: one class for each code of gRPC, all of them an :class:`Error`."""

from __future__ import annotations

import re
from typing import Any, Dict, List, Mapping, Optional, Tuple, Type

_MOST_NAMED = 4  # of a kind, in str(error)


class Error(Exception):
    """A call that failed, or a job that was waited for and did not succeed. ``str(error)`` is a sentence for people, with
    the first few of the elements at fault; ``error.message`` is the sentence alone.

    ``reason`` is for programs: a reason of ``planish.v1.Job.error`` or of a call, or one of this package's own:

    ================================  ==================================================================
    ``SERVER_UNREACHABLE``            no connection (:class:`Unavailable`)
    ``TLS_FAILED``                    no connection, because of a certificate, or one side speaks TLS alone
                                      (:class:`Unavailable`)
    ``CONNECTION_LOST``               the connection broke and re-attaching failed (:class:`Unavailable`)
    ``COMMAND_MISSING``               the command ``planish`` was not found (:class:`Unavailable`)
    ``PRIVATE_SERVER_FAILED``         ``planishd`` was not found or did not start (:class:`Unavailable`)
    ``DEADLINE_EXCEEDED``             the ``timeout`` of the call passed (:class:`DeadlineExceeded`)
    ``CANCELLED``                     by the caller, or by somebody else on the server (:class:`Cancelled`)
    ``MESH_MISMATCH``                 the job was made from other arrays (:class:`FailedPrecondition`)
    ``UV_CORRUPT``                    the UV are not those that the server made (:class:`DataLoss`)
    ``OPTIONS_INVALID``               options that cannot be, or name files that cannot be used (:class:`InvalidArgument`)
    ================================  ==================================================================
    """

    code = "UNKNOWN"

    def __init__(
        self,
        message: str,
        *,
        reason: str = "",
        metadata: Optional[Mapping[str, str]] = None,
        job: str = "",
        trace_id: str = "",
        retry_after_seconds: float = 0.0,
    ) -> None:
        super().__init__(message)
        self.message = message
        #: For programs, e.g. ``"QUEUE_FULL"``; the code where nobody gave a reason.
        self.reason = reason or self.code
        #: Further facts, e.g. ``{"faces": "12,40"}``; ids are 0-based, of the arrays that were given.
        self.metadata: Dict[str, str] = dict(metadata or {})
        #: Name of the job that failed; empty if the call was refused before there was one.
        self.job = job
        #: Of the trace that the call belonged to, 32 hex digits, as in the server's log; may be empty.
        self.trace_id = trace_id
        #: What the server asks to wait before the call is made again; 0 if it does not say.
        self.retry_after_seconds = retry_after_seconds

    @property
    def faces(self) -> List[int]:
        """Ids of the triangles that the error is about: the first few, where there are many."""
        return self._ids("face", "faces")

    @property
    def vertices(self) -> List[int]:
        """Ids of the vertices that the error is about, likewise."""
        return self._ids("vertex", "vertices")

    @property
    def edges(self) -> List[Tuple[int, int]]:
        """The edges that the error is about, as pairs of vertices, likewise."""
        pairs = re.findall(r"(\d+)-(\d+)", ",".join(self.metadata.get(key, "") for key in ("edge", "edges")))
        return [(int(a), int(b)) for a, b in pairs]

    def _ids(self, *keys: str) -> List[int]:
        return [int(digits) for key in keys for digits in re.findall(r"\d+", self.metadata.get(key, ""))]

    def __str__(self) -> str:
        edges = [f"{a}-{b}" for a, b in self.edges]
        kinds = (("face", "faces", self.faces), ("edge", "edges", edges), ("vertex", "vertices", self.vertices))
        places = [
            (one if len(ids) == 1 else many) + " " + ", ".join(map(str, ids[:_MOST_NAMED])) + (", ..." if len(ids) > _MOST_NAMED else "")
            for one, many, ids in kinds
            if ids
        ]
        return f"{self.message} ({'; '.join(places)})" if places else self.message

    def __reduce__(self) -> Tuple[Any, ...]:
        # Exceptions travel between the processes of a pool.
        return _rebuild, (type(self), self.message, self._state())

    def _state(self) -> Dict[str, Any]:
        return {
            "reason": self.reason,
            "metadata": self.metadata,
            "job": self.job,
            "trace_id": self.trace_id,
            "retry_after_seconds": self.retry_after_seconds,
        }


def _rebuild(kind: Type[Error], message: str, state: Dict[str, Any]) -> Error:
    return kind(message, **state)


class Cancelled(Error):
    """The job or the call was cancelled."""

    code = "CANCELLED"


class InvalidArgument(Error, ValueError):
    """Something that was given is wrong: a mesh, an option, a request. Trying again does not help."""

    code = "INVALID_ARGUMENT"


class ArrayError(InvalidArgument):
    """An array was refused before anything was sent. ``argument`` is the name of the parameter, as in the message."""

    def __init__(self, message: str, *, argument: str = "", **state: Any) -> None:
        super().__init__(message, **state)
        self.argument = argument

    def _state(self) -> Dict[str, Any]:
        return {**super()._state(), "argument": self.argument}


class DeadlineExceeded(Error):
    """The time that was given to the call or to the job passed."""

    code = "DEADLINE_EXCEEDED"


class NotFound(Error):
    """There is no such job, or its UV are gone (``RESULT_EXPIRED``)."""

    code = "NOT_FOUND"


class AlreadyExists(Error):
    """The ``request_id`` belongs to a job of another mesh or of other options."""

    code = "ALREADY_EXISTS"


class PermissionDenied(Error):
    """The token lacks the right that the call takes."""

    code = "PERMISSION_DENIED"


class ResourceExhausted(Error):
    """The mesh is too large for this server, or its queue or store stayed full for too long."""

    code = "RESOURCE_EXHAUSTED"


class FailedPrecondition(Error):
    """The call does not go with the state that the job is in."""

    code = "FAILED_PRECONDITION"


class Aborted(Error):
    """Another call was in the way; the same call may succeed in a moment."""

    code = "ABORTED"


class OutOfRange(Error):
    """An offset is beyond the end."""

    code = "OUT_OF_RANGE"


class Unimplemented(Error):
    """The server is older than what it was asked for."""

    code = "UNIMPLEMENTED"


class Internal(Error):
    """A defect of the server, or of the connection to it."""

    code = "INTERNAL"


class Unavailable(Error):
    """No server answers, or it is shutting down."""

    code = "UNAVAILABLE"


class DataLoss(Error):
    """What arrived is not what was sent."""

    code = "DATA_LOSS"


class Unauthenticated(Error):
    """No token, an unknown one, or one whose time is over."""

    code = "UNAUTHENTICATED"


# By the number of google.rpc.Code.
_CLASSES: Dict[int, Type[Error]] = {
    1: Cancelled,
    2: Error,
    3: InvalidArgument,
    4: DeadlineExceeded,
    5: NotFound,
    6: AlreadyExists,
    7: PermissionDenied,
    8: ResourceExhausted,
    9: FailedPrecondition,
    10: Aborted,
    11: OutOfRange,
    12: Unimplemented,
    13: Internal,
    14: Unavailable,
    15: DataLoss,
    16: Unauthenticated,
}


def class_of(code: int) -> Type[Error]:
    """The exception for a number of google.rpc.Code."""
    return _CLASSES.get(code, Error)
