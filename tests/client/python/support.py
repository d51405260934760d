"""Meshes, servers and scripts for the tests of the Python package."""

import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile

import numpy as np
from ports import free_port

PLANISHD = os.environ["PLANISHD"]
PLANISH = os.environ["PLANISH_COMMAND"]
SOURCE_TREE = pathlib.Path(os.environ["PLANISH_SOURCE_TREE"])


def grid(columns, rows, at):
    """Two triangles for each cell; `at(s, t)` gives the positions of arrays s, t in [0, 1]."""
    s, t = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    positions = np.stack(at(s.ravel(), t.ravel()), axis=1)
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    c = a + columns + 1
    triangles = np.stack([np.stack([a, a + 1, c + 1], 1), np.stack([a, c + 1, c], 1)], 1).reshape(-1, 3)
    return positions, triangles


def bump(n=12, height=0.6):
    """A disc: a square with a bump."""
    return grid(n, n, lambda s, t: (s, t, height * np.exp(-16 * ((s - 0.5) ** 2 + (t - 0.5) ** 2))))


def ball(n=8):
    """A closed surface: a cube of n x n cells a side, blown up."""
    positions, triangles = [], []
    for axis in range(3):
        for sign in (-1, 1):
            side, faces = grid(n, n, lambda s, t: (2 * s - 1, 2 * t - 1, 1 + 0 * s))
            side = np.roll(side * (1, 1, sign), axis, axis=1)
            triangles.append((faces if sign > 0 else faces[:, ::-1]) + sum(len(p) for p in positions))
            positions.append(side)
    unique, inverse = np.unique(np.concatenate(positions).round(9), axis=0, return_inverse=True)
    unique /= np.linalg.norm(unique, axis=1, keepdims=True)
    return unique, inverse.reshape(-1)[np.concatenate(triangles)]


def cube():
    """Twelve triangles, eight vertices."""
    return ball(1)


def uv_areas(uv):
    """Signed, of each triangle."""
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def write_obj(path, positions, triangles):
    with open(path, "w", encoding="ascii") as file:
        file.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in np.asarray(positions, np.float32).astype(float).tolist())
        file.writelines(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in np.asarray(triangles).tolist())


def read_obj(path):
    """Positions, triangles, and UV of each corner or None."""
    positions, uv, triangles, corners = [], [], [], []
    with open(path, encoding="ascii") as file:
        for line in file:
            word, *rest = line.split() or [""]
            if word == "v":
                positions.append([float(x) for x in rest[:3]])
            elif word == "vt":
                uv.append([float(x) for x in rest[:2]])
            elif word == "f":
                parts = [corner.split("/") for corner in rest]
                triangles.append([int(part[0]) - 1 for part in parts])
                if len(parts[0]) > 1 and parts[0][1]:
                    corners.append([int(part[1]) - 1 for part in parts])
    return np.array(positions), np.array(triangles), np.array(uv)[np.array(corners)] if corners else None


class Server:
    """A planishd at an address that stays the same when it is killed and started again. Ends with this process."""

    def __init__(self, *flags, target=None):
        self.directory = tempfile.TemporaryDirectory(prefix="planish-test-")
        self.target = target or f"unix:{self.directory.name}/socket"
        self._flags = flags
        self._process = None
        self.start()

    def start(self):
        ours, theirs = socket.socketpair()
        flags = [f"--listen={self.target}", f"--supervisor-fd={theirs.fileno()}", "--log-level=error", *self._flags]
        with theirs:
            self._process = subprocess.Popen([PLANISHD, *flags], pass_fds=[theirs.fileno()], start_new_session=True)
        self._supervisor = ours
        ours.settimeout(60)
        said = ours.recv(64)
        if said != b"ready\n":
            raise AssertionError(f"planishd said {said!r}")

    def stop_workers(self):
        """No job makes progress any more, until kill()."""
        workers = children(None, self._process.pid)
        if not workers:
            raise AssertionError("planishd has no workers")
        for worker in workers:
            os.kill(worker, signal.SIGSTOP)

    def kill(self):
        """With its workers, which end with it."""
        os.kill(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._supervisor.close()

    def close(self):
        self._supervisor.close()
        self._process.wait(60)
        self.directory.cleanup()


def secure_server(directory):
    """A server with TLS that asks for a token, and the path of a file of deploy/certificates.sh by its name."""
    subprocess.run([SOURCE_TREE / "deploy/certificates.sh", directory], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def path(name):
        return os.path.join(directory, name)

    flags = {"tls-cert": "server.pem", "tls-key": "server-key.pem", "access-file": "access.yaml"}
    return Server(*(f"--{flag}={path(name)}" for flag, name in flags.items()), target=f"127.0.0.1:{free_port()}"), path


def run_python(code, *arguments, **more):
    """Runs a program in a Python of its own; what it printed."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=120, **more
    )
    if done.returncode != 0:
        raise AssertionError(f"exit code {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


def children(program="planishd", parent=None):
    """Process ids of the programs of that name, or of all (None), that `parent`, or this process, has started and not lost."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            name, _, rest = (entry / "stat").read_text().partition("(")[2].rpartition(")")
        except OSError:
            continue  # it has ended meanwhile
        if program in (None, name) and int(rest.split()[1]) == (parent or os.getpid()):
            found.append(int(entry.name))
    return sorted(found)
