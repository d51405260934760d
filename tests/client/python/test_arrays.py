"""What needs no server: arrays, seams, splitting, options, errors, patience."""

import dataclasses
import os
import pickle
import random
import sys
import tempfile
import unittest
from unittest import mock

import numpy as np

import planish
import support
from planish import job
from planish._connection import Connection, ConnectionOptions
from planish._request import new_job, spec_message
from planish._retry import Deadline, Patience, RetryPolicy
from planish.mesh import chart_of_faces, pack_mesh
from planish.v1 import job_pb2, options_pb2


class Arrays(unittest.TestCase):
    """Each is refused with an error that names the argument, before there is a server to send it to."""

    def refused(self, argument, reason, positions=None, triangles=None, **more):
        good = support.cube()
        positions = good[0] if positions is None else positions
        triangles = good[1] if triangles is None else triangles
        with mock.patch.object(planish.client.BlockingTransport, "_method", side_effect=AssertionError("sent")):
            client = planish.Client("unix:/nowhere")
            with self.assertRaises(planish.ArrayError) as raised:
                client.unwrap(positions, triangles, **more)
        self.assertEqual(raised.exception.argument, argument)
        self.assertTrue(str(raised.exception).startswith(argument), str(raised.exception))
        self.assertEqual(raised.exception.reason, reason)
        self.assertIsInstance(raised.exception, ValueError)
        return raised.exception

    def test_positions(self):
        positions, _ = support.cube()
        for value in (np.nan, np.inf, -np.inf, 1e39):
            bad = positions.copy()
            bad[5, 1] = bad[7, 2] = value
            error = self.refused("positions", "MESH_POSITION_NOT_FINITE", positions=bad)
            self.assertIn("positions[5, 1]", str(error))
            self.assertEqual(error.vertices, [5, 7])
        for bad in (positions[:, :2], positions.ravel(), positions[None], 3.0):
            self.refused("positions", "MESH_POSITION_INVALID", positions=bad)
        for dtype in (complex, str, object, bool):
            self.refused("positions", "MESH_POSITION_INVALID", positions=positions.astype(dtype))
        self.refused("positions", "MESH_POSITION_INVALID", positions=[[1, 2, 3], [4, 5]])

    def test_triangles(self):
        _, triangles = support.cube()
        for value, dtype in ((8, np.int64), (-1, np.int32), (255, np.uint8), (2**32 - 1, np.uint32), (2**63, np.uint64)):
            bad = triangles.astype(dtype)
            bad[4, 2] = np.array(value).astype(dtype)
            error = self.refused("triangles", "MESH_INDEX_OUT_OF_RANGE", triangles=bad)
            self.assertIn(f"triangles[4, 2] is {value}", str(error))
            self.assertEqual(error.faces, [4])
        for bad in (triangles.astype(float), triangles[:, :2], triangles.ravel(), triangles.astype(str)):
            self.refused("triangles", "MESH_INDEX_OUT_OF_RANGE", triangles=bad)
        self.refused("triangles", "MESH_EMPTY", triangles=triangles[:0])
        self.refused("triangles", "MESH_EMPTY", triangles=[])

    def test_seams(self):
        for name in ("seam_corners", "uncut_corners"):
            for bad in ([36], [-1], [0.5], [[1]]):
                self.refused(name, "OPTIONS_INVALID", **{name: bad})
        for bad in ([[0, 0]], [[0, 99]], [[-1, 2]], [[0, 2**33]], [0, 1], [[0.5, 1]]):
            self.refused("seam_edges", "OPTIONS_INVALID", seam_edges=bad)
        for bad in ([1, 2], np.zeros((12, 1), int), np.zeros(12)):
            self.refused("parts", "OPTIONS_INVALID", parts=bad)

    def test_numbers_of_faces(self):
        for bad in ([0] * 11, [[0]] * 12, [0.5] * 12, [0] * 11 + [-1]):
            self.refused("face_atlas", "OPTIONS_INVALID", face_atlas=bad)
        for bad in ([1] * 13, [1] * 11 + [0.001], [1] * 11 + [np.nan], ["a"] * 12):
            self.refused("face_weights", "OPTIONS_INVALID", face_weights=bad)
        error = self.refused("face_weights", "OPTIONS_INVALID", face_weights=[1, 101] + [1] * 10)
        self.assertEqual(error.metadata["face"], "1")
        positions, triangles = support.cube()
        labels = np.arange(12, dtype=np.uint8) // 6
        job = new_job(positions, triangles, None, None, None, "", {"face_atlas": labels, "face_weights": 1 + labels})
        packed = job.pack()
        spec = spec_message(job, packed)
        self.assertEqual(np.frombuffer(spec.elements.face_atlas, "<u4").tolist(), labels.tolist())
        self.assertEqual(np.frombuffer(spec.elements.face_weights, "<f4").tolist(), (1.0 + labels).tolist())
        self.assertEqual(packed.byte_count, pack_mesh(positions, triangles).byte_count + 2 * 4 * 12)

    def test_what_numpy_takes_is_taken(self):
        positions, triangles = support.cube()
        plain = pack_mesh(positions.tolist(), triangles.tolist())
        for p, t in (
            (positions.astype(">f8"), triangles.astype(">i2")),
            (np.asfortranarray(positions), np.asfortranarray(triangles.astype(np.uint8))),
            (positions[::-1][::-1], triangles.astype(np.uint64)),
        ):
            packed = pack_mesh(p, t)
            self.assertEqual((packed.positions, packed.triangles), (plain.positions, plain.triangles))
        self.assertEqual(plain.sha256(), pack_mesh(positions.astype(np.float32), triangles).sha256())
        self.assertEqual(plain.triangle_count, 12)

    def test_positions_far_from_the_origin_keep_their_digits(self):
        positions, triangles = support.cube()
        fine = positions / 1024 + 1 / 3
        near = positions * 1.1
        self.assertEqual(pack_mesh(near, triangles).positions, near.astype("<f4").tobytes(), "near the origin: as it is")
        corners = fine - fine[0]
        for offset in ((20000, 0, 0), (-500000, 4000000, 300), (20000.25, 20000.5, -20000.75)):
            packed = np.frombuffer(pack_mesh(fine + offset, triangles).positions, "<f4").reshape(-1, 3).astype(float)
            self.assertLess(np.abs(packed - packed[0] - corners).max(), 1e-8, offset)
            floats = (fine + offset).astype(np.float32)
            self.assertEqual(pack_mesh(floats, triangles).positions, floats.tobytes(), "floats travel as they are")
            self.assertEqual(pack_mesh(floats.astype(float), triangles).positions, floats.tobytes())
        stray = np.vstack([fine + 20000, [[1e30, 0, 0]]])
        packed = np.frombuffer(pack_mesh(stray, triangles).positions, "<f4").reshape(-1, 3)[:-1].astype(float)
        self.assertLess(np.abs(packed - packed[0] - corners).max(), 1e-8, "a vertex without a triangle does not count")

    def test_every_option_is_a_keyword(self):
        for described in options_pb2.UnwrapOptions.DESCRIPTOR.fields:
            default = getattr(planish.UnwrapOptions(), described.name)
            if described.enum_type is None:
                value = 64 if described.type == described.TYPE_INT32 else 0.5
            elif isinstance(default, bool):
                value = not default
            else:
                names = (job.enum_name(described.enum_type, each.number) for each in described.enum_type.values if each.number)
                value = next(name for name in names if name != default)
            given = new_job(None, None, None, None, None, "", {described.name: value})
            with self.subTest(described.name):
                sent, plain = (spec_message(each, None).options for each in (given, new_job(None, None, None, None, None, "", {})))
                self.assertNotEqual(getattr(sent, described.name), getattr(plain, described.name))

    def test_every_field_of_a_report_arrives(self):
        marks = {}

        def fill(message):
            for described in message.DESCRIPTOR.fields:
                mark = marks[described.full_name] = 100 + len(marks)
                repeated = described.label == described.LABEL_REPEATED
                if described.message_type is not None:
                    del marks[described.full_name]
                    if described.message_type.GetOptions().map_entry:
                        continue
                    own = getattr(message, described.name)
                    own = own.add() if repeated else own
                    if described.message_type.name == "Duration":
                        own.seconds = marks[described.full_name] = mark
                    else:
                        own.SetInParent()
                        fill(own)
                elif described.enum_type is not None:
                    last = described.enum_type.values[-1]
                    setattr(message, described.name, last.number)
                    marks[described.full_name] = job.enum_name(described.enum_type, last.number)
                elif described.type == described.TYPE_STRING:
                    marks[described.full_name] = f"text {mark}"
                    setattr(message, described.name, f"text {mark}")
                elif described.type == described.TYPE_BOOL:
                    marks[described.full_name] = True
                    setattr(message, described.name, True)
                elif repeated:
                    getattr(message, described.name).append(mark)
                else:
                    setattr(message, described.name, mark)

        def values(of):
            if isinstance(of, (dict, list)):
                for each in of.values() if isinstance(of, dict) else of:
                    yield from values(each)
            else:
                yield of

        message = job_pb2.Job()
        fill(message.report)
        fill(message.progress)
        found = set(values(dataclasses.asdict(job.from_proto(planish.Job, message))))
        self.assertGreater(len(marks), 80)
        self.assertEqual({name: mark for name, mark in marks.items() if mark not in found}, {})

    def test_names_of_options(self):
        with self.assertRaisesRegex(TypeError, "'paddding'"):
            new_job(None, None, None, None, None, "", {"paddding": 3})
        for bad in ({"seams": "some"}, {"effort": 3}, {"padding": 1.5}, {"max_stretch": "much"}):
            with self.assertRaises(planish.InvalidArgument) as raised:
                spec_message(new_job(None, None, None, None, None, "", bad), None)
            self.assertEqual(raised.exception.metadata, {"field": next(iter(bad))})
        given = planish.UnwrapOptions(padding=np.int64(0), pack=False, solver="minres", seams="keep")
        options = spec_message(new_job(None, None, given, None, None, "", {"seams": "none"}), None).options
        self.assertTrue(options.HasField("padding"))
        self.assertEqual((options.pack, options.solver, options.seams), (options_pb2.PACK_OFF, options_pb2.SOLVER_MINRES, options_pb2.SEAMS_NONE))

    def test_every_option_of_the_api_is_there(self):
        names = set(options_pb2.UnwrapOptions.DESCRIPTOR.fields_by_name)
        self.assertEqual(names, set(planish.UnwrapOptions.__dataclass_fields__))


