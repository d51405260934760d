"""The exceptions of this package: one class for each code of gRPC, all of them an :class:`Error`."""

from __future__ import annotations

import re
from typing import Any, Dict, List, Mapping, Optional, Tuple, Type

_MOST_NAMED = 4  # ids of each kind that str(error) names


class Error(Exception):
    """A failed call, or a job that did not succeed. ``str(error)`` is a sentence for people, with
    the first few elements at fault; ``error.message`` is only the sentence.

    ``reason`` is for programs: a reason of ``planish.v1.Job.error`` or of a call, or one of this package:

    ================================  ==================================================================
    ``SERVER_UNREACHABLE``            no connection (:class:`Unavailable`)
    ``TLS_FAILED``                    no connection, because of a certificate, or because only one side uses TLS
                                      (:class:`Unavailable`)
    ``CONNECTION_LOST``               the connection broke and re-attaching failed (:class:`Unavailable`)
    ``COMMAND_MISSING``               the command ``planish`` was not found (:class:`Unavailable`)
    ``PRIVATE_SERVER_FAILED``         ``planishd`` was not found or did not start (:class:`Unavailable`)
    ``DEADLINE_EXCEEDED``             the ``timeout`` of the call passed (:class:`DeadlineExceeded`)
    ``CANCELLED``                     by the caller, or by somebody else on the server (:class:`Cancelled`)
    ``MESH_MISMATCH``                 the job was created with other arrays (:class:`FailedPrecondition`)
    ``UV_CORRUPT``                    the UV are not those that the server made (:class:`DataLoss`)
    ``OPTIONS_INVALID``               invalid options, or files that cannot be used
                                      (:class:`InvalidArgument`)
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
        #: For programs, e.g. ``"QUEUE_FULL"``; the code if there is no reason.
        self.reason = reason or self.code
        #: Details, e.g. ``{"faces": "12,40"}``; ids are 0-based, in the caller's arrays.
        self.metadata: Dict[str, str] = dict(metadata or {})
        #: Name of the job that failed; empty if the call was refused without a job.
        self.job = job
        #: The id of the call's trace, 32 hex digits, as in the server's log; may be empty.
        self.trace_id = trace_id
        #: How long the server asks to wait before a retry; 0 if it does not say.
        self.retry_after_seconds = retry_after_seconds

    @property
    def faces(self) -> List[int]:
        """Ids of the triangles at fault; only the first few if there are many."""
        return self._ids("face", "faces")

    @property
    def vertices(self) -> List[int]:
        """Ids of the vertices at fault; only the first few if there are many."""
        return self._ids("vertex", "vertices")

    @property
    def edges(self) -> List[Tuple[int, int]]:
        """The edges at fault, as pairs of vertices; only the first few if there are many."""
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
        # Exceptions are pickled between the processes of a pool.
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
    """A mesh, an option or a request is wrong. Retrying does not help."""

    code = "INVALID_ARGUMENT"


class ArrayError(InvalidArgument):
    """An array was refused before anything was sent. ``argument`` is the name of the parameter, as in the message."""

    def __init__(self, message: str, *, argument: str = "", **state: Any) -> None:
        super().__init__(message, **state)
        self.argument = argument

    def _state(self) -> Dict[str, Any]:
        return {**super()._state(), "argument": self.argument}


class DeadlineExceeded(Error):
    """The time limit of the call or of the job passed."""

    code = "DEADLINE_EXCEEDED"


class NotFound(Error):
    """There is no such job, or its UV are gone (``RESULT_EXPIRED``)."""

    code = "NOT_FOUND"


class AlreadyExists(Error):
    """The ``request_id`` belongs to a job of another mesh or of other options."""

    code = "ALREADY_EXISTS"


class PermissionDenied(Error):
    """The token lacks the right that the call needs."""

    code = "PERMISSION_DENIED"


class ResourceExhausted(Error):
    """The mesh is too large for this server, or its queue or store stayed full for too long."""

    code = "RESOURCE_EXHAUSTED"


class FailedPrecondition(Error):
    """The job's state does not allow the call."""

    code = "FAILED_PRECONDITION"


class Aborted(Error):
    """Conflicts with another call; a retry may succeed."""

    code = "ABORTED"


class OutOfRange(Error):
    """An offset is beyond the end."""

    code = "OUT_OF_RANGE"


class Unimplemented(Error):
    """The server is too old for this request."""

    code = "UNIMPLEMENTED"


class Internal(Error):
    """A defect of the server, or of the connection to it."""

    code = "INTERNAL"


class Unavailable(Error):
    """No server answers, or it is shutting down."""

    code = "UNAVAILABLE"


class DataLoss(Error):
    """The received data is damaged."""

    code = "DATA_LOSS"


class Unauthenticated(Error):
    """No token, an unknown one, or an expired one."""

    code = "UNAUTHENTICATED"


# The classes by the number of google.rpc.Code.
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
