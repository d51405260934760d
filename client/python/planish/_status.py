"""Converts errors of calls and jobs to exceptions of this package."""

from __future__ import annotations

from typing import Any

from . import errors
from ._connection import Connection, is_unix
from .rpc import error_details_pb2, status_pb2

# The messages of google.rpc are compiled under a name of this package, so that they do not conflict with other
# packages. On the wire they keep Google's name.
_PREFIX = "google.rpc."

# Words in gRPC's message for a failed TLS handshake.
_WORDS_OF_TLS = ("SSL", "certificate", "Peer name")

#: Reasons of errors that did not come from a server.
_UNREACHABLE = ("SERVER_UNREACHABLE", "TLS_FAILED")


def error_of_status(status: Any) -> errors.Error:
    """The exception for a google.rpc.Status, of a call or of a job that failed."""
    reason, metadata, retry_after = "", {}, 0.0
    for detail in status.details:
        kind = detail.type_url.rsplit("/", 1)[-1]
        if kind == _PREFIX + "ErrorInfo":
            info = error_details_pb2.ErrorInfo.FromString(detail.value)
            reason, metadata = info.reason, dict(info.metadata)
        elif kind == _PREFIX + "RetryInfo":
            delay = error_details_pb2.RetryInfo.FromString(detail.value).retry_delay
            retry_after = delay.seconds + 1e-9 * delay.nanos
    return errors.class_of(status.code)(
        status.message, reason=reason, metadata=metadata, retry_after_seconds=retry_after
    )


def error_of_call(rpc_error: Any, connection: Connection, reached: bool) -> errors.Error:
    """The exception for a ``grpc.RpcError`` of either kind, blocking or asyncio. `reached`: the server has answered before."""
    code = rpc_error.code()
    message = rpc_error.details() or ""
    for key, value in rpc_error.trailing_metadata() or ():
        if key == "grpc-status-details-bin":
            status = status_pb2.Status.FromString(value)
            if status.details:
                return error_of_status(status)
    number = code.value[0]
    if number == 14:
        return _unreachable(message, connection, reached)
    if number == 1:
        # A caller that cancels a call does not wait for it. So the server ended this call: it is shutting down.
        return errors.Unavailable(
            f"the planish server at {connection.target} ended the call", reason="CONNECTION_LOST"
        )
    if number == 4:
        message = "the time given to the call passed"
    return errors.class_of(number)(message)


def _unreachable(message: str, connection: Connection, reached: bool) -> errors.Error:
    # gRPC wraps the cause: "failed to connect to all addresses; last error: UNKNOWN: ...: Connection refused".
    cause = message.rsplit(": ", 1)[-1]
    reason = "SERVER_UNREACHABLE"
    if connection.uses_tls and any(word in message for word in _WORDS_OF_TLS):
        reason = "TLS_FAILED"
        if "wrong version number" in message:
            cause = "it does not speak TLS"
    elif cause == "Socket closed" and not reached and not connection.uses_tls and not is_unix(connection.target):
        reason, cause = "TLS_FAILED", "it closed the connection at once, as servers do that speak TLS only"
    return errors.Unavailable(f"cannot reach the planish server at {connection.target}: {cause}", reason=reason)


def is_from_server(error: errors.Error) -> bool:
    """Whether the error came from the server, so that it was reached. Errors of the transport have no reason."""
    return error.reason not in (error.code, *_UNREACHABLE)


def is_unreachable(error: errors.Error) -> bool:
    """Whether there was no connection."""
    return error.reason in _UNREACHABLE
