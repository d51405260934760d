"""The blocking client."""

from __future__ import annotations

import functools
import os
import threading
from typing import TYPE_CHECKING, Any, Callable, Coroutine, Optional

from ._connection import ConnectionOptions
from ._follow import Control
from ._methods import Connected, Controlled, Methods, blocking
from ._retry import RetryPolicy
from ._transport import BlockingTransport, run_blocking
from ._where import server_of
from .result import Result

if TYPE_CHECKING:
    from typing_extensions import Concatenate, ParamSpec

    P = ParamSpec("P")


class Call:
    """An unwrap on its own thread, made by :meth:`Client.start_unwrap`. All methods are thread-safe."""

    def __init__(self, client: "Client", run: Callable[[Control], Result]) -> None:
        self._client = client
        self._control = Control()
        self._done = threading.Event()
        self._result: Optional[Result] = None
        self._error: Optional[BaseException] = None
        self._thread = threading.Thread(target=self._run, args=(run,), name="planish", daemon=True)
        self._thread.start()

    def _run(self, run: Callable[[Control], Result]) -> None:
        try:
            self._result = run(self._control)
        except BaseException as error:  # passed on to the caller of result()
            self._error = error
        finally:
            self._done.set()

    @property
    def job(self) -> str:
        """Name of the job; empty until the server has accepted it."""
        return self._control.job

    def cancel(self) -> None:
        """Asks the server to cancel the job. The call then ends with :class:`planish.Cancelled`, or with its result if
        the job finished before."""
        job = self._control.cancel()
        if job:
            self._client.cancel_job(job)

    def stop(self) -> None:
        """Asks the server to end the job soon with the best valid map so far (warning STOPPED). The call then ends with that,
        or with STOPPED_EARLY if there was no valid map yet."""
        job = self._control.stop()
        if job:
            self._client.stop_job(job)

    def done(self) -> bool:
        """Whether the call has ended."""
        return self._done.is_set()

    def wait(self, timeout: Optional[float] = None) -> bool:
        """Waits at most `timeout` seconds (None: no limit); returns whether the call has ended."""
        return self._done.wait(timeout)

    def result(self, timeout: Optional[float] = None) -> Result:
        """Waits for the end; returns the result or raises the error. TimeoutError if the call has not ended in time."""
        if not self._done.wait(timeout):
            raise TimeoutError(f"the call has not ended within {timeout} s")
        if self._error is not None:
            raise self._error
        assert self._result is not None
        return self._result


def _on_a_thread(
    method: Callable[Concatenate[Any, P], Coroutine[Any, Any, Result]]
) -> Callable[Concatenate[Any, P], Call]:
    @functools.wraps(method)
    def start(self: Any, /, *arguments: P.args, **keywords: P.kwargs) -> Call:
        return Call(
            self, lambda control: run_blocking(method(Controlled(self._calls, control), *arguments, **keywords))
        )

    start.__name__ = f"start_{method.__name__}"
    start.__doc__ = """Like :meth:`unwrap`, on its own thread, which also runs the callbacks. The arrays must not change meanwhile."""
    return start


class Client(Connected):
    """A connection to one server, made by the first call and re-established when lost. Thread-safe; a context manager.

    A forked child may use its parent's client: it gets a new channel. A client can be pickled, for processes
    that are spawned.

    Calls raise :class:`planish.Error`. The client handles failures of network and server: it resumes broken streams,
    waits while a server restarts or its queue is full, and retries calls that are safe to repeat, at the pace that the
    server asks for.
    """

    def __init__(
        self,
        target: Optional[str] = None,
        *,
        connection: Optional[ConnectionOptions] = None,
        retry: Optional[RetryPolicy] = None,
    ) -> None:
        """`target`: "host:port" or "unix:/path". None: $PLANISH_SERVER or, if that is not set, a private server that is
        started for this process by the first client without a target and shared by all of them.

        `connection`: TLS and tokens; None: from the environment. `retry`: how long the client retries.
        """
        super().__init__(BlockingTransport, target, connection, retry)

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    unwrap = blocking(Methods.unwrap)
    attach = blocking(Methods.attach)
    create_job = blocking(Methods.create_job)
    create_jobs = blocking(Methods.create_jobs)
    watch_job = blocking(Methods.watch_job)
    get_job = blocking(Methods.get_job)
    wait_job = blocking(Methods.wait_job)
    read_result = blocking(Methods.read_result)
    list_jobs = blocking(Methods.list_jobs)
    stop_job = blocking(Methods.stop_job)
    cancel_job = blocking(Methods.cancel_job)
    delete_job = blocking(Methods.delete_job)
    estimate = blocking(Methods.estimate)
    capabilities = blocking(Methods.capabilities)
    start_unwrap = _on_a_thread(Methods.unwrap)

    @blocking
    async def close(self) -> None:
        """Ends the connection and running calls."""
        await self._calls.transport.close()


# The client of this process ---------------------------------------------------------------------------------------------

_lock = threading.Lock()
_default: Optional[Client] = None


def default_client() -> Client:
    """The client of :func:`planish.unwrap` and of xatlas's functions. Kept for the process; replaced when
    $PLANISH_SERVER changes or the private server was lost."""
    global _default
    with _lock:
        target = server_of(None, None, None).target
        if _default is None or _default.target != target:
            _default = Client()
        return _default


def unwrap(positions: Any, triangles: Any, **arguments: Any) -> Result:
    """:meth:`Client.unwrap` on the server that $PLANISH_SERVER names, or on a private one that is started by the first call of
    the process, kept for all later ones, and ended with the process."""
    return default_client().unwrap(positions, triangles, **arguments)


def _after_fork_in_child() -> None:
    global _lock
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork_in_child)