class Seams(unittest.TestCase):
    def edges_of(self, corners, triangles):
        f, k = np.divmod(corners, 3)
        pairs = np.stack([triangles[f, (k + 1) % 3], triangles[f, (k + 2) % 3]], 1)
        return {tuple(sorted(pair)) for pair in pairs.tolist()}

    def test_edges(self):
        positions, triangles = support.ball(3)
        wanted = {tuple(sorted(triangles[i, :2].tolist())) for i in range(0, len(triangles), 7)}
        packed = pack_mesh(positions, triangles, seam_edges=[(b, a) for a, b in sorted(wanted)] * 2)
        corners = packed.elements["seam_corners"]
        self.assertEqual(self.edges_of(corners, triangles), wanted)
        self.assertEqual(len(corners), len(wanted))
        self.assertEqual(len(pack_mesh(positions, triangles, seam_edges=np.zeros((0, 2))).elements["seam_corners"]), 0)

    def test_diagonals_are_no_edges(self):
        # A quad of two triangles, and a triangle on their common edge.
        positions = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], np.float32)
        triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 2, 4]])
        polygon = [0, 0, 1]
        packed = pack_mesh(positions, triangles, seam_edges=[[2, 0]], face_polygon=polygon)
        self.assertEqual(packed.elements["seam_corners"].tolist(), [8])
        with self.assertRaisesRegex(planish.ArrayError, "no polygon has the edge from vertex 2 to vertex 0"):
            pack_mesh(positions, triangles[:2], seam_edges=[[2, 0]], face_polygon=polygon[:2])
        for bad in ([0, 0], [0, 0, 3], [0, 0, -1]):
            with self.assertRaises(planish.ArrayError):
                pack_mesh(positions, triangles, face_polygon=bad)

    def test_parts(self):
        positions, triangles = support.ball(3)
        rng = np.random.default_rng(1)
        parts = rng.integers(-2, 2, len(triangles))
        faces_of = {}
        for f, face in enumerate(triangles.tolist()):
            for k in range(3):
                faces_of.setdefault(tuple(sorted((face[k], face[k - 1]))), []).append(f)
        wanted = {edge for edge, faces in faces_of.items() if len({parts[f] for f in faces}) > 1}
        packed = pack_mesh(positions, triangles, parts=parts, seam_corners=[0])
        corners = packed.elements["seam_corners"]
        self.assertEqual(corners[0], 0)
        self.assertEqual(self.edges_of(corners[1:], triangles), wanted)


