"""The methods of both clients, written once, as coroutines."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any, Callable, Coroutine, List, Mapping, Optional, Sequence, Tuple, Type, TypeVar, Union

from . import _follow
from ._calls import Calls
from ._connection import Connection, ConnectionOptions
from ._follow import Callbacks, Control
from ._request import NewJob, new_job
from ._retry import RetryPolicy
from ._transport import Transport, run_blocking
from ._where import server_of
from .errors import Error
from .job import Capabilities, Event, Job, JobEstimate, Progress, Scheduling, UnwrapOptions
from .mesh import pack_mesh
from .result import Result

if TYPE_CHECKING:
    from typing_extensions import Concatenate, ParamSpec

    P = ParamSpec("P")

R = TypeVar("R")


class Connected:
    """A connection to one server, made by the first call and re-established when lost. Pickling leaves the
    connection out."""

    _control: Optional[Control] = None  # only for an unwrap on its own thread

    def __init__(
        self,
        transport: Callable[[Connection], Transport],
        target: Optional[str],
        connection: Optional[ConnectionOptions],
        retry: Optional[RetryPolicy],
    ) -> None:
        self._arguments = (target, connection, retry)
        server = server_of(target, connection, retry)
        self._calls = Calls(
            transport(Connection(server.target, server.connection, server.retry.connect_timeout_seconds)), server.retry
        )

    def __reduce__(self) -> Any:
        return _new, (type(self), self._arguments)

    @property
    def target(self) -> str:
        return self._calls.transport.connection.target


def _new(kind: Type[Any], arguments: Tuple[Any, ...]) -> Any:
    target, connection, retry = arguments
    return kind(target, connection=connection, retry=retry)


class Methods:
    """The methods of a client, over any transport."""

    _calls: Calls
    _control: Optional[Control] = None

    # Unwraps

    async def unwrap(
        self,
        /,
        positions: Any,
        triangles: Any,
        *,
        options: Optional[UnwrapOptions] = None,
        scheduling: Optional[Scheduling] = None,
        labels: Optional[Mapping[str, str]] = None,
        detached: bool = False,
        timeout: Optional[float] = None,
        request_id: str = "",
        traceparent: str = "",
        on_progress: Optional[Callable[[Progress], None]] = None,
        on_event: Optional[Callable[[Event], None]] = None,
        on_retry: Optional[Callable[[Error, float], None]] = None,
        **more: Any,
    ) -> Result:
        """Flattens a mesh and waits for the UV.

        `positions` (V, 3) and `triangles` (F, 3): anything that numpy converts to an array; see
        :class:`planish.NewJob`. `more`: given seams (`seam_edges`, `seam_corners`, `parts`, `uncut_corners`),
        `face_polygon`, `face_atlas` and `face_weights`, see :class:`planish.NewJob`, and fields of
        :class:`planish.UnwrapOptions`, which override those of `options`: ``unwrap(v, f, seams="needed",
        parts=labels)``, ``unwrap(v, f, face_atlas=labels)``. `detached`: the job continues if its caller disconnects.
        `timeout`: seconds for the whole call; the job is cancelled when they pass. `request_id`: the same id gets the
        same job. `traceparent`: the W3C trace of the call; empty: $TRACEPARENT or a new one. The callbacks are those of
        :class:`planish.Callbacks`.

        Ctrl-C cancels the job on the server, as does cancelling the task. Raises :class:`planish.ArrayError` before
        anything is sent, :class:`planish.ResourceExhausted`, and the error of a failed job.
        """
        job = new_job(positions, triangles, options, scheduling, labels, request_id, more)
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return await _follow.unwrap(
            self._calls,
            job,
            callbacks,
            detached=detached,
            timeout=timeout,
            traceparent=traceparent,
            control=self._control,
        )

    async def attach(
        self,
        job: str,
        positions: Any = None,
        triangles: Any = None,
        *,
        timeout: Optional[float] = None,
        traceparent: str = "",
        on_progress: Optional[Callable[[Progress], None]] = None,
        on_event: Optional[Callable[[Event], None]] = None,
        on_retry: Optional[Callable[[Error, float], None]] = None,
    ) -> Result:
        """Follows a job until it ends and returns its UV. If a mesh is given, it must be the job's (MESH_MISMATCH).
        Leaving does not affect the job. Raises :class:`planish.NotFound`: JOB_NOT_FOUND, RESULT_EXPIRED."""
        mesh = None if positions is None else pack_mesh(positions, triangles)
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return await _follow.attach(self._calls, job, mesh, callbacks, timeout=timeout, traceparent=traceparent)

    # Jobs

    async def create_job(
        self,
        /,
        positions: Any,
        triangles: Any,
        *,
        options: Optional[UnwrapOptions] = None,
        scheduling: Optional[Scheduling] = None,
        labels: Optional[Mapping[str, str]] = None,
        timeout: Optional[float] = None,
        request_id: str = "",
        **more: Any,
    ) -> Job:
        """Queues a job and returns once the server has accepted it; :meth:`attach` fetches the UV. Parameters:
        :meth:`unwrap`."""
        job = new_job(positions, triangles, options, scheduling, labels, request_id, more)
        return await self._calls.create_job(job, timeout)

    async def create_jobs(self, jobs: Sequence[NewJob]) -> List[Union[Job, Error]]:
        """Queues several jobs with few calls. A refused job does not affect the others: its place has the error, in the
        order of `jobs`. Jobs for which the queue has no room fail with QUEUE_FULL. Raises if the server cannot be
        reached; accepted jobs are found again with the same request ids."""
        return await self._calls.create_jobs(jobs)

    async def watch_job(
        self,
        job: str,
        *,
        after_sequence: int = 0,
        timeout: Optional[float] = None,
        on_progress: Optional[Callable[[Progress], None]] = None,
        on_event: Optional[Callable[[Event], None]] = None,
        on_retry: Optional[Callable[[Error, float], None]] = None,
    ) -> Job:
        """Follows a job until it ends, in any state, and returns it. Callbacks get only events after
        `after_sequence`."""
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return await _follow.watch(self._calls, job, callbacks, after_sequence=after_sequence, timeout=timeout)

    async def get_job(self, job: str) -> Job:
        """The job as it is now. `job` is a name, "jobs/...". Raises :class:`planish.NotFound`."""
        return await self._calls.get_job(job)

    async def wait_job(self, job: str, timeout: Optional[float] = None) -> Job:
        """Waits until the job has ended, at most `timeout` seconds, and returns it: like :meth:`watch_job`, but by
        calls of some seconds each, for networks that cut streams."""
        return await self._calls.wait_job(job, timeout)

    async def read_result(self, job: str, offset: int, size: int) -> bytes:
        """`size` bytes of the UV of a job that SUCCEEDED from byte `offset` on, in the layout of
        planish.v1.UvDescription; fewer at the end of the UV."""
        return await self._calls.read_result(job, offset, size)

    async def list_jobs(self, limit: int = 50, filter: str = "") -> List[Job]:
        """The jobs, newest first, at most `limit` (0: all), without reports. `filter` as in planish.v1.ListJobs, for
        instance ``'state = RUNNING AND labels.file = "night/*"'``; empty: all."""
        return await self._calls.list_jobs(limit, filter)

    async def stop_job(self, job: str) -> Job:
        """Asks a job to end soon with the best valid map so far (warning STOPPED)."""
        return await self._calls.stop_job(job)

    async def cancel_job(self, job: str) -> Job:
        """Returns the job, now CANCELLED or STOPPING. No effect on a job that has ended."""
        return await self._calls.cancel_job(job)

    async def delete_job(self, job: str) -> None:
        """Deletes an ended job and its UV. Raises :class:`planish.FailedPrecondition` if the job has not ended."""
        await self._calls.delete_job(job)

    # The server

    async def estimate(
        self, /, triangles: int, vertices: int = 0, *, options: Optional[UnwrapOptions] = None, **more: Any
    ) -> JobEstimate:
        """Estimates what unwrapping a mesh of this size would need. `vertices` 0: half as many as triangles."""
        job = new_job(None, None, options, None, None, "", more)
        return await self._calls.estimate(job, triangles, vertices)

    async def capabilities(self) -> Capabilities:
        """The capabilities of this server."""
        return await self._calls.capabilities()


class Controlled(Methods):
    """The methods for one call that other threads may cancel or stop."""

    def __init__(self, calls: Calls, control: Control) -> None:
        self._calls = calls
        self._control = control


def blocking(method: Callable[Concatenate[Any, P], Coroutine[Any, Any, R]]) -> Callable[Concatenate[Any, P], R]:
    """The method of a client with a blocking transport: runs the coroutine and returns its result."""

    @functools.wraps(method)
    def call(self: Any, /, *arguments: P.args, **keywords: P.kwargs) -> R:
        return run_blocking(method(self, *arguments, **keywords))

    return call
