"""The client for asyncio: many calls at a time, a server that is killed under them, tasks that are cancelled."""

import asyncio
import numpy as np
import tempfile
import unittest

import planish
import support
from test_client import LONG, LONG_OPTIONS


def small_mesh(i):
    positions, triangles = support.bump(4, height=0.1)
    return positions * (1 + 0.01 * i), triangles


class Asyncio(unittest.IsolatedAsyncioTestCase):
    def start(self, *flags):
        server = support.Server("--workers=2", *flags)
        self.addCleanup(server.close)
        return server

    def check(self, results):
        for i, result in enumerate(results):
            positions, triangles = small_mesh(i)
            self.assertEqual(result.uv.shape, (len(triangles), 3, 2))
            self.assertTrue(result.is_usable)
            # Each result belongs to its own mesh: the scale differs, and with it the density.
            expected = results[0].report.atlas.texels_per_unit / (1 + 0.01 * i)
            self.assertAlmostEqual(result.report.atlas.texels_per_unit, expected, delta=0.01 * expected)
        self.assertEqual(len({result.job for result in results}), len(results))

    async def test_hundred_at_a_time(self):
        # The queue has room for 16: the others wait at the pace that the server asks for.
        server = self.start("--queue=16")
        patient = planish.RetryPolicy(queue_full_wait_seconds=600)
        async with planish.AsyncClient(server.target, retry=patient) as client:
            results = await asyncio.gather(*(client.unwrap(*small_mesh(i)) for i in range(100)))
            self.check(results)
            one = await client.unwrap(*small_mesh(0))
        blocking = planish.Client(server.target).unwrap(*small_mesh(0))
        np.testing.assert_array_equal(one.uv, blocking.uv)

    async def test_server_killed_under_them(self):
        with tempfile.TemporaryDirectory() as data:
            server = self.start(f"--data-dir={data}", "--queue=100", "--reattach-grace=60")
            done, accepted, retries = [], set(), []

            async def unwrap(client, i):
                result = await client.unwrap(
                    *small_mesh(i),
                    on_event=lambda _: accepted.add(i),
                    on_retry=lambda error, seconds: retries.append(error),
                )
                done.append(i)
                return result

            async with planish.AsyncClient(server.target) as client:
                tasks = [asyncio.ensure_future(unwrap(client, i)) for i in range(10)]
                await asyncio.gather(*tasks)
                # However slow or fast this process is, none of the others ends before the server is killed.
                server.stop_workers()
                tasks += [asyncio.ensure_future(unwrap(client, i)) for i in range(10, 100)]
                while len(accepted) < 55:
                    ended, _ = await asyncio.wait(tasks[10:], timeout=0.01)
                    for task in ended:
                        task.result()  # none should have one: this raises what went wrong
                server.kill()
                self.assertEqual(len(done), 10)
                server.start()
                self.check(await asyncio.gather(*tasks))
            self.assertTrue(any(error.code == "UNAVAILABLE" for error in retries))

    async def test_cancelled_task(self):
        server = self.start("--reattach-grace=10")  # should the last word of a client get lost
        async with planish.AsyncClient(server.target) as client:
            working = asyncio.Event()
            task = client.start_unwrap(
                *LONG, on_progress=lambda _: working.set(), labels={"test": "cancel"}, **LONG_OPTIONS
            )
            await asyncio.wait_for(working.wait(), 60)
            task.cancel()
            with self.assertRaises(asyncio.CancelledError):
                await task
            (job,) = await client.list_jobs(filter="labels.test = cancel")
            self.assertEqual((await client.wait_job(job.name, 60)).state, "CANCELLED")
            accepted = asyncio.Event()
            task = client.start_unwrap(*LONG, on_event=lambda _: accepted.set(), labels={"test": "late"}, **LONG_OPTIONS)
            await asyncio.wait_for(accepted.wait(), 60)
            with self.assertRaises(asyncio.TimeoutError):
                await asyncio.wait_for(task, 0.01)
            (job,) = await client.list_jobs(filter="labels.test = late")
            self.assertEqual((await client.wait_job(job.name, 60)).state, "CANCELLED")

    async def test_jobs(self):
        server = self.start()
        async with planish.AsyncClient(server.target) as client:
            mesh = small_mesh(1)
            job = await client.create_job(*mesh, labels={"a": "b"})
            events = []
            self.assertEqual((await client.watch_job(job.name, on_event=events.append)).state, "SUCCEEDED")
            self.assertEqual(events[0].sequence, 1)
            result = await client.attach(job.name, *mesh)
            self.assertEqual(await client.read_result(job.name, 0, 1 << 20), result.uv.tobytes())
            created = await client.create_jobs([planish.NewJob(*small_mesh(i)) for i in range(3)])
            ended = await asyncio.gather(*(client.wait_job(each.name) for each in created))
            self.assertEqual([each.state for each in ended], ["SUCCEEDED"] * 3)
            self.assertEqual((await client.stop_job(job.name)).state, "SUCCEEDED")
            self.assertEqual((await client.cancel_job(job.name)).state, "SUCCEEDED")
            await client.delete_job(job.name)
            with self.assertRaises(planish.NotFound):
                await client.get_job(job.name)
            self.assertEqual((await client.capabilities()).workers, 2)
            self.assertGreater((await client.estimate(1000)).memory_bytes, 0)


class Loops(unittest.TestCase):
    def test_one_client_in_several_loops(self):
        server = support.Server("--workers=1")
        self.addCleanup(server.close)
        client = planish.AsyncClient(server.target)
        for _ in range(2):

            async def main():
                result = await client.unwrap(*small_mesh(0))
                await client.close()
                return result

            self.assertTrue(asyncio.run(main()).is_usable)


if __name__ == "__main__":
    unittest.main()
