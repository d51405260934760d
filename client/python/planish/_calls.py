"""The calls to a server, one coroutine each, shared by both clients."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import threading
from typing import Any, Callable, List, Optional, Sequence, Tuple, Union

from . import errors
from ._connection import is_unix
from ._request import NewJob, new_request_id, spec_message
from ._retry import Deadline, Patience, RetryPolicy, is_broken
from ._status import error_of_status
from ._transport import LAST_WORD_SECONDS, Transport
from .errors import Error
from .job import Capabilities, Job, JobEstimate, from_proto
from .mesh import PackedMesh
from .private_server import revive
from .v1 import job_pb2, planish_pb2

#: Time limit of calls without a mesh.
_UNARY_SECONDS = 20.0
#: Limit of one WaitJob, short enough that proxies do not take it for a dead connection.
_LONGEST_WAIT_SECONDS = 15.0
#: Meshes up to this size are sent without asking for the server's limit.
_SMALL_MESH_BYTES = 1 << 20
#: Limits of one BatchCreateJobs: jobs, and bytes of their meshes. A larger mesh is sent on its own.
_MOST_IN_BATCH = 100
_MOST_BATCH_BYTES = 4 << 20

_TRACEPARENT = re.compile(r"(?!ff)[0-9a-f]{2}-(?!0{32})([0-9a-f]{32})-(?!0{16})[0-9a-f]{16}-([0-9a-f]{2})")


class Trace:
    """The W3C trace of related calls: the caller's, the environment's, or a new one."""

    def __init__(self, traceparent: str = "") -> None:
        match = _TRACEPARENT.fullmatch(traceparent or os.environ.get("TRACEPARENT", ""))
        if traceparent and match is None:
            raise errors.InvalidArgument(f"{traceparent!r} is no W3C traceparent", reason="TRACEPARENT_INVALID")
        self.id = match.group(1) if match else secrets.token_hex(16)
        self._flags = match.group(2) if match else "01"

    def traceparent(self) -> str:
        """The header of the next call."""
        return f"00-{self.id}-{secrets.token_hex(8)}-{self._flags}"


class Calls:
    """The calls to one server. As thread-safe as the transport."""

    def __init__(self, transport: Transport, policy: RetryPolicy) -> None:
        self.transport = transport
        self.policy = policy

    def metadata(self, trace: Trace) -> List[Tuple[str, str]]:
        """The metadata of a call."""
        return [("traceparent", trace.traceparent()), *self.transport.connection.metadata()]

    async def repeated(
        self,
        method: str,
        request: Any,
        *,
        trace: Optional[Trace] = None,
        deadline: Optional[Deadline] = None,
        seconds: Optional[float] = _UNARY_SECONDS,
        patience: Optional[Patience] = None,
        on_attempt: Callable[[int], None] = lambda _: None,
    ) -> Any:
        """Makes a call with retries until it succeeds or `patience` ends. `seconds`: limit of one attempt."""
        trace = trace or Trace()
        deadline = deadline or Deadline(None)
        retry = self.policy.retry_seconds
        patience = patience or Patience(self.policy, deadline, lost_seconds=retry, room_seconds=retry)
        attempt = 0
        try:
            while True:
                attempt += 1
                on_attempt(attempt)
                metadata = self.metadata(trace)
                try:
                    return await self.transport.unary(method, request, deadline.left(seconds), metadata)
                except Error as error:
                    await self.pause(error, patience)
        except Error as error:
            error.trace_id = trace.id
            raise

    async def pause(self, error: Error, patience: Patience, wake: Optional[threading.Event] = None) -> float:
        """Waits before the next attempt and returns the seconds. Raises `error`, or an error that replaces it, if there
        should be no further attempt.

        A private server of this process that has crashed is restarted, at most once per call."""
        transport = self.transport
        if is_broken(error) and revive(transport.connection.target, patience.has_revived):
            patience.has_revived = True
            await transport.close()  # the channel may be in its back-off
            return 0.0
        seconds = patience.pause(error, reached=transport.reached, target=transport.connection.target)
        await transport.sleep(seconds, wake)
        return seconds

    # Jobs that exist

    async def get_job(self, name: str) -> Job:
        return from_proto(Job, await self.repeated("GetJob", planish_pb2.GetJobRequest(name=name)))

    async def wait_job(self, name: str, timeout: Optional[float]) -> Job:
        deadline = Deadline(timeout)
        while True:
            left = deadline.left(_LONGEST_WAIT_SECONDS) or 0.0
            request = planish_pb2.WaitJobRequest(name=name)
            request.timeout.FromNanoseconds(int(left * 1e9))
            job = from_proto(Job, await self.repeated("WaitJob", request, seconds=left + _UNARY_SECONDS))
            if job.is_terminal or left < _LONGEST_WAIT_SECONDS:
                return job

    async def list_jobs(self, limit: int, filter: str) -> List[Job]:
        jobs: List[Job] = []
        request = planish_pb2.ListJobsRequest(filter=filter)
        while True:
            request.page_size = min(1000, limit - len(jobs)) if limit > 0 else 1000
            page = await self.repeated("ListJobs", request)
            jobs.extend(from_proto(Job, job) for job in page.jobs)
            if not page.next_page_token or 0 < limit <= len(jobs):
                return jobs[:limit] if limit > 0 else jobs
            request.page_token = page.next_page_token

    async def stop_job(self, name: str) -> Job:
        return from_proto(Job, await self.repeated("StopJob", planish_pb2.StopJobRequest(name=name)))

    async def cancel_job(self, name: str) -> Job:
        return from_proto(Job, await self.repeated("CancelJob", planish_pb2.CancelJobRequest(name=name)))

    async def cancel_while_leaving(self, name: str, unwrap: Any) -> None:
        """Cancels the job of a caller that leaves before the job has ended, as on Ctrl-C; failures are ignored.

        `name` is empty if it is not known yet. Then `unwrap`, the job's request, finds the job; None: the request was
        not sent.
        """
        trace = Trace()
        try:
            if not name and unwrap is not None:
                again = planish_pb2.CreateJobRequest(spec=unwrap.spec, request_id=unwrap.request_id)
                created = await self.transport.unary("CreateJob", again, LAST_WORD_SECONDS, self.metadata(trace))
                name = created.name
            if name:
                request = planish_pb2.CancelJobRequest(name=name)
                await self.transport.unary("CancelJob", request, LAST_WORD_SECONDS, self.metadata(trace))
        except Error:
            pass  # later the server cancels the job of a disconnected caller by itself

    async def delete_job(self, name: str) -> None:
        attempts = 0

        def count(attempt: int) -> None:
            nonlocal attempts
            attempts = attempt

        try:
            await self.repeated("DeleteJob", planish_pb2.DeleteJobRequest(name=name), on_attempt=count)
        except errors.NotFound:
            if attempts == 1:
                raise
            # An earlier attempt succeeded, and only its response was lost.

    async def read_result(self, name: str, offset: int, size: int) -> bytes:
        data = bytearray()
        while len(data) < size:
            request = planish_pb2.ReadResultRequest(name=name, offset=offset + len(data), limit=size - len(data))
            piece = (await self.repeated("ReadResult", request)).data
            if not piece:
                break
            data += piece
        return bytes(data)

    # The server

    async def capabilities(self) -> Capabilities:
        request = planish_pb2.GetCapabilitiesRequest()
        return from_proto(Capabilities, await self.repeated("GetCapabilities", request))

    async def estimate(self, job: NewJob, triangles: int, vertices: int) -> JobEstimate:
        request = planish_pb2.EstimateJobRequest(spec=spec_message(job, None))
        request.size.triangles = triangles
        request.size.vertices = vertices
        answer = await self.repeated("EstimateJob", request)
        size = {"triangles": answer.size.triangles, "vertices": answer.size.vertices}
        estimate = from_proto(JobEstimate, answer)
        return JobEstimate(**{**estimate.__dict__, **size})

    # New jobs

    def patience_for_new_job(self, deadline: Deadline) -> Patience:
        policy = self.policy
        return Patience(
            policy, deadline, lost_seconds=policy.reattach_seconds, room_seconds=policy.queue_full_wait_seconds
        )

    async def send_ahead(self, mesh: PackedMesh, trace: Trace, deadline: Deadline) -> str:
        """Uploads a mesh that should not be sent in one message. Returns the name of the upload; "" for a mesh that
        should be. Raises if the mesh is too large for the server."""
        if mesh.byte_count <= _SMALL_MESH_BYTES:
            return ""
        server = await self.capabilities()
        limit = server.max_mesh_bytes
        if 0 < limit < mesh.byte_count:
            raise errors.ResourceExhausted(
                f"the mesh has {mesh.byte_count} bytes as sent; this server takes at most {limit}",
                reason="MESH_TOO_LARGE",
                metadata={"bytes": str(mesh.byte_count), "limit": str(limit)},
            )
        if is_unix(self.transport.connection.target) or not 0 < server.inline_mesh_bytes < mesh.byte_count:
            return ""  # there is no network that could break, or little to send again if it does
        if mesh.vertex_count > 3 * mesh.triangle_count:
            return ""  # a Draco file cannot hold such a mesh
        try:
            return await self._upload(mesh.draco(), server.upload_chunk_bytes, trace, deadline)
        except errors.NotFound:
            return ""  # a restarted server has forgotten the upload

    async def _upload(self, data: bytes, chunk: int, trace: Trace, deadline: Deadline) -> str:
        begin = planish_pb2.CreateUploadRequest(
            total_bytes=len(data), sha256=hashlib.sha256(data).digest(), request_id=new_request_id()
        )
        patience = self.patience_for_new_job(deadline)
        upload = await self.repeated("CreateUpload", begin, trace=trace, deadline=deadline, patience=patience)
        while upload.committed_bytes < len(data):
            at = upload.committed_bytes
            piece = planish_pb2.WriteUploadRequest(name=upload.name, offset=at, data=data[at : at + chunk])
            # The server skips a piece that it already has.
            patience = self.patience_for_new_job(deadline)
            upload = await self.repeated(
                "WriteUpload", piece, trace=trace, deadline=deadline, seconds=None, patience=patience
            )
            if upload.committed_bytes <= at:
                raise errors.Internal(f"the server took no byte of {upload.name} from byte {at} on")
        return str(upload.name)

    async def create_job(self, job: NewJob, timeout: Optional[float]) -> Job:
        return await self._create(job, job.pack(), Deadline(timeout))

    async def _create(self, job: NewJob, mesh: PackedMesh, deadline: Deadline) -> Job:
        trace = Trace()
        upload = await self.send_ahead(mesh, trace, deadline)
        request = planish_pb2.CreateJobRequest(
            spec=spec_message(job, mesh, upload), request_id=job.request_id or new_request_id()
        )
        patience = self.patience_for_new_job(deadline)
        created = await self.repeated(
            "CreateJob", request, trace=trace, deadline=deadline, seconds=None, patience=patience
        )
        return from_proto(Job, created)

    async def create_jobs(self, jobs: Sequence[NewJob]) -> List[Union[Job, Error]]:
        created: List[Optional[Union[Job, Error]]] = [None] * len(jobs)
        batch = planish_pb2.BatchCreateJobsRequest()
        places: List[int] = []
        batch_bytes = 0
        for place, job in enumerate(jobs):
            try:
                mesh = job.pack()
                if mesh.byte_count > _MOST_BATCH_BYTES:
                    created[place] = await self._create(job, mesh, Deadline(None))
                    continue
                spec = spec_message(job, mesh)
            except Error as error:
                if isinstance(error, errors.Unavailable):
                    raise
                created[place] = error
                continue
            if places and (len(places) == _MOST_IN_BATCH or batch_bytes + mesh.byte_count > _MOST_BATCH_BYTES):
                await self._send_batch(batch, places, created)
                batch, places, batch_bytes = planish_pb2.BatchCreateJobsRequest(), [], 0
            batch.requests.add(spec=spec, request_id=job.request_id or new_request_id())
            places.append(place)
            batch_bytes += mesh.byte_count
        if places:
            await self._send_batch(batch, places, created)
        return [each for each in created if each is not None]

    async def _send_batch(
        self, batch: Any, places: List[int], created: List[Optional[Union[Job, Error]]]
    ) -> None:
        answer = await self.repeated("BatchCreateJobs", batch, seconds=None)
        if len(answer.results) != len(places):
            raise errors.Internal(f"the server answered to {len(answer.results)} of {len(places)} jobs")
        for place, result in zip(places, answer.results):
            if result.HasField("job"):
                created[place] = from_proto(Job, result.job)
            else:
                created[place] = error_of_status(result.error)


def error_of_job(job: Any) -> Error:
    """The error of a job that ended without UV."""
    if job.state == job_pb2.JOB_STATE_FAILED and job.HasField("error"):
        error = error_of_status(job.error)
    elif job.state == job_pb2.JOB_STATE_CANCELLED:
        error = errors.Cancelled("the job was cancelled")
    else:
        error = errors.Internal(f"the job ended as {job_pb2.JobState.Name(job.state)} without UV")
    error.job = job.name
    return error
