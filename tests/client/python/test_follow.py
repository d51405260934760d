"""What a network and a server may do in between: a server that does what the test says, on a real socket."""

import asyncio
import hashlib
import signal
import threading
import unittest
import unittest.mock
from concurrent.futures import ThreadPoolExecutor

import grpc
import numpy as np
from google.protobuf import any_pb2, duration_pb2, empty_pb2

import planish
import support
from planish.rpc import error_details_pb2, status_pb2
from planish.v1 import job_pb2, options_pb2, planish_pb2, planish_pb2_grpc

MESH = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32)
UV = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]], np.float32)
MESH_SHA256 = hashlib.sha256(MESH[0].tobytes() + MESH[1].tobytes()).digest()
PATIENCE = planish.RetryPolicy(reattach_seconds=2.0, backoff_seconds=0.001, queue_full_wait_seconds=1.0, retry_seconds=1.0)


def status(code, reason="", retry_after=None, **metadata):
    """A google.rpc.Status, with details if there is a reason."""
    made = status_pb2.Status(code=code.value[0], message=f"{reason or code.name} in words")

    def add(name, message):
        made.details.append(any_pb2.Any(type_url=f"type.googleapis.com/google.rpc.{name}", value=message.SerializeToString()))

    if reason:
        add("ErrorInfo", error_details_pb2.ErrorInfo(reason=reason, domain="planish", metadata=metadata))
    if retry_after is not None:
        delay = duration_pb2.Duration(nanos=int(retry_after * 1e9))
        add("RetryInfo", error_details_pb2.RetryInfo(retry_delay=delay))
    return made


def refuse(context, code, reason="", retry_after=None, **metadata):
    made = status(code, reason, retry_after, **metadata)
    if made.details:
        context.set_trailing_metadata([("grpc-status-details-bin", made.SerializeToString())])
    context.abort(code, made.message)


def event(kind, sequence, state, **more):
    job = job_pb2.Job(name=more.pop("name", "jobs/1"), state=state, **more)
    return kind(event=job_pb2.JobEvent(sequence=sequence, job=job))


def succeeded(kind, sequence, **more):
    uv = {"precision": options_pb2.PRECISION_FLOAT, "corner_count": 3, "total_bytes": 24, "mesh_sha256": MESH_SHA256}
    uv["uv_sha256"] = hashlib.sha256(UV.tobytes()).digest()
    uv.update(more)
    description = job_pb2.UvDescription(**uv)
    return event(kind, sequence, job_pb2.JOB_STATE_SUCCEEDED, uv=description, report=job_pb2.Report())


def piece(kind, begin, end):
    return kind(uv=job_pb2.UvChunk(offset=begin, data=UV.tobytes()[begin:end]))


UNWRAP, WATCH = planish_pb2.UnwrapResponse, planish_pb2.WatchJobResponse
RUNNING, CANCELLED, FAILED = job_pb2.JOB_STATE_RUNNING, job_pb2.JOB_STATE_CANCELLED, job_pb2.JOB_STATE_FAILED


def whole(request, context):
    yield event(UNWRAP, 1, RUNNING)
    yield succeeded(UNWRAP, 2)
    yield piece(UNWRAP, 0, 24)


def broken_after_first_event(request, context):
    yield event(UNWRAP, 1, RUNNING)
    refuse(context, grpc.StatusCode.UNAVAILABLE)


class Servicer(planish_pb2_grpc.PlanishServicer):
    """Answers by the test's functions, one for each call, in order."""

    def __init__(self):
        self.script, self.calls = [], []

    def next(self, method, request, context):
        self.calls.append((method, request, dict(context.invocation_metadata())))
        expected, function = self.script.pop(0) if self.script else (None, None)
        if method != expected:
            raise AssertionError(f"{method} in place of {expected}")
        return function(request, context)

    def Unwrap(self, request, context):
        yield from self.next("Unwrap", request, context)

    def WatchJob(self, request, context):
        yield from self.next("WatchJob", request, context)

    def GetCapabilities(self, request, context):
        return planish_pb2.Capabilities(version="fake", inline_mesh_bytes=1, upload_chunk_bytes=50)

    def WriteUpload(self, requests, context):
        return self.next("WriteUpload", *requests, context)