class Splitting(unittest.TestCase):
    def reference(self, vertices, triangles, uv):
        """As planish::SplitVertices of the C++ library says."""
        source, number, triangles_out = list(range(vertices)), {}, []
        first = {}
        for v, pair in zip(triangles.reshape(-1).tolist(), map(tuple, (uv.reshape(-1, 2) + 0.0).tolist())):
            if v not in first:
                first[v] = pair
                number[v, pair] = v
            if (v, pair) not in number:
                number[v, pair] = len(source)
                source.append(v)
            triangles_out.append(number[v, pair])
        vertex_uv = np.zeros((len(source), 2), uv.dtype)
        for (_, pair), n in number.items():
            vertex_uv[n] = pair
        return source, np.array(triangles_out).reshape(-1, 3), vertex_uv

    def test_like_the_library_in_cpp(self):
        rng = np.random.default_rng(7)
        for dtype in (np.float32, np.float64):
            for _ in range(20):
                triangles = rng.integers(0, 9, (int(rng.integers(1, 30)), 3))
                uv = rng.integers(-1, 2, (len(triangles), 3, 2)).astype(dtype) * np.array([0.0, 1.0], dtype)
                split = planish.split_vertices(10, triangles, uv)
                source, out, vertex_uv = self.reference(10, triangles, uv)
                np.testing.assert_array_equal(split.source_vertex, source)
                np.testing.assert_array_equal(split.triangles, out)
                np.testing.assert_array_equal(split.uv, vertex_uv)
                self.assertEqual((split.source_vertex.dtype, split.triangles.dtype, split.uv.dtype), (np.uint32, np.uint32, dtype))

    def test_refuses(self):
        positions, triangles = support.cube()
        for bad in (np.zeros((12, 3)), np.zeros((11, 3, 2)), np.zeros((12, 3, 2), int)):
            with self.assertRaises(planish.ArrayError) as raised:
                planish.split_vertices(8, triangles, bad)
            self.assertEqual(raised.exception.argument, "uv")

    def test_charts(self):
        # Strips of squares of random lengths: each is a chart; their triangles come in random order.
        rng = np.random.default_rng(3)
        lengths = rng.integers(1, 60, 40)
        triangles, chart, start = [], [], 0
        for i, length in enumerate(lengths):
            _, faces = support.grid(int(length), 1, lambda s, t: (s, t, s))
            triangles.append(faces + start)
            chart += [i] * len(faces)
            start += 2 * (int(length) + 1)
        order = rng.permutation(len(chart))
        triangles, chart = np.concatenate(triangles)[order], np.array(chart)[order]
        relabel = rng.permutation(start)
        split = planish.VertexSplit(np.arange(start), relabel[triangles], np.zeros((start, 2)))
        found = chart_of_faces(split)
        self.assertEqual(len(set(zip(found.tolist(), chart.tolist()))), len(lengths))
        self.assertEqual(found.max() + 1, len(lengths))
        self.assertEqual(list(dict.fromkeys(found.tolist())), list(range(len(lengths))))


