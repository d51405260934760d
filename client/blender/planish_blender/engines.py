"""Two engines that unwrap a mesh: the Python package and the command. Nothing here uses Blender."""

import importlib
import importlib.util
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np

#: Maximal number of unwraps that run at the same time.
MOST_AT_A_TIME = 4
#: The stages of a job, in their order.
STAGES = ("decode", "charts", "solve", "layout", "pack", "verify", "encode")


@dataclass(frozen=True)
class Settings:
    """Which server to use, and how to connect to it."""

    where: str = "AUTO"  # or "PRIVATE", "SERVER"
    address: str = ""
    tls: bool = False
    tls_ca_file: str = ""
    token: str = ""
    token_file: str = ""
    online: bool = True  # whether Blender's preferences allow access to a network
    engine: str = "AUTO"  # or "PACKAGE", "COMMAND"
    planishd: str = ""
    command: str = ""


class Options:
    """Options of an unwrap, named as in planish.UnwrapOptions and the command's flags. Options that are left out have the server's
    default."""

    def __init__(self, seams="auto", **others):
        self.seams = seams
        self.others = others

    def flags(self):
        texts = ((name, f"{value:.9g}" if isinstance(value, float) else value) for name, value in self.others.items())
        return [f"--{name.replace('_', '-')}={text}" for name, text in texts]


@dataclass
class Outcome:
    uv: Any  # (F, 3, 2) float32
    charts: int
    stretch: float
    efficiency: float
    warnings: list  # as sentences
    images: Any = None  # transfer.Images, if the sheet's textures were moved


class Failed(Exception):
    """A failed unwrap. Element ids refer to the caller's arrays."""

    def __init__(self, message, reason="", faces=(), edges=(), vertices=()):
        super().__init__(message)
        self.reason = reason
        self.faces, self.edges, self.vertices = list(faces), list(edges), list(vertices)


@dataclass
class Progress:
    stage: str = ""
    chart: int = 0
    chart_count: int = 0
    newton_iteration: int = 0
    stage_fraction: float = 0.0

    def __str__(self):
        if self.stage != "solve" or self.chart_count == 0:
            return self.stage or "waiting"
        return f"solve, chart {self.chart + 1} of {self.chart_count}, Newton step {self.newton_iteration}"

    @property
    def fraction(self):
        if self.stage not in STAGES:
            return 0.0
        within = self.chart / self.chart_count if self.stage == "solve" and self.chart_count else self.stage_fraction
        return (STAGES.index(self.stage) + within) / len(STAGES)


def engine(settings):
    """The available engine, as a function start(sheet, options) -> call. Raises Failed if no engine is available."""
    if settings.where == "SERVER" and not settings.address:
        raise Failed("The preferences of the add-on ask for a server at an address, but name none")
    named = _named_server(settings)
    if not settings.online and named and not _is_local(named):
        raise Failed(f"The server {named} is on a network, and Blender's preferences do not allow that: System > Network > Allow Online Access")
    why = ""
    if settings.engine != "COMMAND":
        try:
            client = _client(settings, _package())
            return lambda sheet, options: _PackageCall(client, sheet, options)
        except _NoPackage as error:
            why = f"the Python package cannot be used ({error})"
            if settings.engine == "PACKAGE":
                raise Failed(f"T{why[1:]}; grpcio and protobuf must be installed in Blender's Python") from error
    try:
        command = find_command(settings)
    except Failed as missing:
        note = f"; {why}" if why else ""
        raise Failed(f"No way to a planish server: {missing}{note}. The preferences of the add-on name the programs") from missing
    return lambda sheet, options: _CommandCall(command, settings, sheet, options)


def find_command(settings):
    """The path of the command `planish`. Raises Failed if there is none."""
    command = settings.command or _own_command() or shutil.which("planish")
    if not command or not os.path.isfile(command):
        raise Failed(f"{command} is not a program" if command else "there is no planish command in PATH")
    return command


def _named_server(settings):
    """The address of the chosen server; empty: a private one."""
    if settings.where == "PRIVATE":
        return ""
    return settings.address if settings.where == "SERVER" else os.environ.get("PLANISH_SERVER", "")


def _is_local(target):
    host = target.rpartition(":")[0].strip("[]")
    return target.startswith(("unix:", "unix-abstract:")) or host in ("localhost", "::1") or host.startswith("127.")