def unary(method):
    return lambda self, request, context: self.next(method, request, context)


for each in ("CancelJob", "CreateJob", "BatchCreateJobs", "GetJob", "DeleteJob", "ListJobs", "ReadResult", "CreateUpload"):
    setattr(Servicer, each, unary(each))


class Streams:
    """What is run over every transport."""

    def setUp(self):
        self.servicer = Servicer()
        self.grpc_server = grpc.server(ThreadPoolExecutor(4))
        planish_pb2_grpc.add_PlanishServicer_to_server(self.servicer, self.grpc_server)
        self.target = f"127.0.0.1:{self.grpc_server.add_insecure_port('127.0.0.1:0')}"
        self.grpc_server.start()
        self.addCleanup(self.grpc_server.stop, None)
        self.options = {"connection": planish.ConnectionOptions(token="secret"), "retry": PATIENCE}

    def call(self, method, *arguments, **keywords):
        """After a first call, so that the server has been reached."""
        with planish.Client(self.target, **self.options) as client:
            client.capabilities()
            return getattr(client, method)(*arguments, **keywords)

    def run_script(self, *script, **keywords):
        self.servicer.script = list(script)
        self.servicer.calls.clear()
        try:
            return self.call("unwrap", *MESH, **keywords)
        finally:
            self.assertEqual(self.servicer.script, [], "calls that did not come")

    def requests(self):
        return [request for _, request, _ in self.servicer.calls]

    def test_broken_in_the_uv(self):
        def first(request, context):
            yield event(UNWRAP, 1, RUNNING)
            yield succeeded(UNWRAP, 3)
            yield piece(UNWRAP, 0, 8)
            refuse(context, grpc.StatusCode.UNAVAILABLE)

        def second(request, context):
            yield piece(WATCH, 4, 16)  # some of it again
            refuse(context, grpc.StatusCode.INTERNAL)  # as of the transport

        def third(request, context):
            yield piece(WATCH, 16, 24)

        events, retries = [], []
        result = self.run_script(
            ("Unwrap", first),
            ("WatchJob", second),
            ("WatchJob", third),
            on_event=events.append,
            on_retry=lambda error, seconds: retries.append(error.code),
        )
        np.testing.assert_array_equal(result.uv, UV)
        watches = [(r.name, r.after_sequence, r.uv_offset, r.include_uv, r.attach) for r in self.requests()[1:]]
        self.assertEqual(watches, [("jobs/1", 3, 8, True, True), ("jobs/1", 3, 16, True, True)])
        self.assertEqual([each.sequence for each in events], [1, 3])
        self.assertEqual(retries, ["UNAVAILABLE", "INTERNAL"])

    def test_job_that_failed(self):
        def failed(request, context):
            error = status(grpc.StatusCode.INVALID_ARGUMENT, "MESH_CLOSED", faces="3,5", edges="1-2")
            yield event(UNWRAP, 1, FAILED, error=error)

        with self.assertRaises(planish.InvalidArgument) as raised:
            self.run_script(("Unwrap", failed))
        error = raised.exception
        self.assertEqual((error.reason, error.job, error.faces, error.edges), ("MESH_CLOSED", "jobs/1", [3, 5], [(1, 2)]))

    def test_uploads(self):
        data = planish.mesh.pack_mesh(*MESH).draco()
        self.assertTrue(50 < len(data) < 100)
        digest = hashlib.sha256(data).digest()

        def committed(size):
            return lambda *_: planish_pb2.Upload(name="uploads/1", total_bytes=len(data), committed_bytes=size)

        def of_upload(request, context):
            yield event(UNWRAP, 1, RUNNING)
            yield succeeded(UNWRAP, 2, mesh_sha256=digest)
            yield piece(UNWRAP, 0, 24)

        def broken(request, context):
            refuse(context, grpc.StatusCode.UNAVAILABLE)

        def busy(request, context):
            refuse(context, grpc.StatusCode.ABORTED, "UPLOAD_BUSY")

        def forgotten(request, context):
            refuse(context, grpc.StatusCode.NOT_FOUND, "UPLOAD_NOT_FOUND")

        def forgotten_too(request, context):
            forgotten(request, context)
            yield

        pieces = [("CreateUpload", committed(0)), ("WriteUpload", committed(50)), ("WriteUpload", committed(len(data)))]
        with unittest.mock.patch("planish._calls._SMALL_MESH_BYTES", 0):
            # A piece is repeated by itself.
            result = self.run_script(*pieces[:2], ("WriteUpload", broken), ("WriteUpload", busy), pieces[2], ("Unwrap", of_upload))
            np.testing.assert_array_equal(result.uv, UV)
            begin, first, *again, unwrap = self.requests()
            self.assertEqual((begin.total_bytes, begin.sha256), (len(data), digest))
            self.assertEqual([(each.name, each.offset, each.data) for each in again], [("uploads/1", 50, data[50:])] * 3)
            self.assertEqual((first.data, unwrap.spec.upload), (data[:50], "uploads/1"))
            # What the server has already is not sent.
            self.run_script(("CreateUpload", committed(len(data))), ("Unwrap", of_upload))
            # What it has forgotten goes with the call: before the job, and after a loss of both.
            for script in (
                [*pieces[:2], ("WriteUpload", forgotten), ("Unwrap", whole)],
                [*pieces, ("Unwrap", forgotten_too), ("Unwrap", whole)],
                [*pieces, ("Unwrap", broken_after_first_event), ("WatchJob", forgotten_too), ("Unwrap", whole)],
            ):
                np.testing.assert_array_equal(self.run_script(*script).uv, UV)
                self.assertEqual(self.requests()[-1].spec.arrays.positions, MESH[0].tobytes())


