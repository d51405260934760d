"""The client for asyncio."""

from __future__ import annotations

import asyncio
from typing import Any, Callable, List, Mapping, Optional, Sequence, Union

from . import _follow
from ._calls import Calls
from ._connection import Connection, ConnectionOptions
from ._follow import Callbacks
from ._request import NewJob, new_job
from ._retry import RetryPolicy
from ._transport import AioTransport
from ._where import server_of
from .errors import Error
from .job import Capabilities, Event, Job, JobEstimate, Progress, Scheduling, UnwrapOptions
from .mesh import pack_mesh
from .result import Result


class AsyncClient:
    """:class:`planish.Client` for asyncio, with the same parameters and errors. An asynchronous context manager.

    Cancelling the task of an unwrap cancels its job on the server. Callbacks are called in the event loop. Not thread-safe, but
    several event loops may use it one after the other, and a forked child may use it in a loop of its own.
    """

    def __init__(
        self,
        target: Optional[str] = None,
        *,
        connection: Optional[ConnectionOptions] = None,
        retry: Optional[RetryPolicy] = None,
    ) -> None:
        """As :class:`planish.Client`. Without a target and $PLANISH_SERVER this may start a private server, which blocks for
        some tenths of a second."""
        self._arguments = (target, connection, retry)
        server = server_of(target, connection, retry)
        self._transport = AioTransport(
            Connection(server.target, server.connection, server.retry.connect_timeout_seconds)
        )
        self._calls = Calls(self._transport, server.retry)

    def __reduce__(self) -> Any:
        return _new_client, self._arguments

    async def __aenter__(self) -> "AsyncClient":
        return self

    async def __aexit__(self, *_: Any) -> None:
        await self.close()

    @property
    def target(self) -> str:
        return self._transport.connection.target

    async def close(self) -> None:
        """Ends the connection, and calls under way with it."""
        await self._transport.close()

    async def unwrap(
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
        """As :meth:`planish.Client.unwrap`."""
        job = new_job(positions, triangles, options, scheduling, labels, request_id, more)
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return await _follow.unwrap(
            self._calls, job, callbacks, detached=detached, timeout=timeout, traceparent=traceparent
        )

    def start_unwrap(self, positions: Any, triangles: Any, **arguments: Any) -> "asyncio.Task[Result]":
        """:meth:`unwrap` as a task of the running event loop."""
        return asyncio.get_running_loop().create_task(self.unwrap(positions, triangles, **arguments))

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
        """As :meth:`planish.Client.attach`."""
        mesh = None if positions is None else pack_mesh(positions, triangles)
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return await _follow.attach(self._calls, job, mesh, callbacks, timeout=timeout, traceparent=traceparent)

    async def create_job(
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
        """As :meth:`planish.Client.create_job`."""
        job = new_job(positions, triangles, options, scheduling, labels, request_id, more)
        return await self._calls.create_job(job, timeout)

    async def create_jobs(self, jobs: Sequence[NewJob]) -> List[Union[Job, Error]]:
        """As :meth:`planish.Client.create_jobs`."""
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
        """As :meth:`planish.Client.watch_job`."""
        callbacks = Callbacks(on_progress, on_event, on_retry)
        return await _follow.watch(self._calls, job, callbacks, after_sequence=after_sequence, timeout=timeout)

    async def get_job(self, job: str) -> Job:
        """As :meth:`planish.Client.get_job`."""
        return await self._calls.get_job(job)

    async def wait_job(self, job: str, timeout: Optional[float] = None) -> Job:
        """As :meth:`planish.Client.wait_job`."""
        return await self._calls.wait_job(job, timeout)

    async def read_result(self, job: str, offset: int, size: int) -> bytes:
        """As :meth:`planish.Client.read_result`."""
        return await self._calls.read_result(job, offset, size)

    async def list_jobs(self, limit: int = 50, filter: str = "") -> List[Job]:
        """As :meth:`planish.Client.list_jobs`."""
        return await self._calls.list_jobs(limit, filter)

    async def stop_job(self, job: str) -> Job:
        """As :meth:`planish.Client.stop_job`."""
        return await self._calls.stop_job(job)

    async def cancel_job(self, job: str) -> Job:
        """As :meth:`planish.Client.cancel_job`."""
        return await self._calls.cancel_job(job)

    async def delete_job(self, job: str) -> None:
        """As :meth:`planish.Client.delete_job`."""
        await self._calls.delete_job(job)

    async def estimate(
        self, triangles: int, vertices: int = 0, *, options: Optional[UnwrapOptions] = None, **more: Any
    ) -> JobEstimate:
        """As :meth:`planish.Client.estimate`."""
        job = new_job(None, None, options, None, None, "", more)
        return await self._calls.estimate(job, triangles, vertices)

    async def capabilities(self) -> Capabilities:
        """As :meth:`planish.Client.capabilities`."""
        return await self._calls.capabilities()


def _new_client(
    target: Optional[str], connection: Optional[ConnectionOptions], retry: Optional[RetryPolicy]
) -> AsyncClient:
    return AsyncClient(target, connection=connection, retry=retry)