# The Python package -----------------------------------------------------------------------------------------------------


class _NoPackage(Exception):
    pass


def _package():
    """The installed package `planish`, or the add-on's own."""
    had_alias = "__mp_main__" in sys.modules
    try:
        try:
            return importlib.import_module("planish")
        except ModuleNotFoundError as error:
            if error.name != "planish":
                raise
        sys.path.append(os.path.join(os.path.dirname(__file__), "lib"))
        return importlib.import_module("planish")
    except Exception as error:  # grpcio is missing, or does not go with protobuf
        raise _NoPackage(str(error)) from error
    finally:
        # Importing multiprocessing gives __main__ this second name. Blender frees __main__ at the end of a script, and
        # would crash when it visits all modules before it quits.
        if not had_alias:
            sys.modules.pop("__mp_main__", None)


def _own_command():
    """The command in the package's wheel for Linux; it works without grpcio."""
    spec = importlib.util.find_spec("planish")
    path = os.path.join(os.path.dirname(spec.origin), "_programs.py") if spec and spec.origin else ""
    if not os.path.isfile(path):
        return None
    module = importlib.util.module_from_spec(importlib.util.spec_from_file_location("planish_programs", path))
    module.__spec__.loader.exec_module(module)
    return module.own_program("planish")


_clients = {}  # by their settings
_servers = {}  # private ones, by their program