class Rest(Streams):
    """What is run over two."""

    def test_events_come_once(self):
        def again(request, context):
            yield event(WATCH, 1, RUNNING)
            yield succeeded(WATCH, 2)
            yield piece(WATCH, 0, 24)

        events = []
        self.run_script(("Unwrap", broken_after_first_event), ("WatchJob", again), on_event=events.append)
        self.assertEqual([each.sequence for each in events], [1, 2])

    def test_detached(self):
        def again(request, context):
            yield succeeded(WATCH, 2)
            yield piece(WATCH, 0, 24)

        self.run_script(("Unwrap", broken_after_first_event), ("WatchJob", again), detached=True)
        self.assertEqual([request.detached for request in self.requests()[:1]], [True])
        self.assertFalse(self.requests()[1].attach)

    def test_lost_before_the_first_event(self):
        def gone(request, context):
            refuse(context, grpc.StatusCode.UNAVAILABLE)
            yield

        def ended_early(request, context):
            return iter(())

        def shut_down(request, context):
            refuse(context, grpc.StatusCode.CANCELLED)
            yield

        self.run_script(("Unwrap", gone), ("Unwrap", ended_early), ("Unwrap", shut_down), ("Unwrap", whole))
        self.assertEqual(len({request.request_id for request in self.requests()}), 1)
        self.assertNotEqual(self.requests()[0].request_id, "")

    def test_job_is_gone_with_the_server(self):
        def unknown(request, context):
            refuse(context, grpc.StatusCode.NOT_FOUND, "JOB_NOT_FOUND")
            yield

        def cancelled(request, context):
            yield event(WATCH, 5, CANCELLED)

        def mesh_lost(request, context):
            yield event(UNWRAP, 1, RUNNING)
            yield event(UNWRAP, 2, FAILED, error=status(grpc.StatusCode.DATA_LOSS, "MESH_LOST"))

        result = self.run_script(
            ("Unwrap", broken_after_first_event),
            ("WatchJob", unknown),
            ("Unwrap", broken_after_first_event),
            ("WatchJob", cancelled),
            ("Unwrap", mesh_lost),
            ("Unwrap", whole),
        )
        np.testing.assert_array_equal(result.uv, UV)
        ids = [request.request_id for method, request, _ in self.servicer.calls if method == "Unwrap"]
        self.assertEqual(len(set(ids)), 4)
        with self.assertRaises(planish.Unavailable) as raised:
            self.run_script(*[("Unwrap", broken_after_first_event), ("WatchJob", unknown)] * 4)
        self.assertEqual(raised.exception.reason, "CONNECTION_LOST")

    def test_leaving_before_the_job_has_a_name(self):
        # The server may have the job all the same: it is found by its request id.
        def silent(request, context):
            gone = threading.Event()
            context.add_callback(gone.set)
            gone.wait(60)
            yield from ()

        def interrupt(*_):
            raise KeyboardInterrupt

        self.addCleanup(signal.signal, signal.SIGALRM, signal.signal(signal.SIGALRM, interrupt))
        while not self.servicer.calls:  # on a busy machine the signal may come before the call
            signal.setitimer(signal.ITIMER_REAL, 0.2)
            self.servicer.script = [
                ("Unwrap", silent),
                ("CreateJob", lambda *_: job_pb2.Job(name="jobs/1")),
                ("CancelJob", lambda *_: job_pb2.Job(name="jobs/1")),
            ]
            with self.assertRaises(KeyboardInterrupt):
                self.call("unwrap", *MESH)
        unwrap, create, cancel = self.requests()
        self.assertEqual((create.request_id, create.spec), (unwrap.request_id, unwrap.spec))
        self.assertEqual(cancel.name, "jobs/1")

    def test_full_queue(self):
        def full(request, context):
            refuse(context, grpc.StatusCode.RESOURCE_EXHAUSTED, "QUEUE_FULL", 0.01, queue_capacity="2")
            yield

        self.run_script(("Unwrap", full), ("Unwrap", full), ("Unwrap", whole))
        self.assertEqual(len({request.request_id for request in self.requests()}), 1)
        self.options["retry"] = planish.RetryPolicy(queue_full_wait_seconds=0)
        with self.assertRaises(planish.ResourceExhausted) as raised:
            self.run_script(("Unwrap", full))
        error = raised.exception
        self.assertEqual((error.reason, error.metadata, error.retry_after_seconds), ("QUEUE_FULL", {"queue_capacity": "2"}, 0.01))

    def test_errors_that_do_not_pass(self):
        for code, reason, kind in (
            (grpc.StatusCode.UNAVAILABLE, "DRAINING", planish.Unavailable),
            (grpc.StatusCode.INTERNAL, "INTERNAL_DEFECT", planish.Internal),
            (grpc.StatusCode.INVALID_ARGUMENT, "OPTIONS_INVALID", planish.InvalidArgument),
            (grpc.StatusCode.PERMISSION_DENIED, "RIGHT_MISSING", planish.PermissionDenied),
            (grpc.StatusCode.RESOURCE_EXHAUSTED, "MEMORY_LIMIT", planish.ResourceExhausted),
        ):

            def refused(request, context):
                refuse(context, code, reason)
                yield

            with self.assertRaises(kind) as raised:
                self.run_script(("Unwrap", refused))
            self.assertEqual((raised.exception.reason, raised.exception.job), (reason, ""))
            self.assertEqual(str(raised.exception), f"{reason} in words")

    def test_damaged_uv(self):
        def delivers(begin, **changes):
            def function(request, context):
                yield succeeded(UNWRAP, 1, **changes)
                yield piece(UNWRAP, begin, 24)

            return function

        for function in (delivers(4), delivers(0, uv_sha256=bytes(32)), delivers(0, corner_count=6)):
            with self.assertRaises(planish.DataLoss) as raised:
                self.run_script(("Unwrap", function))
            self.assertEqual((raised.exception.reason, raised.exception.job), ("UV_CORRUPT", "jobs/1"))

    def test_what_every_call_carries(self):
        def lost(request, context):
            yield event(UNWRAP, 1, RUNNING, name="jobs/abc")
            refuse(context, grpc.StatusCode.UNAVAILABLE)

        def again(request, context):
            yield succeeded(WATCH, 2)
            yield piece(WATCH, 0, 24)

        result = self.run_script(("Unwrap", lost), ("WatchJob", again), labels={"k": "v"}, padding=7, request_id="mine")
        (_, request, first), (_, _, second) = self.servicer.calls
        self.assertEqual((request.request_id, dict(request.spec.labels)), ("mine", {"k": "v"}))
        self.assertEqual(request.spec.options.padding, 7)
        self.assertEqual(request.spec.arrays.positions, MESH[0].tobytes())
        self.assertEqual(request.spec.arrays.triangles, MESH[1].tobytes())
        for metadata in (first, second):
            self.assertEqual(metadata["authorization"], "Bearer secret")
            self.assertEqual(metadata["traceparent"][3:35], result.trace_id)
        self.assertNotEqual(first["traceparent"], second["traceparent"])

    def test_short_calls_are_repeated(self):
        def gone(request, context):
            refuse(context, grpc.StatusCode.UNAVAILABLE)

        def unknown(request, context):
            refuse(context, grpc.StatusCode.NOT_FOUND, "JOB_NOT_FOUND")

        self.servicer.script = [("GetJob", gone), ("GetJob", lambda *_: job_pb2.Job(name="jobs/1"))]
        self.assertEqual(self.call("get_job", "jobs/1").name, "jobs/1")
        self.servicer.script = [("DeleteJob", gone), ("DeleteJob", unknown)]
        self.call("delete_job", "jobs/1")  # only the first answer was lost
        self.servicer.script = [("DeleteJob", unknown)]
        with self.assertRaises(planish.NotFound):
            self.call("delete_job", "jobs/1")
        self.servicer.script = [("DeleteJob", lambda *_: empty_pb2.Empty())]
        self.call("delete_job", "jobs/1")
        self.servicer.calls.clear()
        self.servicer.script = [("CreateJob", gone), ("CreateJob", lambda *_: job_pb2.Job(name="jobs/2"))]
        self.assertEqual(self.call("create_job", *MESH).name, "jobs/2")
        self.assertEqual(len({request.request_id for request in self.requests()}), 1)
        self.options["retry"] = planish.RetryPolicy(retry_seconds=0)
        self.servicer.script = [("GetJob", gone)]
        with self.assertRaises(planish.Unavailable):
            self.call("get_job", "jobs/1")

    def test_pages_and_pieces(self):
        def page(first, token):
            jobs = [job_pb2.Job(name=f"jobs/{i}") for i in range(first, first + 2)]
            return lambda *_: planish_pb2.ListJobsResponse(jobs=jobs, next_page_token=token)

        self.servicer.script = [("ListJobs", page(0, "more")), ("ListJobs", page(2, "")), ("ListJobs", page(0, "more"))]
        self.assertEqual([job.name for job in self.call("list_jobs", 0)], [f"jobs/{i}" for i in range(4)])
        self.assertEqual([request.page_token for request in self.requests()], ["", "more"])
        self.assertEqual(len(self.call("list_jobs", 1, "state = RUNNING")), 1)
        self.assertEqual(self.requests()[-1].filter, "state = RUNNING")
        self.servicer.script = [
            ("ReadResult", lambda request, _: planish_pb2.ReadResultResponse(data=UV.tobytes()[request.offset :][:10]))
        ] * 4
        self.assertEqual(self.call("read_result", "jobs/1", 1, 100), UV.tobytes()[1:])


