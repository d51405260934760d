"""The blocking client against a real server."""

import dataclasses
import hashlib
import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import unittest
import unittest.mock

import numpy as np

import planish
import support

# A mesh whose solve takes long enough to be interrupted, and its options.
LONG = support.ball(60)
LONG_OPTIONS = {"max_stretch": 1.002, "effort": "best", "scheduling": planish.Scheduling(fresh=True)}


class WithServer(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = support.Server("--workers=2", "--queue=8", "--max-mesh-mb=2", "--reattach-grace=60")
        cls.client = planish.Client(cls.server.target)

    @classmethod
    def tearDownClass(cls):
        cls.client.close()
        cls.server.close()

    def check(self, result, triangles):
        self.assertEqual(result.uv.shape, (len(triangles), 3, 2))
        self.assertEqual(result.uv.dtype, np.float32)
        self.assertTrue((support.uv_areas(result.uv) > 0).all())
        self.assertTrue(((result.uv >= 0) & (result.uv <= 1)).all())
        self.assertTrue(result.is_usable)
        self.assertEqual(result.warnings, [])


class Unwrap(WithServer):
    def test_disc(self):
        positions, triangles = support.bump(height=0.1)
        progress, events = [], []
        result = self.client.unwrap(
            positions, triangles, labels={"file": "bump"}, on_progress=progress.append, on_event=events.append
        )
        self.check(result, triangles)
        self.assertEqual(result.chart_count, 1)
        chart = result.charts[0]
        self.assertTrue(chart.converged)
        self.assertEqual(len(chart.newton_residuals), chart.newton_iterations + 1)
        self.assertGreater(chart.newton_residuals[0], chart.newton_residuals[-1])
        self.assertLess(chart.newton_residuals[-1], 1e-9)
        self.assertEqual(result.report.chart_totals.newton_residuals, chart.newton_residuals)
        self.assertEqual(result.report.vertices, len(positions))
        self.assertGreater(result.report.seconds.total, result.report.seconds.solve)
        self.assertIn("solve", {each.stage for each in progress})
        self.assertEqual([event.sequence for event in events], list(range(1, len(events) + 1)))
        self.assertEqual([event.job.state for event in events if event.job][-1], "SUCCEEDED")
        self.assertEqual(len(progress), len([event for event in events if event.progress]))
        split = result.per_vertex()
        self.assertEqual(len(split.source_vertex), len(positions))  # a disc needs no seam
        np.testing.assert_array_equal(split.triangles, triangles)
        job = self.client.get_job(result.job)
        self.assertEqual((job.state, job.labels, job.attempts), ("SUCCEEDED", {"file": "bump"}, 1))
        self.assertIsNotNone(job.end_time.tzinfo)

    def test_closed(self):
        positions, triangles = support.ball()
        result = self.client.unwrap(positions, triangles, texture_size=256, padding=4)
        self.check(result, triangles)
        self.assertGreater(result.chart_count, 1)
        self.assertEqual(result.face_charts().max() + 1, result.chart_count)
        self.assertEqual((result.report.atlas.texture_size, result.report.atlas.padding), (256, 4))
        split = result.per_vertex()
        np.testing.assert_array_equal(split.uv[split.triangles], result.uv)
        np.testing.assert_array_equal(split.source_vertex[split.triangles], triangles)

    def test_texels_per_unit(self):
        mesh = support.ball()
        result = self.client.unwrap(*mesh, texels_per_unit=300)
        atlas = result.report.atlas
        self.check(result, mesh[1])
        self.assertAlmostEqual(atlas.texels_per_unit, 300, 4)
        self.assertIn(atlas.texture_size, (1024, 2048))  # a ball of radius 1 has an area of 12.6
        with self.assertRaises(planish.InvalidArgument) as raised:
            self.client.unwrap(*mesh, texels_per_unit=300, texture_size=atlas.texture_size // 2)
        self.assertEqual(raised.exception.metadata["field"], "texels_per_unit")
        most = float(raised.exception.metadata["most"])
        self.assertTrue(100 < most < 300, most)
        self.assertIn(f"{most / 300:.3g} of the 300 asked for", str(raised.exception))

    def test_uv_are_those_of_the_command(self):
        positions, triangles = support.ball()
        positions = np.insert(positions, [0, 40, 40], [9.0, 9.0, 9.0], axis=0)  # vertices without a triangle
        triangles = triangles + 1 + 2 * (triangles >= 40)
        with tempfile.TemporaryDirectory() as directory:
            ins, out = os.path.join(directory, "in.obj"), os.path.join(directory, "out.obj")
            support.write_obj(ins, positions, triangles)
            some = (["--max-stretch=1.01", "--padding=5", "--texture-size=auto", "--texels-per-unit=99"],
                    {"max_stretch": 1.01, "padding": 5, "texels_per_unit": 99})  # fmt: skip
            for flags, options in (([], {}), some):
                command = [support.PLANISH, "unwrap", ins, "-o", out, f"--server={self.server.target}", *flags]
                subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
                _, faces, uv = support.read_obj(out)
                np.testing.assert_array_equal(faces, triangles)
                result = self.client.unwrap(positions, triangles, **options)
                np.testing.assert_array_equal(uv.astype(np.float32), result.uv)
                os.remove(out)

    def test_uploaded_meshes(self):
        server = support.Server(target=f"127.0.0.1:{support.free_port()}")
        self.addCleanup(server.close)
        mesh = support.bump()
        with planish.Client(server.target) as client:
            expected = client.unwrap(*mesh)
            few = dataclasses.replace(client.capabilities(), inline_mesh_bytes=1, upload_chunk_bytes=1000)
            answer = unittest.mock.AsyncMock(return_value=few)
            small = unittest.mock.patch("planish._calls._SMALL_MESH_BYTES", 0)
            with small, unittest.mock.patch("planish._calls.Calls.capabilities", answer):
                job = client.create_job(*mesh)
                result = client.attach(job.name, *mesh)
                again = client.unwrap(*mesh, padding=3)
            self.assertEqual(client.get_job(result.job).mesh_bytes, len(planish.mesh.pack_mesh(*mesh).draco()))
            np.testing.assert_array_equal(result.uv, expected.uv)
            self.assertTrue(again.is_usable)

    def test_draco_files(self):
        for n in (12, 16, 256):  # indices of one and two bytes, and of one to three
            positions, triangles = support.bump(n)
            with tempfile.TemporaryDirectory() as directory:
                files = [os.path.join(directory, name) for name in ("mesh.obj", "mesh.drc")]
                support.write_obj(files[0], positions, triangles)
                with open(files[1], "wb") as file:
                    file.write(planish.mesh.pack_mesh(positions, triangles).draco())
                said = [subprocess.run([support.PLANISH, "inspect", "--json", path], stdout=subprocess.PIPE).stdout for path in files]
            obj, drc = (json.loads(each) for each in said)
            self.assertEqual(drc["triangles"], 2 * n * n)
            for each in (obj, drc):
                for key in ("file", "format", "bytes"):
                    each.pop(key, None)
            self.assertEqual(obj, drc)

    def test_double(self):
        positions, triangles = support.bump(4)
        result = self.client.unwrap(positions, triangles, precision="double")
        self.assertEqual(result.uv.dtype, np.float64)

    def test_parts_are_seams(self):
        positions, triangles = support.bump()
        centre = positions[triangles].mean(axis=1)
        parts = (centre[:, 0] > 0.5) + 2 * (centre[:, 1] > 0.5)
        result = self.client.unwrap(positions, triangles, parts=parts, seams="keep")
        self.assertEqual(result.chart_count, 4)
        self.assertEqual(len(set(zip(result.face_charts().tolist(), parts.tolist()))), 4)

    def test_atlases_and_weights(self):
        positions, triangles = support.bump()
        labels = (positions[triangles].mean(axis=1)[:, 0] > 0.5).astype(int)
        result = self.client.unwrap(positions, triangles, face_atlas=2 * labels, face_weights=1.0 + labels)
        self.assertEqual(set(np.floor(result.uv[labels == 0][..., 0]).ravel()), {0})
        self.assertEqual(set(np.floor(result.uv[labels == 1][..., 0]).ravel()), {2})
        atlases = result.report.atlas.atlases
        self.assertEqual([each.atlas for each in atlases], [0, 2])
        self.assertEqual([each.triangles for each in atlases], np.bincount(labels).tolist())
        self.assertGreater(atlases[1].packing_efficiency, 2 * atlases[0].packing_efficiency)
        stacked = self.client.unwrap(positions, triangles, face_atlas=labels, atlas_layout="stacked")
        self.assertEqual(stacked.report.atlas.layout, "stacked")
        self.assertLess(stacked.uv.max(), 1)
        with self.assertRaises(planish.InvalidArgument) as raised:
            self.client.unwrap(positions, triangles, face_atlas=100 * labels)
        self.assertEqual(raised.exception.metadata["field"], "spec.elements.face_atlas")

    def test_seam_edges(self):
        positions, triangles = support.bump(4)
        middle = np.flatnonzero(positions[:, 0] == 0.5)
        result = self.client.unwrap(positions, triangles, seam_edges=np.stack([middle[:-1], middle[1:]], 1), seams="keep")
        self.assertEqual(result.chart_count, 2)

    def test_what_the_server_refuses(self):
        positions, triangles = support.ball(2)
        with self.assertRaises(planish.InvalidArgument) as raised:
            self.client.unwrap(positions, triangles, padding=99)
        self.assertIn("padding", raised.exception.metadata["field"])
        self.assertEqual(len(raised.exception.trace_id), 32)
        with self.assertRaises(planish.Error) as raised:
            self.client.unwrap(positions, triangles, seams="none")
        self.assertEqual(raised.exception.reason, "MESH_CLOSED")
        self.assertTrue(raised.exception.job.startswith("jobs/"))
        with self.assertRaises(planish.ResourceExhausted) as raised:
            self.client.unwrap(*support.bump(350))
        self.assertEqual(raised.exception.reason, "MESH_TOO_LARGE")

    def test_callback_that_raises_cancels(self):
        class Enough(Exception):
            pass

        names = []

        def on_event(event):
            names.append(event.job.name if event.job else names[-1])
            if event.progress:
                raise Enough

        with self.assertRaises(Enough):
            self.client.unwrap(*LONG, on_event=on_event, **LONG_OPTIONS)
        self.assertEqual(self.client.wait_job(names[-1], 60).state, "CANCELLED")

    def test_time_limit(self):
        for seconds in (0.2, 2, 20):  # on a busy machine a job may take longer to be accepted
            with self.assertRaises(planish.DeadlineExceeded) as raised:
                self.client.unwrap(*LONG, timeout=seconds, **LONG_OPTIONS)
            if raised.exception.job:
                break
        self.assertEqual(self.client.wait_job(raised.exception.job, 60).state, "CANCELLED")

    def test_trace(self):
        trace_id = "0af7651916cd43dd8448eb211c80319c"
        result = self.client.unwrap(*support.cube(), traceparent=f"00-{trace_id}-b7ad6b7169203331-01")
        self.assertEqual(result.trace_id, trace_id)
        with self.assertRaises(planish.InvalidArgument):
            self.client.unwrap(*support.cube(), traceparent="00-0-0-01")

    def test_pickled(self):
        again = pickle.loads(pickle.dumps(self.client))
        self.assertEqual(again.capabilities().workers, 2)


class Calls(WithServer):
    def test_cancel_and_stop(self):
        for moment in ("at once", "accepted", "at work"):
            events = []
            call = self.client.start_unwrap(
                *LONG, on_event=events.append, labels={"moment": moment}, **LONG_OPTIONS
            )
            with self.assertRaises(TimeoutError):
                call.result(0.0)
            while moment == "accepted" and not call.job or moment == "at work" and not any(e.progress for e in events):
                self.assertFalse(call.wait(0.001))
            call.cancel()
            with self.assertRaises(planish.Cancelled):
                call.result(60)
            self.assertTrue(call.done())
            jobs = self.client.list_jobs(filter=f'labels.moment = "{moment}"')
            self.assertLessEqual(0 if moment == "at once" else 1, len(jobs))
            self.assertLessEqual({self.client.wait_job(job.name, 60).state for job in jobs}, {"CANCELLED"})
        solving = threading.Event()
        call = self.client.start_unwrap(
            *LONG, on_progress=lambda p: solving.set() if p.stage == "pack" else None, **LONG_OPTIONS
        )
        self.assertTrue(solving.wait(60))
        call.stop()
        result = call.result(60)
        self.assertIn("STOPPED", [warning.reason for warning in result.warnings])
        self.assertTrue((support.uv_areas(result.uv) > 0).all())

    def test_interrupt_cancels_on_the_server(self):
        code = """if True:
            import os, planish, signal, support, sys, test_client
            def on_progress(progress):
                os.kill(os.getpid(), signal.SIGINT)
            try:
                planish.Client(sys.argv[1]).unwrap(
                    *test_client.LONG, on_progress=on_progress, labels={"test": "interrupt"}, **test_client.LONG_OPTIONS)
            except KeyboardInterrupt:
                print("interrupted")
        """
        self.assertEqual(support.run_python(code, self.server.target), "interrupted\n")
        (job,) = self.client.list_jobs(filter="labels.test = interrupt")
        self.assertEqual(self.client.wait_job(job.name, 60).state, "CANCELLED")

    def test_interrupt_while_blocked(self):
        # Nothing arrives while the job waits behind others: the signal must get through all the same.
        blockers = [self.client.start_unwrap(*LONG, **LONG_OPTIONS) for _ in range(2)]
        code = """if True:
            import planish, support, sys
            def on_event(event):
                print("queued", flush=True)
            try:
                planish.Client(sys.argv[1]).unwrap(*support.bump(7), on_event=on_event, labels={"test": "blocked"})
            except KeyboardInterrupt:
                print("interrupted")
        """
        child = subprocess.Popen([sys.executable, "-c", code, self.server.target], stdout=subprocess.PIPE, text=True)
        self.assertEqual(child.stdout.readline(), "queued\n")
        child.send_signal(signal.SIGINT)
        self.assertIn("interrupted", child.communicate(timeout=60)[0])
        (job,) = self.client.list_jobs(filter="labels.test = blocked")
        self.assertEqual(job.state, "CANCELLED")
        for call in blockers:
            call.cancel()
        for call in blockers:
            with self.assertRaises(planish.Cancelled):
                call.result(60)


class Jobs(WithServer):
    def test_life(self):
        positions, triangles = support.bump(6)
        job = self.client.create_job(positions, triangles, labels={"build": "1"}, request_id="once")
        self.assertEqual(self.client.create_job(positions, triangles, labels={"build": "1"}, request_id="once").name, job.name)
        with self.assertRaises(planish.AlreadyExists):
            self.client.create_job(positions, triangles, labels={"build": "1"}, request_id="once", padding=3)
        ended = self.client.wait_job(job.name)
        self.assertTrue(ended.is_terminal)
        self.assertIsNotNone(ended.report)
        self.assertEqual(self.client.watch_job(job.name).state, "SUCCEEDED")
        events = []
        self.client.watch_job(job.name, after_sequence=2, on_event=events.append)
        self.assertEqual(events[0].sequence, 3)
        result = self.client.attach(job.name, positions, triangles)
        np.testing.assert_array_equal(result.uv, self.client.unwrap(positions, triangles).uv)
        self.assertEqual(self.client.read_result(job.name, 8, 16), result.uv.tobytes()[8:24])
        self.assertEqual(self.client.read_result(job.name, 0, 1 << 30), result.uv.tobytes())
        with self.assertRaises(planish.FailedPrecondition) as raised:
            self.client.attach(job.name, positions + 1, triangles)
        self.assertEqual(raised.exception.reason, "MESH_MISMATCH")
        without = self.client.attach(job.name)
        np.testing.assert_array_equal(without.uv, result.uv)
        with self.assertRaises(planish.FailedPrecondition):
            without.per_vertex()
        self.assertEqual([each.name for each in self.client.list_jobs(filter="labels.build = 1")], [job.name])
        self.client.delete_job(job.name)
        with self.assertRaises(planish.NotFound) as raised:
            self.client.get_job(job.name)
        self.assertEqual(raised.exception.reason, "JOB_NOT_FOUND")

    def test_batch(self):
        positions, triangles = support.bump(3)
        jobs = [planish.NewJob(positions + i, triangles, labels={"batch": "b"}) for i in range(4)]
        jobs[1] = planish.NewJob(positions * np.nan, triangles)
        jobs[3] = planish.NewJob(positions, triangles, options=planish.UnwrapOptions(padding=99))
        created = self.client.create_jobs(jobs)
        self.assertIsInstance(created[0], planish.Job)
        self.assertIsInstance(created[1], planish.ArrayError)
        self.assertIsInstance(created[2], planish.Job)
        self.assertIn("padding", created[3].metadata["field"])
        for job in (created[0], created[2]):
            self.assertEqual(self.client.wait_job(job.name).state, "SUCCEEDED")
        self.assertEqual(len(self.client.list_jobs(filter="labels:batch")), 2)

    def test_large_batch_is_parted(self):
        positions, triangles = support.cube()
        created = self.client.create_jobs([planish.NewJob(positions * (1 + i), triangles) for i in range(130)])
        accepted = [each for each in created if isinstance(each, planish.Job)]
        refused = {each.reason for each in created if isinstance(each, planish.Error)}
        self.assertEqual(len(created), 130)
        self.assertGreaterEqual(len(accepted), 8)
        self.assertLessEqual(refused, {"QUEUE_FULL"})
        self.assertEqual(len({job.name for job in accepted}), len(accepted))
        for job in accepted:
            self.assertEqual(self.client.wait_job(job.name).state, "SUCCEEDED")

    def test_server(self):
        capabilities = self.client.capabilities()
        self.assertEqual((capabilities.workers, capabilities.max_mesh_bytes), (2, 2 << 20))
        self.assertEqual(capabilities.reattach_grace_seconds, 60)
        estimate = self.client.estimate(100_000, 50_002)
        self.assertEqual((estimate.triangles, estimate.vertices), (100_000, 50_002))
        self.assertGreater(estimate.memory_bytes, 1 << 20)
        self.assertGreater(estimate.run_time_seconds, 0)


class Identity(unittest.TestCase):
    def test_tls_and_token(self):
        with tempfile.TemporaryDirectory() as directory:
            server, path = support.secure_server(directory)
            self.addCleanup(server.close)
            good = planish.ConnectionOptions(tls_ca_file=path("ca.pem"), token_file=path("token"))
            with planish.Client(server.target, connection=good) as client:
                self.assertTrue(client.unwrap(*support.cube()).is_usable)
            wrong = planish.ConnectionOptions(tls_ca_file=path("ca.pem"), token="wrong")
            with planish.Client(server.target, connection=wrong) as client:
                with self.assertRaises(planish.Unauthenticated) as raised:
                    client.unwrap(*support.cube())
                self.assertEqual(raised.exception.reason, "CREDENTIALS_INVALID")
            for options, word in (
                ({}, "TLS only"),
                ({"tls": True}, "verify failed"),
                ({"tls_ca_file": path("ca.pem"), "tls_server_name": "other"}, "other is not"),
            ):
                with planish.Client(server.target, connection=planish.ConnectionOptions(**options)) as client:
                    with self.assertRaisesRegex(planish.Unavailable, word) as raised:
                        client.capabilities()
                    self.assertEqual(raised.exception.reason, "TLS_FAILED")
            environment = {**os.environ, "PLANISH_SERVER": server.target, "PLANISH_TLS_CA": path("ca.pem")}
            with open(path("token"), encoding="ascii") as file:
                environment["PLANISH_TOKEN"] = file.read().strip()
            code = "import planish, support; print(planish.unwrap(*support.cube()).is_usable, support.children())"
            self.assertEqual(support.run_python(code, env=environment), "True []\n")

    def test_nobody_there(self):
        with self.assertRaises(planish.Unavailable) as raised:
            planish.Client(f"127.0.0.1:{support.free_port()}").unwrap(*support.cube())
        self.assertEqual(raised.exception.reason, "SERVER_UNREACHABLE")
        self.assertIn("refused", str(raised.exception))


class Damage(unittest.TestCase):
    """What arrives is checked: a server that delivers wrong bytes is not believed."""

    def parse(self, **changes):
        from planish.result import parse_uv
        from planish.v1 import job_pb2, options_pb2

        data = np.arange(12, dtype=np.float32).tobytes()
        mesh = planish.mesh.pack_mesh(np.eye(3), [[0, 1, 2], [2, 1, 0]])
        fields = {"corner_count": 6, "uv_sha256": hashlib.sha256(data).digest(), "mesh_sha256": mesh.sha256()}
        description = job_pb2.UvDescription(**{**fields, "precision": options_pb2.PRECISION_FLOAT, **changes})
        return parse_uv(description, bytearray(data), mesh)

    def test_is_noticed(self):
        self.assertEqual(self.parse().shape, (2, 3, 2))
        for changes in ({"corner_count": 3}, {"uv_sha256": bytes(32)}, {"precision": 3}):
            with self.assertRaises(planish.DataLoss):
                self.parse(**changes)
        with self.assertRaises(planish.FailedPrecondition):
            self.parse(mesh_sha256=bytes(32))


if __name__ == "__main__":
    unittest.main()