class Errors(unittest.TestCase):
    def test_travel_between_processes(self):
        error = planish.ArrayError("uv is wrong", argument="uv", reason="R", metadata={"edges": "1-2,3-4"}, job="jobs/1")
        again = pickle.loads(pickle.dumps(error))
        self.assertEqual(vars(again), vars(error))
        self.assertIsInstance(again, planish.ArrayError)
        self.assertEqual(again.edges, [(1, 2), (3, 4)])
        self.assertEqual(str(again), str(error))

    def test_name_the_first_elements_once(self):
        self.assertEqual(str(planish.Error("2 faults", metadata={"edges": "1-2,3-4", "count": "2"})), "2 faults (edges 1-2, 3-4)")
        error = planish.InvalidArgument("6 faults", metadata={"faces": "3,5,6,7,8,9", "vertices": "4"})
        self.assertEqual(str(error), "6 faults (faces 3, 5, 6, 7, ...; vertex 4)")
        self.assertEqual(error.message, "6 faults")

    def test_every_code_has_its_class(self):
        import grpc

        for code in grpc.StatusCode:
            if code is not grpc.StatusCode.OK:
                self.assertEqual(planish.errors.class_of(code.value[0]).code, code.name)


class Environment(unittest.TestCase):
    def connect(self, target, **options):
        return Connection(target, ConnectionOptions(**options).with_environment(), 1.0)

    def test_tokens(self):
        with tempfile.TemporaryDirectory() as directory, mock.patch.dict(os.environ):
            path = os.path.join(directory, "token")
            with open(path, "w", encoding="ascii") as file:
                file.write(" from-file\n")
            self.assertEqual(self.connect("127.0.0.1:1").metadata(), [])
            os.environ["PLANISH_TOKEN"] = "from-environment"
            self.assertEqual(self.connect("127.0.0.1:1").metadata(), [("authorization", "Bearer from-environment")])
            os.environ["PLANISH_TOKEN_FILE"] = path
            connection = self.connect("localhost:1")
            self.assertEqual(connection.metadata(), [("authorization", "Bearer from-file")])
            with open(path, "w", encoding="ascii") as file:
                file.write("changed")
            self.assertEqual(connection.metadata(), [("authorization", "Bearer changed")])
            self.assertEqual(self.connect("[::1]:1", token="own").metadata(), [("authorization", "Bearer own")])
            with self.assertRaisesRegex(planish.InvalidArgument, "unencrypted"):
                self.connect("farm:7741")
            self.connect("farm:7741", token_over_plaintext=True)
            self.connect("farm:7741", tls=True)
            os.environ["PLANISH_TLS"] = "yes"
            self.connect("farm:7741")
            os.environ["PLANISH_TLS"] = "perhaps"
            with self.assertRaisesRegex(planish.InvalidArgument, "PLANISH_TLS"):
                self.connect("farm:7741")

    def test_files(self):
        for options in ({"tls_ca_file": "/nowhere"}, {"tls_ca_file": __file__}, {"tls_cert_file": "a"}, {"token_file": "/nowhere"}):
            with self.assertRaises(planish.InvalidArgument) as raised:
                self.connect("localhost:1", **options)
            self.assertEqual(raised.exception.reason, "OPTIONS_INVALID")
        with self.assertRaisesRegex(planish.InvalidArgument, "ASCII"):
            self.connect("localhost:1", token="a b")

    def test_planishd(self):
        with mock.patch.dict(os.environ, PLANISHD="/nowhere/planishd"):
            with self.assertRaisesRegex(planish.Unavailable, "PLANISHD is /nowhere/planishd") as raised:
                planish.PrivateServer()
            self.assertEqual(raised.exception.reason, "PRIVATE_SERVER_FAILED")
        with mock.patch.dict(os.environ, PLANISHD="", PATH=os.path.dirname(support.PLANISHD)):
            beside = os.path.join(os.path.dirname(sys.executable), "planishd")
            self.assertIn(planish.find_planishd(), (support.PLANISHD, beside))
        with self.assertRaisesRegex(planish.Unavailable, "exited with code"):
            planish.PrivateServer(executable=support.PLANISHD, extra_arguments=["--no-such-flag"])


