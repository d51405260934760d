"""The blocking client."""

from __future__ import annotations

import os
import threading
from typing import Any, Callable, List, Mapping, Optional, Sequence, Union

from . import _follow
from ._calls import Calls
from ._connection import Connection, ConnectionOptions
from ._follow import Callbacks, Control
from ._request import NewJob, new_job
from ._retry import RetryPolicy
from ._transport import BlockingTransport, run_blocking
from ._where import server_of
from .errors import Error
from .job import Capabilities, Event, Job, JobEstimate, Progress, Scheduling, UnwrapOptions
from .mesh import pack_mesh
from .result import Result


class Call:
    """An unwrap on a thread of its own, made by :meth:`Client.start_unwrap`. All methods are thread-safe."""

    def __init__(self, client: "Client", run: Callable[[Control], Result]) -> None:
        self._client = client
        self._control = Control()
        self._done = threading.Event()
        self._result: Optional[Result] = None
        self._error: Optional[BaseException] = None
        self._thread = threading.Thread(target=self._run, args=(run,), name="planish", daemon=True)
        self._thread.start()

    def _run(self, run: Callable[[Control], Result]) -> None:
        try:
            self._result = run(self._control)
        except BaseException as error:  # handed to whoever asks for the result
            self._error = error
        finally:
            self._done.set()

    @property
    def job(self) -> str:
        """Name of the job; empty until the server has accepted it."""
        return self._control.job

    def cancel(self) -> None:
        """Asks the server to cancel the job. The call then ends with :class:`planish.Cancelled`, or with its result if that
        was quicker."""
        job = self._control.cancel()
        if job:
            self._client.cancel_job(job)

    def stop(self) -> None:
        """Asks the server to end the job soon with the best valid map so far (warning STOPPED). The call then ends with that,
        or with STOPPED_EARLY if there was no valid map yet."""
        job = self._control.stop()
        if job:
            self._client.stop_job(job)

    def done(self) -> bool:
        """Whether the call has ended."""
        return self._done.is_set()

    def wait(self, timeout: Optional[float] = None) -> bool:
        """Whether the call ended within so many seconds; None: however long it takes."""
        return self._done.wait(timeout)

    def result(self, timeout: Optional[float] = None) -> Result:
        """Waits for the end: the result, or raises the error. TimeoutError if the call has not ended in time."""
        if not self._done.wait(timeout):
            raise TimeoutError(f"the call has not ended within {timeout} s")
        if self._error is not None:
            raise self._error
        assert self._result is not None
        return self._result


