"""Chooses the server of a client without an address."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from typing import Optional

from ._connection import ConnectionOptions
from ._retry import RetryPolicy
from .private_server import default_server

#: How long to wait for a lost private server, which returns at once (private_server.revive()) or not at all.
_PRIVATE_PATIENCE_SECONDS = 5.0


@dataclass(frozen=True)
class Server:
    """A server and how to connect to it, with all defaults filled in."""

    target: str
    connection: ConnectionOptions
    retry: RetryPolicy


def server_of(
    target: Optional[str], connection: Optional[ConnectionOptions], retry: Optional[RetryPolicy]
) -> Server:
    """The server at `target`; None: at $PLANISH_SERVER, else the private server of this process, which needs no
    credentials."""
    retry = retry or RetryPolicy()
    named = target if target is not None else os.environ.get("PLANISH_SERVER", "")
    if named:
        return Server(named, (connection or ConnectionOptions()).with_environment(), retry)
    private = dataclasses.replace(
        retry,
        reattach_seconds=min(retry.reattach_seconds, _PRIVATE_PATIENCE_SECONDS),
        retry_seconds=min(retry.retry_seconds, _PRIVATE_PATIENCE_SECONDS),
    )
    nobody = ConnectionOptions(False, "", "", "", "", "", "")
    return Server(default_server().target, nobody, private)
