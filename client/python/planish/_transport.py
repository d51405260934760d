"""The two ways to gRPC: blocking, and in an event loop of asyncio.

What is said to a server stands once, in coroutines (`_calls.py`, `_follow.py`). They wait for nothing but a transport. The
methods of the blocking transport never suspend, so :func:`run_blocking` can step through such a coroutine without a loop.
"""

from __future__ import annotations

import asyncio
import os
import threading
import time
import weakref
from typing import Any, Coroutine, Dict, List, Optional, Sequence, Tuple, TypeVar

import grpc
import grpc.aio

from . import errors
from ._connection import Connection
from ._status import error_of_call
from .v1 import planish_pb2_grpc

Metadata = Sequence[Tuple[str, str]]
_T = TypeVar("_T")

#: A last word to the server, when the caller wants to leave, may take so long.
LAST_WORD_SECONDS = 5.0


def run_blocking(coroutine: Coroutine[Any, Any, _T]) -> _T:
    """Runs a coroutine over a :class:`BlockingTransport` to its end, on this thread."""
    try:
        coroutine.send(None)
    except StopIteration as end:
        return end.value  # type: ignore[no-any-return]
    raise AssertionError("a blocking transport never suspends")


class Stream:
    """The answers of one streaming call."""

    async def read(self) -> Any:
        """The next message; None at the end."""
        raise NotImplementedError

    def cancel(self) -> None:
        """Ends the call. From any thread."""
        raise NotImplementedError


class Transport:
    """Makes calls to one server. All of them raise :class:`planish.Error`."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        #: The server has answered before.
        self.reached = False

    async def unary(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Any:
        raise NotImplementedError

    def stream(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Stream:
        raise NotImplementedError

    async def sleep(self, seconds: float, wake: Optional[threading.Event] = None) -> None:
        """Waits. A blocking wait ends early when `wake` is set."""
        raise NotImplementedError

    def _error(self, error: Any) -> errors.Error:
        own = error_of_call(error, self.connection.target)
        self.reached = self.reached or own.reason != "SERVER_UNREACHABLE"
        return own


# Blocking ---------------------------------------------------------------------------------------------------------------


class BlockingTransport(Transport):
    """Thread-safe. A forked child gets a channel of its own: the parent's cannot be used there."""

    _all: "weakref.WeakSet[BlockingTransport]" = weakref.WeakSet()

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection)
        self._lock = threading.Lock()
        self._channel: Any = None
        self._stub: Any = None
        BlockingTransport._all.add(self)

    def _method(self, name: str) -> Any:
        with self._lock:
            if self._stub is None:
                self._channel = self.connection.channel(grpc)
                self._stub = planish_pb2_grpc.PlanishStub(self._channel)  # type: ignore[no-untyped-call]
            return getattr(self._stub, name)

    def close(self) -> None:
        """Calls under way end; a later one connects again."""
        with self._lock:
            channel, self._channel, self._stub = self._channel, None, None
        if channel is not None:
            channel.close()

    def _after_fork_in_child(self) -> None:
        # Threads that held the lock or served the channel are not here. Closing the channel would wait for them.
        self._lock = threading.Lock()
        if self._channel is not None:
            _left_by_parent.append(self._channel)
        self._channel = self._stub = None

    async def unary(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Any:
        try:
            answer = self._method(method)(request, timeout=timeout, metadata=metadata)
        except grpc.RpcError as error:
            raise self._error(error) from None
        self.reached = True
        return answer

    def stream(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Stream:
        return _BlockingStream(self, self._method(method)(request, timeout=timeout, metadata=metadata))

    async def sleep(self, seconds: float, wake: Optional[threading.Event] = None) -> None:
        if wake is None:
            time.sleep(seconds)
        else:
            wake.wait(seconds)


class _BlockingStream(Stream):
    def __init__(self, transport: BlockingTransport, call: Any) -> None:
        self._transport = transport
        self._call = call

    async def read(self) -> Any:
        try:
            message = next(self._call)
        except StopIteration:
            return None
        except grpc.RpcError as error:
            raise self._transport._error(error) from None
        self._transport.reached = True
        return message

    def cancel(self) -> None:
        self._call.cancel()


_left_by_parent: List[Any] = []


def _after_fork_in_child() -> None:
    for transport in list(BlockingTransport._all):
        transport._after_fork_in_child()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork_in_child)


# In an event loop -------------------------------------------------------------------------------------------------------


class AioTransport(Transport):
    """For one event loop at a time: the one of its first call, until it is closed."""

    # Threads of gRPC serve the event loops of a process, and a fork does not copy threads.
    _process: Optional[int] = None

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection)
        self._stubs: Dict[int, Tuple[Any, Any, Any]] = {}

    def _method(self, name: str) -> Any:
        if AioTransport._process not in (None, os.getpid()):
            raise errors.FailedPrecondition(
                "this process was forked from one that had used AsyncClient, which gRPC does not support: "
                "make processes by 'spawn', or use Client in them",
                reason="FORKED",
            )
        AioTransport._process = os.getpid()
        loop = asyncio.get_running_loop()
        known = self._stubs.get(id(loop))
        if known is None or known[0] is not loop:
            for key in [key for key, (old, _, _) in self._stubs.items() if old.is_closed()]:
                del self._stubs[key]
            channel = self.connection.channel(grpc.aio)
            stub = planish_pb2_grpc.PlanishStub(channel)  # type: ignore[no-untyped-call]
            known = self._stubs[id(loop)] = (loop, channel, stub)
        return getattr(known[2], name)

    async def close(self) -> None:
        """Ends what is under way in this event loop; a later call connects again."""
        known = self._stubs.pop(id(asyncio.get_running_loop()), None)
        if known is not None:
            await known[1].close()

    async def unary(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Any:
        try:
            answer = await self._method(method)(request, timeout=timeout, metadata=metadata)
        except grpc.aio.AioRpcError as error:
            raise self._error(error) from None
        self.reached = True
        return answer

    def stream(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Stream:
        return _AioStream(self, self._method(method)(request, timeout=timeout, metadata=metadata))

    async def sleep(self, seconds: float, wake: Optional[threading.Event] = None) -> None:
        await asyncio.sleep(seconds)


class _AioStream(Stream):
    def __init__(self, transport: AioTransport, call: Any) -> None:
        self._transport = transport
        self._call = call

    async def read(self) -> Any:
        try:
            message = await self._call.read()
        except grpc.aio.AioRpcError as error:
            raise self._transport._error(error) from None
        if message is grpc.aio.EOF:
            return None
        self._transport.reached = True
        return message

    def cancel(self) -> None:
        self._call.cancel()