class Client:
    """A connection to one server, made by the first call and again when it is lost. Thread-safe; a context manager.

    A forked child may go on with a client of its parent: it gets a channel of its own. A client can be pickled, for processes
    that are spawned.

    Calls raise :class:`planish.Error`. What a network and a server may do in between stays inside: a broken connection is
    taken up where it ended, a server that was restarted is waited for, a full queue too, and what is safe to repeat is
    repeated, at the pace that the server asks for.
    """

    def __init__(
        self,
        target: Optional[str] = None,
        *,
        connection: Optional[ConnectionOptions] = None,
        retry: Optional[RetryPolicy] = None,
    ) -> None:
        """`target`: "host:port" or "unix:/path". None: $PLANISH_SERVER, and where that is not set, a private server that is
        started for this process by the first client without a target and shared by all of them.

        `connection`: TLS and tokens; None: what the environment says. `retry`: how patient the client is.
        """
        self._arguments = (target, connection, retry)
        server = server_of(target, connection, retry)
        self._transport = BlockingTransport(
            Connection(server.target, server.connection, server.retry.connect_timeout_seconds)
        )
        self._calls = Calls(self._transport, server.retry)

    def __reduce__(self) -> Any:
        return _new_client, self._arguments

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    @property
    def target(self) -> str:
        return self._transport.connection.target

    def close(self) -> None:
        """Ends the connection, and calls under way with it."""
        self._transport.close()

    # Unwraps

    def unwrap(
        self,
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

        `positions` (V, 3) and `triangles` (F, 3): whatever numpy takes for an array; see :class:`planish.NewJob`.
        `more`: given seams (`seam_edges`, `seam_corners`, `parts`, `uncut_corners`, see :class:`planish.NewJob`) and fields of
        :class:`planish.UnwrapOptions`, which go before those of `options`: ``unwrap(v, f, seams="needed", parts=labels)``.
        `detached`: the job survives the loss of its caller. `timeout`: seconds for the whole call; the job is cancelled when
        they pass. `request_id`: the same id gets the same job. `traceparent`: the W3C trace that the call continues; empty:
        $TRACEPARENT or a new one. The callbacks are those of :class:`planish.Callbacks`.

        Ctrl-C cancels the job on the server. Raises :class:`planish.ArrayError` before anything is sent,
        :class:`planish.ResourceExhausted`, and whatever the job failed with.
        """
        job = new_job(positions, triangles, options, scheduling, labels, request_id, more)
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return self._unwrap(job, callbacks, detached, timeout, traceparent, None)

    def _unwrap(
        self,
        job: NewJob,
        callbacks: Callbacks,
        detached: bool,
        timeout: Optional[float],
        traceparent: str,
        control: Optional[Control],
    ) -> Result:
        return run_blocking(
            _follow.unwrap(
                self._calls,
                job,
                callbacks,
                detached=detached,
                timeout=timeout,
                traceparent=traceparent,
                control=control,
            )
        )

    def start_unwrap(
        self,
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
    ) -> Call:
        """As :meth:`unwrap` on a thread of its own, where the callbacks are called too. The arrays must not change meanwhile."""
        job = new_job(positions, triangles, options, scheduling, labels, request_id, more)
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return Call(self, lambda control: self._unwrap(job, callbacks, detached, timeout, traceparent, control))

    def attach(
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
        """Follows a job until it ended and brings its UV. If the mesh is given, the job must be of that one (MESH_MISMATCH).
        Leaving does not touch the job. Raises :class:`planish.NotFound`: JOB_NOT_FOUND, RESULT_EXPIRED."""
        mesh = None if positions is None else pack_mesh(positions, triangles)
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return run_blocking(
            _follow.attach(self._calls, job, mesh, callbacks, timeout=timeout, traceparent=traceparent)
        )

    # Jobs

    def create_job(
        self,
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
        """Queues a job and returns as soon as the server has it; :meth:`attach` brings the UV. Parameters: :meth:`unwrap`."""
        job = new_job(positions, triangles, options, scheduling, labels, request_id, more)
        return run_blocking(self._calls.create_job(job, timeout))

    def create_jobs(self, jobs: Sequence[NewJob]) -> List[Union[Job, Error]]:
        """Queues several jobs with few calls. One that is refused hurts no other: in its place is the error, in the order of
        `jobs`. A full queue is an error (QUEUE_FULL) of those that it has no room for. Raises if the server cannot be asked;
        what it has accepted by then, the same request ids bring again."""
        return run_blocking(self._calls.create_jobs(jobs))

    def watch_job(
        self,
        job: str,
        *,
        after_sequence: int = 0,
        timeout: Optional[float] = None,
        on_progress: Optional[Callable[[Progress], None]] = None,
        on_event: Optional[Callable[[Event], None]] = None,
        on_retry: Optional[Callable[[Error, float], None]] = None,
    ) -> Job:
        """Follows a job until it ended, whatever the end. Events after `after_sequence` only."""
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return run_blocking(
            _follow.watch(self._calls, job, callbacks, after_sequence=after_sequence, timeout=timeout)
        )

    def get_job(self, job: str) -> Job:
        """The job as it is now. `job` is a name, "jobs/...". Raises :class:`planish.NotFound`."""
        return run_blocking(self._calls.get_job(job))

    def wait_job(self, job: str, timeout: Optional[float] = None) -> Job:
        """The job when it has ended, or after so many seconds as it is then: like :meth:`watch_job`, but by calls that are
        over after some seconds each, for networks that cut streams."""
        return run_blocking(self._calls.wait_job(job, timeout))

    def read_result(self, job: str, offset: int, size: int) -> bytes:
        """`size` bytes of the UV of a job that SUCCEEDED from byte `offset` on, as planish.v1.UvDescription lays them out;
        fewer where the UV end."""
        return run_blocking(self._calls.read_result(job, offset, size))

    def list_jobs(self, limit: int = 50, filter: str = "") -> List[Job]:
        """Newest first, at most `limit` (0: all), without reports. `filter` as in planish.v1.ListJobs, for instance
        ``'state = RUNNING AND labels.file = "night/*"'``; empty: all."""
        return run_blocking(self._calls.list_jobs(limit, filter))

    def stop_job(self, job: str) -> Job:
        """Asks a job to end soon with the best valid map so far (warning STOPPED)."""
        return run_blocking(self._calls.stop_job(job))

    def cancel_job(self, job: str) -> Job:
        """The job, now CANCELLED or STOPPING; one that ended already is left as it is."""
        return run_blocking(self._calls.cancel_job(job))

    def delete_job(self, job: str) -> None:
        """Forgets a job that has ended, and its UV. Raises :class:`planish.FailedPrecondition` for one that has not."""
        run_blocking(self._calls.delete_job(job))

    # The server

    def estimate(
        self, triangles: int, vertices: int = 0, *, options: Optional[UnwrapOptions] = None, **more: Any
    ) -> JobEstimate:
        """What unwrapping a mesh of so many triangles and vertices (0: half as many as triangles) would need."""
        job = new_job(None, None, options, None, None, "", more)
        return run_blocking(self._calls.estimate(job, triangles, vertices))

    def capabilities(self) -> Capabilities:
        """What this server can do."""
        return run_blocking(self._calls.capabilities())


def _new_client(
    target: Optional[str], connection: Optional[ConnectionOptions], retry: Optional[RetryPolicy]
) -> Client:
    return Client(target, connection=connection, retry=retry)


# The client of this process ---------------------------------------------------------------------------------------------

_lock = threading.Lock()
_default: Optional[Client] = None


def default_client() -> Client:
    """The client of :func:`planish.unwrap` and of the functions in the shape of xatlas's: kept for the process, made anew when
    $PLANISH_SERVER changes or the private server was lost."""
    global _default
    with _lock:
        target = server_of(None, None, None).target
        if _default is None or _default.target != target:
            _default = Client()
        return _default


def unwrap(positions: Any, triangles: Any, **arguments: Any) -> Result:
    """:meth:`Client.unwrap` on the server that $PLANISH_SERVER names, or on a private one that is started by the first call of
    the process, kept for all later ones, and ended with the process."""
    return default_client().unwrap(positions, triangles, **arguments)


def _after_fork_in_child() -> None:
    global _lock
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork_in_child)