class InAnEventLoop:
    def call(self, method, *arguments, **keywords):
        async def main():
            async with planish.AsyncClient(self.target, **self.options) as client:
                await client.capabilities()
                return await getattr(client, method)(*arguments, **keywords)

        return asyncio.run(main())


class ByAHelper:
    """As in a forked process. This process has not been forked: the server needs its threads."""

    def setUp(self):
        super().setUp()
        patch = unittest.mock.patch.object(planish._transport, "_was_forked", True)
        patch.start()
        self.addCleanup(patch.stop)


class Blocking(Rest, unittest.TestCase):
    pass


class Asyncio(InAnEventLoop, Rest, unittest.TestCase):
    pass


class BlockingByAHelper(ByAHelper, Streams, unittest.TestCase):
    def test_helper_that_is_lost(self):
        with planish.Client(self.target, **self.options) as client:
            client.capabilities()
            helper = client._calls.transport._channel._process
            helper.kill()
            helper.wait()
            self.assertEqual(client.capabilities().workers, 0)  # by another one
            self.assertIsNot(client._calls.transport._channel._process, helper)
        self.assertIsNotNone(helper.returncode)


class AsyncioByAHelper(ByAHelper, InAnEventLoop, Streams, unittest.TestCase):
    pass


if __name__ == "__main__":
    unittest.main()