class PatienceEnds(unittest.TestCase):
    LOST = planish.Unavailable("gone", reason="SERVER_UNREACHABLE")
    FULL = planish.ResourceExhausted("full", reason="QUEUE_FULL", retry_after_seconds=2.0)

    def patience(self, lost=10.0, room=5.0, deadline=None):
        return Patience(RetryPolicy(), Deadline(deadline), lost_seconds=lost, room_seconds=room)

    def test_backs_off(self):
        random.seed(1)
        patience = self.patience(lost=100)
        pauses = [patience.pause(self.LOST, reached=True, target="t") for _ in range(9)]
        for i, pause in enumerate(pauses):
            longest = min(5.0, 0.1 * 2**i)
            self.assertTrue(longest / 2 <= pause <= longest, pauses)
        patience.succeeded()
        self.assertLessEqual(patience.pause(self.LOST, reached=True, target="t"), 0.1)

    def test_gives_up(self):
        with self.assertRaises(planish.Unavailable) as raised:
            self.patience().pause(self.LOST, reached=False, target="t")
        self.assertIs(raised.exception, self.LOST)
        with mock.patch("planish._retry.time.monotonic", side_effect=range(100)):
            patience = self.patience(lost=4.0)
            with self.assertRaises(planish.Unavailable) as raised:
                for _ in range(10):
                    patience.pause(self.LOST, reached=True, target="t")
        self.assertEqual(raised.exception.reason, "CONNECTION_LOST")
        for error in (planish.InvalidArgument("x"), planish.Internal("x", reason="WORKER_CRASHED"), planish.NotFound("x")):
            with self.assertRaises(type(error)):
                self.patience().pause(error, reached=True, target="t")
        self.patience().pause(planish.Internal("reset"), reached=True, target="t")

    def test_waits_for_room_as_long_as_asked(self):
        patience = self.patience()
        self.assertEqual(patience.pause(self.FULL, reached=False, target="t"), 2.0)
        self.assertEqual(patience.pause(self.FULL, reached=False, target="t"), 2.0)
        with self.assertRaises(planish.ResourceExhausted):
            patience.pause(self.FULL, reached=False, target="t")
        with self.assertRaises(planish.DeadlineExceeded):
            self.patience(deadline=1.0).pause(self.FULL, reached=False, target="t")
        with self.assertRaises(planish.InvalidArgument):
            Deadline(0)


if __name__ == "__main__":
    unittest.main()