def _private_server(package, program):
    server = _servers.get(program)
    if server is None or not server.is_running:
        workers = max(1, min(MOST_AT_A_TIME, (os.cpu_count() or 1) // 2))
        server = _servers[program] = package.PrivateServer(executable=program or None, workers=workers)
    return server


def _client(settings, package):
    try:
        named = _named_server(settings)
        if not named:
            target, connection = _private_server(package, settings.planishd).target, None
        else:
            target = named
            connection = package.ConnectionOptions(
                tls=settings.tls or None,
                tls_ca_file=settings.tls_ca_file or None,
                token=None if settings.token_file else settings.token or None,
                token_file=settings.token_file or None,
            )
        key = (target, connection)
        if key not in _clients:
            _clients.clear()
            _clients[key] = package.Client(target, connection=connection)
        return _clients[key]
    except package.Error as error:
        raise Failed(error.message, error.reason) from error


def close():
    """Ends connections and private servers."""
    for each in (*_clients.values(), *_servers.values()):
        each.close()
    _clients.clear()
    _servers.clear()


class _PackageCall:
    """An unwrap by the package, on its own thread."""

    def __init__(self, client, sheet, options):
        self.sheet = sheet
        self.progress = Progress()
        self._package = _package()
        try:
            self._call = client.start_unwrap(
                sheet.positions,
                sheet.triangles,
                seam_corners=sheet.seam_corners,
                face_polygon=sheet.polygon,
                seams=options.seams,
                precision="float",
                **options.others,
                labels={"file": sheet.name[:60]},
                on_progress=self._note,
            )
        except self._package.Error as error:
            raise self._failed(error) from error

    def _note(self, progress):
        self.progress = Progress(**{name: getattr(progress, name) for name in Progress.__dataclass_fields__})

    def done(self):
        return self._call.done()

    def wait(self, seconds):
        return self._call.wait(seconds)

    def cancel(self):
        """Cancels the job. Returns at once; the call ends soon after."""
        threading.Thread(target=self._cancel, daemon=True).start()

    def _cancel(self):
        try:
            self._call.cancel()
        except self._package.Error:
            pass  # the call itself reports its outcome

    def result(self):
        try:
            result = self._call.result()
        except self._package.Error as error:
            raise self._failed(error) from error
        quality = result.report.quality
        return Outcome(
            uv=result.uv,
            charts=result.chart_count,
            stretch=quality.stretch_l2,
            efficiency=quality.packing_efficiency,
            warnings=[warning.message for warning in result.warnings],
        )

    @staticmethod
    def _failed(error):
        return Failed(error.message, error.reason, error.faces, error.edges, error.vertices)


# The command ------------------------------------------------------------------------------------------------------------


class _CommandCall:
    """An unwrap by the command: a process that reads a file and writes one, in its own directory."""

    def __init__(self, command, settings, sheet, options):
        self.sheet = sheet
        self.progress = Progress()
        self._directory = tempfile.TemporaryDirectory(prefix="planish-blender-")
        self._cancelled = False
        self._last_line = ""
        arguments, environment = self._prepare(command, settings, options)
        try:
            self._process = subprocess.Popen(
                arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, text=True
            )
        except OSError as error:
            self._directory.cleanup()
            raise Failed(f"{command} cannot be started: {error.strerror}") from error
        self._answer = ""
        self._threads = [threading.Thread(target=read, daemon=True) for read in (self._read_events, self._read_answer)]
        for thread in self._threads:
            thread.start()

    def _path(self, name):
        return os.path.join(self._directory.name, name)

    def _prepare(self, command, settings, options):
        sheet = self.sheet
        faces = sheet.triangles
        with open(self._path("mesh.obj"), "w", encoding="ascii") as file:
            file.write("v %.9g %.9g %.9g\n" * len(sheet.positions) % tuple(sheet.positions.reshape(-1).tolist()))
            # Each corner gets the number of its loop as the index of its normal, which the command writes out again.
            loop = 0
            for total in sheet.loop_total.tolist():
                corners = range(loop, loop + total)
                file.write("f " + " ".join(f"{sheet.loop_vertex[c] + 1}//{c + 1}" for c in corners) + "\n")
                loop += total
        seams = [options.seams]
        if len(sheet.seam_corners) > 0:
            f, k = np.divmod(sheet.seam_corners, 3)
            ends = np.stack([faces[f, (k + 1) % 3], faces[f, (k + 2) % 3]], axis=1) + 1
            ends = np.unique(np.sort(ends, axis=1), axis=0)
            with open(self._path("edges"), "w", encoding="ascii") as file:
                file.write("%d %d\n" * len(ends) % tuple(ends.reshape(-1).tolist()))
            seams.append(f"edges:{self._path('edges')}")
        arguments = [command, "unwrap", self._path("mesh.obj"), "-o", self._path("uv.obj"), "--json", "--progress=json"]
        arguments += ["--precision=float", f"--seams={','.join(seams)}", *options.flags()]
        arguments += [f"--label=file={sheet.name[:60]}"]
        environment = dict(os.environ)
        if settings.planishd:
            environment["PLANISHD"] = settings.planishd
        if settings.where == "PRIVATE":
            environment.pop("PLANISH_SERVER", None)
        elif settings.where == "SERVER":
            arguments.append(f"--server={settings.address}")
        if settings.where != "PRIVATE":
            if settings.tls:
                arguments.append("--tls")
            if settings.tls_ca_file:
                arguments.append(f"--tls-ca={settings.tls_ca_file}")
            if settings.token_file:
                arguments.append(f"--token-file={settings.token_file}")
            elif settings.token:
                environment.pop("PLANISH_TOKEN_FILE", None)
                environment["PLANISH_TOKEN"] = settings.token
        return arguments, environment

    def _read_events(self):
        for line in self._process.stderr:
            if not line.startswith("{"):
                self._last_line = line.strip() or self._last_line
                continue
            try:
                progress = json.loads(line).get("progress")
            except ValueError:
                continue  # the end of a truncated line
            if progress:
                self.progress = Progress(**{name: progress[name] for name in Progress.__dataclass_fields__})

    def _read_answer(self):
        self._answer = self._process.stdout.read()

    def done(self):
        return self._process.poll() is not None

    def wait(self, seconds):
        try:
            self._process.wait(seconds)
            return True
        except subprocess.TimeoutExpired:
            return False

    def cancel(self):
        """Like Ctrl-C: the command cancels its job on the server."""
        self._cancelled = True
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def result(self):
        self._process.wait()
        for thread in self._threads:
            thread.join()
        self._process.stdout.close()
        self._process.stderr.close()
        try:
            return self._outcome()
        finally:
            self._directory.cleanup()

    def _outcome(self):
        try:
            report = json.loads(self._answer)
        except ValueError:
            report = {}
        if self._cancelled and self._process.returncode != 0:
            raise Failed("the job was cancelled", "CANCELLED")
        if report.get("state") != "SUCCEEDED":
            error = report.get("error") or {}
            metadata = error.get("metadata") or {}
            message = error.get("message") or self._last_line or f"planish ended with {self._process.returncode} and said nothing"
            polygons, edges, vertices = _elements(metadata)
            faces = np.searchsorted(self.sheet.polygon, polygons).tolist()  # the first triangle of each polygon
            raise Failed(message, error.get("reason", ""), faces, edges, vertices)
        return Outcome(
            uv=_read_loop_uv(self._path("uv.obj"), len(self.sheet.loop_vertex))[self.sheet.loops],
            charts=report["chart_totals"]["charts"],
            stretch=report["quality"]["stretch_l2"],
            efficiency=report["quality"]["packing_efficiency"],
            warnings=[warning["message"] for warning in report["warnings"]],
        )


def _elements(metadata):
    def text(*keys):
        return ",".join(metadata.get(key, "") for key in keys)

    faces = [int(digits) for digits in re.findall(r"\d+", text("face", "faces"))]
    edges = [(int(a), int(b)) for a, b in re.findall(r"(\d+)-(\d+)", text("edge", "edges"))]
    vertices = [int(digits) for digits in re.findall(r"\d+", text("vertex", "vertices"))]
    return faces, edges, vertices


def _read_loop_uv(path, count):
    """UV of the loops of polygons, (L, 2), from an OBJ whose normals have the numbers of loops."""
    uv, corners = [], []
    with open(path, encoding="ascii") as file:
        for line in file:
            if line.startswith("vt "):
                uv.append(line[3:])
            elif line.startswith("f "):
                corners.append(line[2:].replace("/", " "))
    values = np.array(" ".join(uv).split(), np.float64).astype(np.float32).reshape(-1, 2)
    _, texture, loop = np.array(" ".join(corners).split(), np.int64).reshape(-1, 3).T
    of_loop = np.zeros((count, 2), np.float32)
    of_loop[loop - 1] = values[texture - 1]
    return of_loop


# Several at a time ------------------------------------------------------------------------------------------------------


def _check_positions(sheet):
    bad = np.flatnonzero(~np.isfinite(sheet.positions).all(axis=1))
    if len(bad) > 0:
        message = f"{len(bad)} {'vertex has a position' if len(bad) == 1 else 'vertices have positions'} that is no number"
        raise Failed(message, "MESH_POSITION_NOT_FINITE", vertices=bad[:16].tolist())


def _has_images(sheet):
    return sheet.transfer is not None and bool(sheet.transfer.readings)


@dataclass
class Batch:
    """Unwraps of several sheets, a few at a time."""

    start: Any  # the function that engine() returned
    sheets: list
    options: Options
    outcomes: list = field(default_factory=list)  # (sheet, Outcome or Failed), in the order in which they ended
    cancelled: bool = False

    def __post_init__(self):
        self._waiting = list(self.sheets)
        self._running = []

    def step(self):
        """Collects ended unwraps and starts the next ones; returns whether all have ended."""
        for call in [call for call in self._running if call.done()]:
            self._running.remove(call)
            try:
                outcome = call.result()
                if not _has_images(call.sheet) or outcome.images is not None or self.cancelled:
                    self.outcomes.append((call.sheet, outcome))
                else:
                    self._running.append(call.sheet.transfer.start(call.sheet, outcome))
            except Failed as error:
                self.outcomes.append((call.sheet, error))
        while self._waiting and len(self._running) < MOST_AT_A_TIME and not self.cancelled:
            sheet = self._waiting.pop(0)
            try:
                _check_positions(sheet)
                self._running.append(self.start(sheet, self.options))
            except Failed as error:
                self.outcomes.append((sheet, error))
        return not self._running and (self.cancelled or not self._waiting)

    def wait(self, seconds):
        """Waits until the oldest call has ended, at most this long."""
        if self._running:
            self._running[0].wait(seconds)

    def cancel(self):
        self.cancelled = True
        for call in self._running:
            call.cancel()

    @property
    def fraction(self):
        done = len(self.outcomes) + sum(self._done_of(call) for call in self._running)
        return done / max(1, len(self.sheets))

    @staticmethod
    def _done_of(call):
        """Of a sheet with textures the unwrap is the first half."""
        if not _has_images(call.sheet):
            return call.progress.fraction
        first = 0 if isinstance(call, (_PackageCall, _CommandCall)) else 0.5
        return first + call.progress.fraction / 2

    def __str__(self):
        if self.cancelled:
            return "cancelling"
        now = str(self._running[0].progress) if self._running else "waiting"
        return now if len(self.sheets) == 1 else f"{len(self.outcomes)} of {len(self.sheets)} done; {now}"
