"""Follows one job from its stream's first event to the last byte of its UV, reconnecting as needed."""

from __future__ import annotations

import dataclasses
import threading
import time
from dataclasses import dataclass
from typing import Any, Callable, Optional

from . import errors
from ._calls import Calls, Trace, error_of_job
from ._request import NewJob, new_request_id, set_arrays, spec_message
from ._retry import Deadline, is_broken
from ._transport import Stream
from .errors import Error
from .job import Event, Job, Progress, from_proto
from .mesh import PackedMesh
from .result import Result, parse_uv
from .v1 import job_pb2, planish_pb2

#: How many times a job is submitted again after it was lost with its stream.
_MOST_LOST_JOBS = 3
_TERMINAL = frozenset(
    {
        job_pb2.JOB_STATE_SUCCEEDED,
        job_pb2.JOB_STATE_FAILED,
        job_pb2.JOB_STATE_CANCELLED,
        job_pb2.JOB_STATE_EXPIRED,
    }
)


@dataclass(frozen=True)
class Callbacks:
    """Functions that a call runs one at a time, on its thread or in its event loop. They should return quickly. An
    exception of a callback ends the call, cancels an attached job, and comes out of the call."""

    #: Called for every progress message.
    on_progress: Optional[Callable[[Progress], None]] = None
    #: Called for every event, in order. If both connection and job are lost, events start again at 1 with the name of a
    #: new job.
    on_event: Optional[Callable[[Event], None]] = None
    #: Called when the connection broke or the server is full, with the error and the seconds waited before the next
    #: attempt.
    on_retry: Optional[Callable[[Error, float], None]] = None


