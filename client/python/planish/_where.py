"""Which server a client without an address talks to."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from typing import Optional

from ._connection import ConnectionOptions
from ._retry import RetryPolicy
from .private_server import default_server

#: A private server that was lost comes back at once (private_server.revive()), or not at all.
_PRIVATE_PATIENCE_SECONDS = 5.0


@dataclass(frozen=True)
class Server:
    """A server and the way to it, with nothing left open."""

    target: str
    connection: ConnectionOptions
    retry: RetryPolicy


def server_of(
    target: Optional[str], connection: Optional[ConnectionOptions], retry: Optional[RetryPolicy]
) -> Server:
    """`target` None: $PLANISH_SERVER, else the private server of this process, to which nobody has to say who calls."""
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
