"""Makes calls in a helper process, for processes that were forked after gRPC was used.

Such a child has gRPC's memory without its threads, and shares its descriptors with the parent: any use of gRPC may
hang, or disturb the parent. So it starts a new Python that makes the calls for it. Messages are sent as bytes, in
frames: number of the call, kind, length, content.
"""

from __future__ import annotations

import asyncio
import os
import pickle
import queue
import struct
import subprocess
import sys
import threading
from multiprocessing import spawn
from typing import IO, Any, Callable, Dict, Iterator, List, Optional, Tuple

import grpc
from google.protobuf import descriptor_pb2

from . import errors
from ._connection import Connection, aio
from .v1 import planish_pb2

_HEADER = struct.Struct("<IBI")
# To the helper: begin a call with one or with many responses, or cancel it.
_UNARY, _STREAM, _CANCEL = 0, 1, 2
# From the helper: a response; the end, with None or an error.
_MESSAGE, _END = 0, 1

SERVICE = planish_pb2.DESCRIPTOR.services_by_name["Planish"]
_file = descriptor_pb2.FileDescriptorProto.FromString(planish_pb2.DESCRIPTOR.serialized_pb)
#: By name: from the descriptor of the file, since other descriptors of older protobuf do not say which are streams.
METHODS = {method.name: method for service in _file.service for method in service.method}
_PATH = f"/{SERVICE.full_name}/"
_CODES = {code.value[0]: code for code in grpc.StatusCode}


def _read_frame(file: IO[bytes]) -> Optional[Tuple[int, int, bytes]]:
    header = file.read(_HEADER.size)
    if len(header) < _HEADER.size:
        return None
    number, kind, length = _HEADER.unpack(header)
    return number, kind, file.read(length)


class _Writer:
    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._lock = threading.Lock()

    def write(self, number: int, kind: int, content: bytes) -> None:
        with self._lock:
            self._file.write(_HEADER.pack(number, kind, len(content)))
            self._file.write(content)
            self._file.flush()


# The helper -------------------------------------------------------------------------------------------------------------


def serve() -> None:
    """Main function of the helper: connects, then makes calls until the process that started it is gone."""
    ours = sys.stdin.buffer
    connection: Connection = pickle.load(ours)
    channel = connection.channel(grpc)
    writer = _Writer(sys.stdout.buffer)
    calls: Dict[int, Any] = {}

    def run(number: int, kind: int, method: str, request: bytes, timeout: Optional[float], metadata: Any) -> None:
        end: Optional[Tuple[int, str, List[Tuple[str, Any]]]] = None
        try:
            try:
                if kind == _UNARY:
                    is_many = METHODS[method].client_streaming
                    call = (channel.stream_unary if is_many else channel.unary_unary)(_PATH + method)
                    answer = call(iter([request]) if is_many else request, timeout=timeout, metadata=metadata)
                    writer.write(number, _MESSAGE, answer)
                else:
                    calls[number] = channel.unary_stream(_PATH + method)(request, timeout=timeout, metadata=metadata)
                    for answer in calls[number]:
                        writer.write(number, _MESSAGE, answer)
            except grpc.RpcError as error:
                trailing = [(key, value) for key, value in error.trailing_metadata() or ()]
                end = (error.code().value[0], error.details() or "", trailing)
            finally:
                calls.pop(number, None)
            writer.write(number, _END, pickle.dumps(end))
        except OSError:
            pass  # the process that started the helper reads no more

    while True:
        frame = _read_frame(ours)
        if frame is None:
            os._exit(0)  # ends running calls
        number, kind, content = frame
        if kind == _CANCEL:
            call = calls.get(number)
            if call is not None:
                call.cancel()
        else:
            threading.Thread(target=run, args=(number, kind, *pickle.loads(content)), daemon=True).start()


# The process that has a helper ------------------------------------------------------------------------------------------


class Bridge:
    """A helper for one server. Thread-safe. The helper ends with this object."""

    def __init__(self, connection: Connection) -> None:
        #: Whether the helper is gone, so that a new bridge is needed.
        self.is_lost = False
        code = f"import sys; sys.path[:] = {sys.path!r}; from planish._bridge import serve; serve()"
        executable = os.fsdecode(spawn.get_executable())
        try:
            self._process = subprocess.Popen(
                # Passes on the flags of this Python, such as -I and -E, which keep environment and directory out.
                [executable, *subprocess._args_from_interpreter_flags(), "-c", code],  # type: ignore[attr-defined]
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C must not reach the helper: this process cancels the calls
            )
        except OSError as error:
            message = f"cannot start {executable} to make the calls of a forked process: {error.strerror}"
            raise errors.Unavailable(message, reason="FORKED") from error
        assert self._process.stdin is not None and self._process.stdout is not None
        self._stdin = self._process.stdin
        self._lock = threading.Lock()
        self._next = 0
        self._takers: Dict[int, Callable[[int, bytes], None]] = {}
        self._writer = _Writer(self._stdin)
        pickle.dump(connection, self._stdin)
        self._stdin.flush()
        self._reader = threading.Thread(target=self._read, args=(self._process.stdout,), daemon=True)
        self._reader.start()

    def begin(
        self,
        kind: int,
        method: str,
        request: Any,
        timeout: Optional[float],
        metadata: Any,
        taker: Callable[[int, bytes], None],
    ) -> int:
        """Begins a call and returns its number. Calls `taker` with kind and content of each frame of the answer, on
        another thread."""
        with self._lock:
            number = self._next = self._next + 1
            self._takers[number] = taker
        if METHODS[method].client_streaming:
            (request,) = request
        content = pickle.dumps((method, request.SerializeToString(), timeout, list(metadata)))
        try:
            self._writer.write(number, kind, content)
        except OSError:
            self._lose()
        return number

    def cancel(self, number: int) -> None:
        if number not in self._takers:
            return  # the call has ended
        try:
            self._writer.write(number, _CANCEL, b"")
        except OSError:
            self._lose()

    def close(self) -> None:
        try:
            self._stdin.close()
        except OSError:
            pass
        self._reader.join()
        self._process.wait()

    def _read(self, file: IO[bytes]) -> None:
        with file:
            while True:
                frame = _read_frame(file)
                if frame is None:
                    break
                number, kind, content = frame
                taker = self._takers.pop(number, None) if kind == _END else self._takers.get(number)
                if taker is not None:
                    taker(kind, content)
        self._lose()

    def _lose(self) -> None:
        """Ends all calls with UNAVAILABLE, since the helper is gone."""
        end = pickle.dumps((grpc.StatusCode.UNAVAILABLE.value[0], "the process that makes the calls has ended", []))
        self.is_lost = True
        with self._lock:
            takers, self._takers = self._takers, {}
        for taker in takers.values():
            taker(_END, end)


