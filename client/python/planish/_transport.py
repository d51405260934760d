"""The two transports over gRPC: blocking, and in an asyncio event loop.

The protocol is written once, in coroutines (`_calls.py`, `_follow.py`), which only wait for a transport. The
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

from . import errors
from ._bridge import METHODS, AioStub, BlockingStub, Bridge
from ._connection import Connection, aio
from ._status import error_of_call, is_unreachable
from .v1 import planish_pb2_grpc

Metadata = Sequence[Tuple[str, str]]
_T = TypeVar("_T")

#: Time limit of the last call when a caller leaves.
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
        """The next message; None after the last one."""
        raise NotImplementedError

    def cancel(self) -> None:
        """Ends the call. May be called from any thread."""
        raise NotImplementedError


class Transport:
    """Makes calls to one server. All calls raise :class:`planish.Error`."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        #: Whether the server has answered before.
        self.reached = False

    async def unary(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Any:
        raise NotImplementedError

    def stream(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Stream:
        raise NotImplementedError

    async def close(self) -> None:
        """Ends running calls; a later call connects again."""
        raise NotImplementedError

    async def sleep(self, seconds: float, wake: Optional[threading.Event] = None) -> None:
        """Sleeps. A blocking sleep ends early when `wake` is set."""
        raise NotImplementedError

    def _error(self, error: Any) -> errors.Error:
        own = error_of_call(error, self.connection, self.reached)
        self.reached = self.reached or not is_unreachable(own)
        return own


# Forks ------------------------------------------------------------------------------------------------------------------

_transports: "weakref.WeakSet[Any]" = weakref.WeakSet()
# Whether this process has a channel, or was forked from a process that had one: gRPC does not work after such a fork.
_has_channel = False
_was_forked = False
# Keeps a parent's channels open: closing them would wait for threads that do not exist here.
_left_by_parent: List[Any] = []


def _connect(connection: Connection, module: Any, bridge_stub: Any) -> Tuple[Any, Any]:
    """A channel and its stub, or a bridge to a helper process and its stub if this process cannot use gRPC."""
    global _has_channel
    if _was_forked:
        bridge = Bridge(connection)
        return bridge, bridge_stub(bridge)
    _has_channel = True
    channel = connection.channel(module)
    return channel, planish_pb2_grpc.PlanishStub(channel)  # type: ignore[no-untyped-call]


def _outgoing(method: str, request: Any) -> Any:
    """The argument of the stub: an iterator for calls that stream requests."""
    return iter([request]) if METHODS[method].client_streaming else request


def _is_lost(channel: Any) -> bool:
    return isinstance(channel, Bridge) and channel.is_lost


def _after_fork_in_child() -> None:
    global _was_forked
    _was_forked = _was_forked or _has_channel
    for transport in list(_transports):
        transport.after_fork_in_child()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork_in_child)


# Blocking ---------------------------------------------------------------------------------------------------------------


class BlockingTransport(Transport):
    """Thread-safe. A forked child gets a new channel, since it cannot use the parent's."""

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection)
        self._lock = threading.Lock()
        self._channel: Any = None
        self._stub: Any = None
        _transports.add(self)

    def _method(self, name: str) -> Any:
        with self._lock:
            if self._stub is None or _is_lost(self._channel):
                self._channel, self._stub = _connect(self.connection, grpc, BlockingStub)
            return getattr(self._stub, name)

    async def close(self) -> None:
        with self._lock:
            channel, self._channel, self._stub = self._channel, None, None
        if channel is not None:
            channel.close()

    def after_fork_in_child(self) -> None:
        _left_by_parent.append((self._channel, self._stub))
        self._lock = threading.Lock()
        self._channel = self._stub = None

    async def unary(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Any:
        try:
            answer = self._method(method)(_outgoing(method, request), timeout=timeout, metadata=metadata)
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


# In an event loop -------------------------------------------------------------------------------------------------------


class AioTransport(Transport):
    """Has a channel for each event loop that uses it. A forked child gets a new one."""

    def __init__(self, connection: Connection) -> None:
        super().__init__(connection)
        self._stubs: Dict[int, Tuple[Any, Any, Any]] = {}
        _transports.add(self)

    def after_fork_in_child(self) -> None:
        _left_by_parent.append(self._stubs)
        self._stubs = {}

    def _method(self, name: str) -> Any:
        loop = asyncio.get_running_loop()
        known = self._stubs.get(id(loop))
        if known is None or known[0] is not loop or _is_lost(known[1]):
            for key in [key for key, (old, _, _) in self._stubs.items() if old.is_closed()]:
                del self._stubs[key]
            known = self._stubs[id(loop)] = (loop, *_connect(self.connection, aio, AioStub))
        return getattr(known[2], name)

    async def close(self) -> None:
        """Ends running calls in this event loop; a later call connects again."""
        known = self._stubs.pop(id(asyncio.get_running_loop()), None)
        if known is not None:
            closing = known[1].close()
            if closing is not None:
                await closing

    async def unary(self, method: str, request: Any, timeout: Optional[float], metadata: Metadata) -> Any:
        try:
            answer = await self._method(method)(_outgoing(method, request), timeout=timeout, metadata=metadata)
        except aio.AioRpcError as error:
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
        except aio.AioRpcError as error:
            raise self._transport._error(error) from None
        if message is aio.EOF:
            return None
        self._transport.reached = True
        return message

    def cancel(self) -> None:
        self._call.cancel()
