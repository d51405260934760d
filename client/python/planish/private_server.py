"""Starts a private ``planishd``, for programs that must work without a running server."""

from __future__ import annotations

import os
import select
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from typing import Any, Callable, List, Optional, Sequence

from ._programs import is_program, own_program
from .errors import Unavailable

# The server drains without grace when it is stopped. If it hangs, it is killed after this time.
_STOP_SECONDS = 5.0
# The longest folder for a server's directory: the path of the socket must stay below 108 bytes.
_LONGEST_BASE = 60


def _failed(message: str) -> Unavailable:
    return Unavailable(message, reason="PRIVATE_SERVER_FAILED")


def find_planishd() -> Optional[str]:
    """The ``planishd`` that :class:`PrivateServer` would start: $PLANISHD, else the one in this package's wheel, else
    the one beside the running Python, else the one in PATH.

    None if there is none. If $PLANISHD is set, only that is tried.
    """
    named = os.environ.get("PLANISHD", "")
    if named:
        return named if is_program(named) else None
    own = own_program("planishd")
    if own is not None:
        return own
    beside = os.path.join(os.path.dirname(sys.executable or ""), "planishd")
    if os.path.isabs(beside) and is_program(beside):
        return beside
    return shutil.which("planishd")


class _Running:
    """A planishd, and what must be cleaned up after it: directory, log and socket."""

    def __init__(self, executable: str) -> None:
        self.executable = executable
        self.owner = os.getpid()
        self.directory = _new_directory()
        self.log = tempfile.TemporaryFile()
        self.process: Optional["subprocess.Popen[bytes]"] = None
        # planishd holds `theirs`, and reads end of file from it once this process is gone.
        self.supervisor, self.theirs = socket.socketpair()
        _running.add(self)

    def start(self, arguments: List[str], timeout_seconds: float) -> None:
        self._started = (arguments, timeout_seconds)
        self._spawn(arguments)
        self._wait_until_ready(timeout_seconds)

    def start_again(self) -> None:
        """Restarts the ended process at the same address."""
        assert self.process is not None
        self.process.wait()
        self.supervisor.close()
        self.supervisor, self.theirs = socket.socketpair()
        try:
            os.unlink(f"{self.directory}/socket")
        except FileNotFoundError:
            pass
        self.start(*self._started)

    def _spawn(self, arguments: List[str]) -> None:
        # Variables like PLANISHD_QUEUE configure this machine's planishd, not private ones.
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PLANISHD_")}
        flags = [f"--listen=unix:{self.directory}/socket", f"--supervisor-fd={self.theirs.fileno()}", "--log-level=warn"]
        try:
            with self.theirs:
                self.process = subprocess.Popen(
                    [self.executable, *flags, *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=self.log,
                    pass_fds=[self.theirs.fileno()],
                    env=environment,
                    start_new_session=True,  # Ctrl-C must not reach the server: this process handles it
                )
        except OSError as error:
            raise _failed(f"cannot start {self.executable}: {error.strerror}") from error

    def _wait_until_ready(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        said = b""
        while b"\n" not in said:
            ready, _, _ = select.select([self.supervisor], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                raise _failed(f"{self.executable} did not become ready in time{self.log_suffix()}")
            piece = self.supervisor.recv(64)
            if not piece:
                raise _failed(f"{self.executable} {self._how_it_ended()} while it started{self.log_suffix()}")
            said += piece
        if not said.startswith(b"ready\n"):
            raise _failed(f"{self.executable} said {said!r} instead of 'ready'")

    def _how_it_ended(self) -> str:
        assert self.process is not None
        try:
            code = self.process.wait(1)
        except subprocess.TimeoutExpired:
            return "let go of us"
        return f"was killed by signal {-code}" if code < 0 else f"exited with code {code}"

    def log_suffix(self) -> str:
        text = self.read_log().rstrip("\n")
        return "\n" + text if text else ""

    def read_log(self) -> str:
        if self.log.closed:
            return ""
        size = os.fstat(self.log.fileno()).st_size
        return os.pread(self.log.fileno(), size, 0).decode(errors="replace")

    def stop(self) -> None:
        if os.getpid() != self.owner:
            return
        _running.discard(self)
        self.supervisor.close()
        process, self.process = self.process, None
        if process is not None:
            try:
                process.wait(_STOP_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.log.close()
        shutil.rmtree(self.directory, ignore_errors=True)


class PrivateServer:
    """Runs ``planishd`` on a Unix socket that only this user can reach. The server ends with :meth:`close`, with this
    object, and with this process, however that ends. A context manager. A forked child may use the server, but does not
    own it.

    Raises :class:`planish.Unavailable` (PRIVATE_SERVER_FAILED) if ``planishd`` is not found, or dies or stays silent
    while it starts; the message ends with what ``planishd`` wrote to stderr.
    """

    def __init__(
        self,
        *,
        executable: Optional[str] = None,
        workers: int = 1,
        threads: Optional[int] = None,
        start_timeout_seconds: float = 10.0,
        extra_arguments: Sequence[str] = (),
    ) -> None:
        """`executable` None: that of :func:`find_planishd`. `workers`: how many jobs run at a time. `threads`: how many
        a job may use; None: the cores of this machine, divided by `workers`. `extra_arguments`: flags of
        ``planishd``."""
        self.executable = executable or find_planishd() or ""
        if not self.executable:
            named = os.environ.get("PLANISHD", "")
            where = " in $PLANISHD, in this package, beside Python or in PATH. The package's wheel for Linux brings one; on other "
            where += "systems $PLANISH_SERVER names a server that runs elsewhere, host:port"
            where = f": $PLANISHD is {named}, which is not a program" if named else where
            raise _failed(f"cannot find planishd{where}")
        if not is_program(self.executable):
            raise _failed(f"{self.executable} is not a program")
        self._running = _Running(self.executable)
        # Runs when this object is collected, and when Python ends.
        self._finalizer = weakref.finalize(self, self._running.stop)
        _end_with_this_process(self._finalizer)
        arguments = [f"--workers={workers}"]
        if threads is not None:
            arguments.append(f"--threads={threads}")
        try:
            self._running.start([*arguments, *extra_arguments], start_timeout_seconds)
        except BaseException:
            self.close()
            raise

    @property
    def target(self) -> str:
        """Target for :class:`planish.Client`."""
        return f"unix:{self._running.directory}/socket"

    @property
    def pid(self) -> int:
        """The process id of planishd; 0 after :meth:`close`."""
        process = self._running.process
        return 0 if process is None else process.pid

    @property
    def is_running(self) -> bool:
        """Whether planishd runs. A forked child cannot know, and assumes that it does."""
        process = self._running.process
        return process is not None and (os.getpid() != self._running.owner or process.poll() is None)

    def start_again(self) -> None:
        """Restarts planishd at the same address if it has crashed; its jobs are lost. Raises as the constructor
        does."""
        if not self.is_running:
            self._running.start_again()

    def log(self) -> str:
        """What planishd has written to stderr so far."""
        return self._running.read_log()

    def close(self) -> None:
        """Stops the server (its jobs are cancelled), waits for it and removes the socket. No effect in a forked
        child."""
        if os.getpid() == self._running.owner:
            self._finalizer()

    def __enter__(self) -> "PrivateServer":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


def _new_directory() -> str:
    """A directory that only this user can enter."""
    for base in (os.environ.get("XDG_RUNTIME_DIR"), os.environ.get("TMPDIR"), "/tmp"):
        if not base or not base.startswith("/") or len(base) > _LONGEST_BASE:
            continue
        try:
            return tempfile.mkdtemp(prefix="planish-", dir=base)
        except OSError:
            continue
    raise _failed("cannot make a directory for the server's socket in $XDG_RUNTIME_DIR, $TMPDIR or /tmp")


_running: "weakref.WeakSet[_Running]" = weakref.WeakSet()


def _end_with_this_process(finalizer: Callable[[], Any]) -> None:
    # Processes of `multiprocessing` skip Python's own exit handlers; they have their own list.
    util = sys.modules.get("multiprocessing.util")
    process = sys.modules.get("multiprocessing.process")
    if util is not None and process is not None and process.parent_process() is not None:
        util.Finalize(None, finalizer, exitpriority=100)


# The server of this process ---------------------------------------------------------------------------------------------

_lock = threading.Lock()
_default: Optional[PrivateServer] = None


def default_server() -> PrivateServer:
    """The private server of this process, for clients without a target. Started by the first call, ended with Python.
    If the server has crashed, it is restarted at the same address. Forked children share the server of their parent, if
    the parent had one by then.

    The server has one worker for every two cores, at most four, since callers on several threads share it.
    """
    global _default
    with _lock:
        if _default is None:
            _default = PrivateServer(workers=max(1, min(4, (os.cpu_count() or 1) // 2)))
        elif not _default.is_running:
            _default.start_again()
        return _default


def revive(target: str, was_revived: bool) -> bool:
    """Restarts the private server of this process if it is the server at `target` and has crashed. Returns whether it
    was restarted. `was_revived`: it was restarted for the same call before. Then the call may be why it crashes: raises
    :class:`planish.Unavailable`."""
    with _lock:
        server = _default
        if server is None or server.pid == 0 or server.target != target or server.is_running:
            return False
        if was_revived:
            raise _failed(f"planishd crashed, was started again and crashed again during one call{server._running.log_suffix()}")
        server.start_again()
        return True


def close_default_server() -> None:
    """Ends the private server of this process, if there is one. A later call starts another."""
    global _default
    with _lock:
        server, _default = _default, None
    if server is not None:
        server.close()


def _after_fork_in_child() -> None:
    global _lock
    _lock = threading.Lock()
    # The server runs as long as any process holds this end of the socket. A child closes its copy, since the server
    # must end with the parent.
    for running in list(_running):
        running.supervisor.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork_in_child)