class Control:
    """Lets other threads cancel or stop a running unwrap."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._job = ""
        self.cancelled = threading.Event()
        self.stopped = threading.Event()

    @property
    def job(self) -> str:
        with self._lock:
            return self._job

    @job.setter
    def job(self, name: str) -> None:
        with self._lock:
            self._job = name

    def cancel(self) -> str:
        """Requests the cancellation. Returns the job to cancel on the server; empty if there is no job yet: the call
        itself cancels the job once it exists."""
        with self._lock:
            self.cancelled.set()
            return self._job

    def stop(self) -> str:
        """As :meth:`cancel`, for stopping the job."""
        with self._lock:
            self.stopped.set()
            return self._job


class Follower:
    """Follows the job of one call. Use once."""

    def __init__(
        self,
        calls: Calls,
        trace: Trace,
        deadline: Deadline,
        callbacks: Callbacks,
        *,
        unwrap: Any = None,
        mesh: Optional[PackedMesh] = None,
        watch: str = "",
        after_sequence: int = 0,
        wants_uv: bool = True,
        control: Optional[Control] = None,
    ) -> None:
        self._calls = calls
        self._trace = trace
        self._deadline = deadline
        self._callbacks = callbacks
        self._unwrap = unwrap  # an UnwrapRequest, or None: `watch` is the name of an existing job
        self._mesh = mesh  # the mesh of `unwrap`
        self._wants_uv = wants_uv
        self._control = control or Control()
        self._patience = calls.patience_for_new_job(deadline)
        self._name = watch
        self._sequence = after_sequence
        self._lost_stream = False  # a stream of the current job broke
        self._lost_jobs = 0
        self._abandons = False  # a callback raised
        self._sent = False  # the server may have `unwrap`
        self.job: Any = job_pb2.Job()
        self.uv = bytearray()
        self.first_event: Optional[float] = None
        self.last_event: Optional[float] = None

    async def run(self) -> None:
        """Returns when the job has ended, in any state, with its UV if it succeeded and they are wanted."""
        try:
            while not self._is_complete():
                await self._run_one_stream()
        except BaseException as error:
            is_own = isinstance(error, Error) and not self._abandons
            if is_own and not error.job:  # type: ignore[attr-defined]
                error.job = self._name  # type: ignore[attr-defined]
            if not is_own and self._unwrap is not None and not self._unwrap.detached:
                # Ctrl-C, a cancelled task, or an exception of a callback.
                await self._calls.cancel_while_leaving(self._name, self._unwrap if self._sent else None)
            raise

    def _is_complete(self) -> bool:
        if self.job.state not in _TERMINAL:
            return False
        if not self._wants_uv or self.job.state != job_pb2.JOB_STATE_SUCCEEDED:
            return True
        return bool(len(self.uv) >= self.job.uv.total_bytes)

    async def _run_one_stream(self) -> None:
        if self._control.cancelled.is_set() and (self._unwrap is None or not self._name):
            raise self._cancelled()
        stream = self._open()
        try:
            if self._lost_stream and self._name:
                await self._repeat_wishes()  # requests may have been lost with the connection
            while True:
                try:
                    message = await stream.read()
                except Error as error:
                    await self._on_stream_error(error)
                    return
                if message is None:
                    break
                self._patience.succeeded()
                if message.HasField("event"):
                    await self._take_event(message.event)
                else:
                    self._take_uv(message.uv)
        finally:
            stream.cancel()  # no effect on a stream that has ended
        await self._on_stream_end()

    def _open(self) -> Stream:
        transport, left = self._calls.transport, self._deadline.left()
        if self._unwrap is not None and not self._name:
            self._sent = True
            return transport.stream("Unwrap", self._unwrap, left, self._calls.metadata(self._trace))
        request = planish_pb2.WatchJobRequest(
            name=self._name,
            after_sequence=self._sequence,
            include_uv=self._wants_uv,
            uv_offset=len(self.uv),
            attach=self._unwrap is not None and not self._unwrap.detached,
        )
        return transport.stream("WatchJob", request, left, self._calls.metadata(self._trace))

    async def _take_event(self, event: Any) -> None:
        if event.sequence <= self._sequence:
            return  # received before the connection broke
        self._sequence = event.sequence
        now = time.monotonic()
        if self.first_event is None:
            self.first_event = now
        if event.HasField("job"):
            self.job = event.job
            if event.job.state in _TERMINAL:
                self.last_event = now
            await self._learn_name(event.job.name)
        if self._callbacks.on_event is not None:
            self._call_back(self._callbacks.on_event, from_proto(Event, event))
        if self._callbacks.on_progress is not None and event.HasField("progress"):
            self._call_back(self._callbacks.on_progress, from_proto(Progress, event.progress))

    async def _learn_name(self, name: str) -> None:
        if self._name:
            return
        self._name = name
        self._control.job = name
        await self._repeat_wishes()  # requests made before the job existed

    async def _repeat_wishes(self) -> None:
        if self._control.cancelled.is_set():
            await self._calls.cancel_job(self._name)
        elif self._control.stopped.is_set():
            await self._calls.stop_job(self._name)

    def _take_uv(self, chunk: Any) -> None:
        have = len(self.uv)
        if chunk.offset > have:
            raise errors.DataLoss(
                f"the server skipped from byte {have} of the UV to {chunk.offset}", reason="UV_CORRUPT"
            )
        self.uv += chunk.data[have - chunk.offset :]

    def _call_back(self, function: Callable[..., None], *arguments: Any) -> None:
        try:
            function(*arguments)
        except BaseException:
            self._abandons = True
            raise

    async def _on_stream_error(self, error: Error) -> None:
        if self._control.cancelled.is_set() and (self._unwrap is None or not self._name):
            raise self._cancelled()
        is_new = self._unwrap is not None and not self._name
        if is_new and error.reason == "DRAINING" and not self._lost_stream:
            raise error  # a draining server will not accept jobs again soon
        if is_new and error.reason == "UPLOAD_NOT_FOUND" and self._unwrap.spec.upload:
            self._start_anew()  # the server has lost the upload
            return
        if isinstance(error, errors.NotFound) and self._unwrap is not None and self._lost_stream and self._name:
            self._start_anew()  # the server has lost the job or its UV
            return
        self._lost_stream = self._lost_stream or is_broken(error)
        if not is_new and not is_broken(error):
            raise error
        await self._pause(error)

    async def _pause(self, error: Error) -> None:
        seconds = await self._calls.pause(error, self._patience, self._control.cancelled)
        if self._callbacks.on_retry is not None:
            self._call_back(self._callbacks.on_retry, error, seconds)

    async def _on_stream_end(self) -> None:
        if not self._is_complete():
            gone = errors.Unavailable("the stream ended before the job did", reason="CONNECTION_LOST")
            await self._on_stream_error(gone)
            return
        if self._unwrap is None:
            return
        if self.job.state == job_pb2.JOB_STATE_CANCELLED and self._lost_stream and not self._control.cancelled.is_set():
            self._start_anew()  # the server noticed the loss of the stream and cancelled its job
        elif self.job.state == job_pb2.JOB_STATE_FAILED and self._lost_jobs < _MOST_LOST_JOBS:
            if error_of_job(self.job).reason == "MESH_LOST":
                self._start_anew()  # the server's store has lost the mesh, so it is sent again

    def _start_anew(self) -> None:
        self._lost_jobs += 1
        if self._lost_jobs > _MOST_LOST_JOBS:
            raise errors.Unavailable(
                f"the connection to the planish server at {self._calls.transport.connection.target} keeps breaking, "
                "and the job with it",
                reason="CONNECTION_LOST",
            )
        self._name, self._sequence, self._lost_stream = "", 0, False
        self._control.job = ""
        self.job, self.uv = job_pb2.Job(), bytearray()
        self._unwrap.request_id = new_request_id()  # the old id belongs to the lost job
        if self._mesh is not None:
            set_arrays(self._unwrap.spec, self._mesh)  # the upload may be lost with the job

    def _cancelled(self) -> Error:
        if self._unwrap is None:
            return errors.Cancelled("stopped watching; the job goes on")
        return errors.Cancelled("cancelled before the server had accepted the job")


async def unwrap(
    calls: Calls,
    job: NewJob,
    callbacks: Callbacks,
    *,
    detached: bool,
    timeout: Optional[float],
    traceparent: str,
    control: Optional[Control] = None,
) -> Result:
    """Flattens a mesh in one call and returns its UV."""
    start = time.monotonic()
    trace, deadline = Trace(traceparent), Deadline(timeout)
    mesh = job.pack()
    try:
        upload = await calls.send_ahead(mesh, trace, deadline)
        request = planish_pb2.UnwrapRequest(
            spec=spec_message(job, mesh, upload), request_id=job.request_id or new_request_id(), detached=detached
        )
        follower = Follower(calls, trace, deadline, callbacks, unwrap=request, mesh=mesh, control=control)
        await follower.run()
        return _result(follower, trace, mesh, start)
    except Error as error:
        error.trace_id = error.trace_id or trace.id
        raise


async def attach(
    calls: Calls,
    name: str,
    mesh: Optional[PackedMesh],
    callbacks: Callbacks,
    *,
    timeout: Optional[float],
    traceparent: str,
    control: Optional[Control] = None,
) -> Result:
    """Follows an existing job and returns its UV. Leaving does not affect the job."""
    start = time.monotonic()
    trace, deadline = Trace(traceparent), Deadline(timeout)
    follower = Follower(calls, trace, deadline, callbacks, watch=name, control=control)
    await follower.run()
    return _result(follower, trace, mesh, start)


async def watch(
    calls: Calls, name: str, callbacks: Callbacks, *, after_sequence: int, timeout: Optional[float]
) -> Job:
    """Follows a job until it ends, in any state."""
    follower = Follower(
        calls, Trace(), Deadline(timeout), callbacks, watch=name, after_sequence=after_sequence, wants_uv=False
    )
    await follower.run()
    return from_proto(Job, follower.job)


def _result(follower: Follower, trace: Trace, mesh: Optional[PackedMesh], start: float) -> Result:
    job = follower.job
    if job.state != job_pb2.JOB_STATE_SUCCEEDED:
        raise error_of_job(job)
    try:
        uv = parse_uv(job.uv, follower.uv, mesh)
    except Error as error:
        error.job = job.name
        raise
    now = time.monotonic()
    report = from_proto(Job, job).report
    assert report is not None  # a job that SUCCEEDED has one
    seconds = dataclasses.replace(
        report.seconds,
        upload=(follower.first_event or now) - start,
        download=now - (follower.last_event or now),
        total=now - start,
    )
    return Result(
        uv=uv,
        report=dataclasses.replace(report, seconds=seconds),
        job=job.name,
        trace_id=trace.id,
        _triangles=None if mesh is None else mesh.indices,
        _vertex_count=0 if mesh is None else mesh.vertex_count,
    )