class _Answers:
    """Decodes the frames of one call."""

    def __init__(self, method: str) -> None:
        self._parse = _parser(method)

    def message(self, content: bytes) -> Any:
        return self._parse(content)

    @staticmethod
    def end(content: bytes) -> Optional[Tuple[grpc.StatusCode, str, List[Tuple[str, Any]]]]:
        end = pickle.loads(content)
        return None if end is None else (_CODES[end[0]], end[1], end[2])


def _parser(method: str) -> Callable[[bytes], Any]:
    from google.protobuf import empty_pb2

    from .v1 import job_pb2

    name = SERVICE.methods_by_name[method].output_type.name
    for module in (planish_pb2, job_pb2, empty_pb2):
        if hasattr(module, name):
            return getattr(module, name).FromString  # type: ignore[no-any-return]
    raise AssertionError(f"no class for {name}")


class _RpcError(grpc.RpcError):  # type: ignore[misc]
    def __init__(self, code: grpc.StatusCode, details: str, trailing: List[Tuple[str, Any]]) -> None:
        super().__init__(details)
        self._end = (code, details, trailing)

    def code(self) -> grpc.StatusCode:
        return self._end[0]

    def details(self) -> str:
        return self._end[1]

    def trailing_metadata(self) -> List[Tuple[str, Any]]:
        return self._end[2]


class _BlockingCall(_Answers):
    def __init__(
        self, bridge: Bridge, kind: int, method: str, request: Any, timeout: Optional[float], metadata: Any
    ) -> None:
        super().__init__(method)
        self._bridge = bridge
        self._frames: "queue.SimpleQueue[Tuple[int, bytes]]" = queue.SimpleQueue()
        self._number = bridge.begin(kind, method, request, timeout, metadata, self._take)

    def _take(self, kind: int, content: bytes) -> None:
        self._frames.put((kind, content))

    def __iter__(self) -> Iterator[Any]:
        return self

    def __next__(self) -> Any:
        kind, content = self._frames.get()
        if kind == _MESSAGE:
            return self.message(content)
        end = self.end(content)
        if end is not None:
            raise _RpcError(*end)
        raise StopIteration

    def cancel(self) -> None:
        self._bridge.cancel(self._number)


class BlockingStub:
    """Replaces the stub that protoc makes: the calls go through a bridge."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge

    def __getattr__(self, method: str) -> Callable[..., Any]:
        is_stream = METHODS[method].server_streaming

        def call(request: Any, timeout: Optional[float], metadata: Any) -> Any:
            made = _BlockingCall(self._bridge, _STREAM if is_stream else _UNARY, method, request, timeout, metadata)
            if is_stream:
                return made
            try:
                return next(made)
            except BaseException:
                made.cancel()
                raise

        return call


class _AioCall(_Answers):
    def __init__(
        self, bridge: Bridge, kind: int, method: str, request: Any, timeout: Optional[float], metadata: Any
    ) -> None:
        super().__init__(method)
        self._bridge = bridge
        self._frames: "asyncio.Queue[Tuple[int, bytes]]" = asyncio.Queue()
        loop = asyncio.get_running_loop()

        def take(*frame: Any) -> None:
            try:
                loop.call_soon_threadsafe(self._frames.put_nowait, frame)
            except RuntimeError:
                pass  # the loop is closed: nobody waits

        self._number = bridge.begin(kind, method, request, timeout, metadata, take)

    async def read(self) -> Any:
        kind, content = await self._frames.get()
        if kind == _MESSAGE:
            return self.message(content)
        end = self.end(content)
        if end is not None:
            code, details, trailing = end
            raise aio.AioRpcError(code, aio.Metadata(), aio.Metadata(*trailing), details)
        return aio.EOF

    def cancel(self) -> None:
        self._bridge.cancel(self._number)


class AioStub:
    """Replaces the stub that protoc makes, for asyncio."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge

    def __getattr__(self, method: str) -> Callable[..., Any]:
        is_stream = METHODS[method].server_streaming

        def call(request: Any, timeout: Optional[float], metadata: Any) -> Any:
            made = _AioCall(self._bridge, _STREAM if is_stream else _UNARY, method, request, timeout, metadata)
            return made if is_stream else _one(made)

        return call


async def _one(call: _AioCall) -> Any:
    try:
        return await call.read()
    except BaseException:
        call.cancel()
        raise
