"""Processes: pools by fork and by spawn, the private server of a process, and what is left when a process ends."""

import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import planish
import support


def unwrap_by(client, i):
    """In a child, with a client that came from the parent."""
    positions, triangles = support.cube()
    return os.getpid(), client.unwrap(positions * (1 + i), triangles).is_usable


_client = None


def unwrap_by_inherited(i):
    return unwrap_by(_client, i)


def unwrap_without_address(i):
    positions, triangles = support.cube()
    return os.getpid(), planish.unwrap(positions * (1 + i), triangles).is_usable, support.children()


def refused(_):
    planish.mesh.pack_mesh([[0, 0, 0]], [[0, 0, 7]])


class Pools(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = support.Server("--workers=2")

    @classmethod
    def tearDownClass(cls):
        cls.server.close()

    def check(self, answers, processes):
        self.assertEqual([usable for _, usable, *_ in answers], [True] * len(answers))
        pids = {answer[0] for answer in answers}
        self.assertNotIn(os.getpid(), pids)
        self.assertLessEqual(len(pids), processes)

    def test_fork(self):
        global _client
        _client = planish.Client(self.server.target)
        unwrap_by(_client, 0)  # the parent's channel is open, with threads of gRPC
        running = _client.start_unwrap(*support.ball(60), effort="best", max_stretch=1.002)
        with multiprocessing.get_context("fork").Pool(4) as pool:
            self.check(pool.map(unwrap_by_inherited, range(8), chunksize=1), 4)
            with self.assertRaises(planish.ArrayError) as raised:
                pool.map(refused, range(1))
            self.assertEqual(raised.exception.argument, "triangles")
        self.assertFalse(running.done())
        running.cancel()
        with self.assertRaises(planish.Cancelled):
            running.result(60)
        self.assertTrue(unwrap_by(_client, 0)[1])  # the parent's channel still is

    def test_spawn(self):
        client = planish.Client(self.server.target)
        with multiprocessing.get_context("spawn").Pool(4) as pool:
            self.check(pool.starmap(unwrap_by, [(client, i) for i in range(8)], chunksize=1), 4)

    def test_fork_after_asyncio(self):
        code = """if True:
            import asyncio, os, planish, support, sys
            client = planish.AsyncClient(sys.argv[1])
            async def main():
                results = await asyncio.gather(*(client.unwrap(*support.cube(), padding=i) for i in range(5)))
                print([result.is_usable for result in results].count(True), flush=True)
                try:
                    await client.get_job("jobs/none")
                except planish.NotFound as error:
                    print(error.reason, flush=True)
            asyncio.run(main())
            if os.fork() == 0:
                asyncio.run(main())
                print(planish.Client(sys.argv[1]).unwrap(*support.cube()).is_usable, flush=True)
                sys.exit(3)
            print(os.waitstatus_to_exitcode(os.wait()[1]))
        """
        said = support.run_python(code, self.server.target).split()
        self.assertEqual(said, ["5", "JOB_NOT_FOUND"] * 2 + ["True", "3"])


class OwnServer(unittest.TestCase):
    def setUp(self):
        self.assertNotIn("PLANISH_SERVER", os.environ)
        self.addCleanup(planish.close_default_server)

    def test_one_for_the_process(self):
        positions, triangles = support.cube()
        first = planish.unwrap(positions, triangles)
        (server,) = support.children()
        self.assertEqual(planish.Client().unwrap(positions, triangles).job.partition("/")[0], "jobs")
        planish.parametrize(positions * 2, triangles)
        self.assertEqual(support.children(), [server])
        self.assertTrue(first.is_usable)
        with multiprocessing.get_context("fork").Pool(4) as pool:  # children share it
            answers = pool.map(unwrap_without_address, range(8), chunksize=1)
        self.assertEqual({tuple(children) for _, _, children in answers}, {()})
        self.assertEqual(support.children(), [server])
        os.kill(server, 9)
        while planish.private_server.default_server().pid == server:
            pass  # a signal takes a moment
        planish.unwrap(positions, triangles)  # a server that was lost is replaced
        (other,) = support.children()
        self.assertNotEqual(other, server)

    def test_crash_costs_a_call_nothing_and_a_second_one_the_call(self):
        positions, triangles = support.ball(60)
        planish.unwrap(positions, triangles)
        client, crashes = planish.client.default_client(), []

        def crash(most):
            del crashes[:]

            def kill(_):
                (server,) = support.children()
                if len(crashes) < most and server not in crashes:
                    crashes.append(server)
                    os.kill(server, 9)

            return kill

        result = planish.unwrap(positions * 2, triangles, on_progress=crash(1))
        self.assertTrue(result.is_usable)
        self.assertEqual(len(crashes), 1)
        (again,) = support.children()
        self.assertNotIn(again, crashes)
        self.assertIs(planish.client.default_client(), client)  # the server is where it was
        with self.assertRaisesRegex(planish.Unavailable, "crashed again"):
            planish.unwrap(positions * 3, triangles, on_progress=crash(9))
        self.assertEqual(len(crashes), 2)
        self.assertEqual(support.children(), [])
        self.assertTrue(client.unwrap(positions * 4, triangles).is_usable)
        # A child that is forked shares it.
        with multiprocessing.get_context("fork").Pool(1) as pool:
            self.assertEqual(pool.map(unwrap_without_address, [5])[0][1:], (True, []))

    def test_each_process_has_its_own_also_when_isolated(self):
        code = """if True:
            import sys
            sys.path[:] = {path!r} + sys.path
            import multiprocessing, os, planish, support
            def unwrap(i):
                return planish.unwrap(*support.cube(), padding=i).is_usable, support.children(), planish.client.default_client().target
            print(unwrap(0)[2])
            with multiprocessing.get_context("fork").Pool(4) as pool:
                print({{(usable, len(children)) for usable, children, _ in pool.map(unwrap, range(4), chunksize=1)}})
        """.format(path=os.environ["PYTHONPATH"].split(":"))
        done = subprocess.run([sys.executable, "-I", "-c", code], check=True, stdout=subprocess.PIPE, text=True, timeout=60)
        target, pool = done.stdout.splitlines()
        self.assertEqual(pool, "{(True, 0)}")
        self.assertNotEqual(target, planish.private_server.default_server().target)

    def test_ends_with_the_process(self):
        # Whatever its end: at exit, killed, by a child that was forked and lives on.
        code = """if True:
            import os, planish, signal, support, sys, time
            planish.unwrap(*support.cube())
            target = planish.client.default_client().target
            print(support.children()[0], target, flush=True)
            if sys.argv[1] == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            if sys.argv[1] == "fork" and os.fork() == 0:
                sys.stdout.close(); os.close(1); os.close(2)
                sys.stdin.read()
                os._exit(0)
        """
        for end in ("exit", "kill", "fork"):
            ours, theirs = os.pipe()
            child = subprocess.Popen(
                [sys.executable, "-c", code, end], stdin=ours, stdout=subprocess.PIPE, text=True
            )
            os.close(ours)
            pid, target = child.communicate(timeout=60)[0].split()
            self.assertEqual(child.returncode, -9 if end == "kill" else 0)
            if end == "kill":
                with self.assertRaises(planish.Unavailable):
                    while True:  # it ends by itself, a moment later
                        with planish.Client(target, retry=planish.RetryPolicy(retry_seconds=0)) as client:
                            client.capabilities()
                shutil.rmtree(os.path.dirname(target[len("unix:") :]))  # nobody was left to do that
            else:
                self.assertFalse(os.path.exists(f"/proc/{pid}/exe"))
                self.assertFalse(os.path.exists(os.path.dirname(target[len("unix:") :])))
            os.close(theirs)

    def test_pool_leaves_nothing_behind(self):
        # Children that have no server to inherit start their own, and end it.
        with tempfile.TemporaryDirectory(prefix="planish-") as base:
            environment = {**os.environ, "TMPDIR": base, "XDG_RUNTIME_DIR": ""}
            code = """if True:
                import multiprocessing, test_processes
                if __name__ == "__main__":
                    for method in ("fork", "spawn"):
                        pool = multiprocessing.get_context(method).Pool(2)
                        print([usable for _, usable, _ in pool.map(test_processes.unwrap_without_address, range(2), chunksize=1)])
                        pool.close()
                        pool.join()
            """
            self.assertEqual(support.run_python(code, env=environment).split("\n")[:2], ["[True, True]"] * 2)
            self.assertEqual(os.listdir(base), [])

    def test_private_server(self):
        with planish.PrivateServer(workers=2, threads=1, extra_arguments=["--queue=3"]) as server:
            capabilities = planish.Client(server.target).capabilities()
            self.assertEqual((capabilities.workers, capabilities.threads, capabilities.queue_capacity), (2, 1, 3))
            self.assertEqual(support.children(), [server.pid])
            self.assertEqual(server.log(), "")
            directory = os.path.dirname(server.target[len("unix:") :])
            self.assertEqual(os.stat(directory).st_mode & 0o777, 0o700)
        self.assertFalse(server.is_running)
        self.assertFalse(os.path.exists(directory))
        server = planish.PrivateServer()
        directory = os.path.dirname(server.target[len("unix:") :])
        del server
        self.assertEqual((support.children(), os.path.exists(directory)), ([], False))
        with planish.PrivateServer() as server:
            client = planish.Client(server.target, retry=planish.RetryPolicy(reattach_seconds=0.2))
            self.assertTrue(client.unwrap(*support.cube()).is_usable)
            os.kill(server.pid, 9)
            with self.assertRaises(planish.Unavailable) as raised:
                client.unwrap(*support.bump())
            self.assertEqual(raised.exception.reason, "CONNECTION_LOST")


if __name__ == "__main__":
    unittest.main()
