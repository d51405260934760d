"""Decides whether and when a call is retried."""

from __future__ import annotations

import random
import time
from dataclasses import dataclass
from typing import Optional

from . import errors
from ._status import is_from_server

#: The longest pause between attempts to reach a lost server.
LONGEST_PAUSE_SECONDS = 5.0
#: The pause between attempts to get room on a full server that gives no longer retry delay.
_SHORTEST_ROOM_PAUSE_SECONDS = 0.05


@dataclass(frozen=True)
class RetryPolicy:
    """How long a client retries. Immutable, so thread-safe."""

    #: A call fails with SERVER_UNREACHABLE if it has no connection after this time. A refused connection fails at once.
    connect_timeout_seconds: float = 5.0
    #: How long calls about a job wait for a lost server, counted from its last message.
    reattach_seconds: float = 60.0
    #: The delay between attempts starts at this and doubles up to 5 s, with jitter.
    backoff_seconds: float = 0.1
    #: How long a new job waits for room in a full queue or store, at the pace that the server asks for; 0: no retries.
    queue_full_wait_seconds: float = 60.0
    #: How long other calls are retried; 0: no retries.
    retry_seconds: float = 10.0


class Deadline:
    """The caller's time limit for a whole call; None: no limit."""

    def __init__(self, seconds: Optional[float]) -> None:
        if seconds is not None and not seconds > 0:
            raise errors.InvalidArgument(f"timeout is {seconds}, it must be above 0", reason="OPTIONS_INVALID")
        self._end = None if seconds is None else time.monotonic() + seconds

    def left(self, most: Optional[float] = None) -> Optional[float]:
        """Seconds for the next attempt, at most `most`."""
        if self._end is None:
            return most
        left = max(0.001, self._end - time.monotonic())
        return left if most is None else min(left, most)

    def check_pause(self, seconds: float, why: errors.Error) -> None:
        """Raises if the time limit passes during the pause."""
        if self._end is not None and time.monotonic() + seconds > self._end:
            message = f"the time given to the call passed while waiting: {why.message}"
            raise errors.DeadlineExceeded(message) from why


def is_broken(error: errors.Error) -> bool:
    """Whether the connection broke or the server is unavailable. False for other errors that the server returned."""
    if isinstance(error, errors.Unavailable):
        return True
    if error.reason == "UPLOAD_BUSY":
        return True  # the server has not noticed yet that the call which wrote the upload broke
    # Resets and broken frames come from the transport; errors of the server have their own reason.
    return not is_from_server(error) and error.code in ("INTERNAL", "UNKNOWN")


def asks_to_wait(error: errors.Error) -> bool:
    """Whether the server is full and asks to try again later."""
    if not isinstance(error, errors.ResourceExhausted):
        return False
    return error.retry_after_seconds > 0 or error.reason == "QUEUE_FULL"


class Patience:
    """Decides how long one call waits before each of its attempts, and when it gives up.

    `lost_seconds`, `room_seconds`: how long to wait for a lost server, and for a full one.
    """

    def __init__(self, policy: RetryPolicy, deadline: Deadline, *, lost_seconds: float, room_seconds: float) -> None:
        self._backoff = policy.backoff_seconds
        self._deadline = deadline
        self._lost_seconds = lost_seconds
        self._room_seconds = room_seconds
        self._attempts = 0
        self._lost_since: Optional[float] = None
        self._waited_for_room = 0.0
        #: Whether a private server has been restarted for this call.
        self.has_revived = False

    def succeeded(self) -> None:
        """To be called after progress: the time for a lost server counts from the next error on."""
        self._attempts = 0
        self._lost_since = None

    def pause(self, error: errors.Error, *, reached: bool, target: str) -> float:
        """Seconds to wait before the next attempt. Raises an error if there should be no further attempt.

        `reached`: the server has answered this client before. A server that was never reached will hardly appear soon.
        """
        if asks_to_wait(error):
            seconds = max(_SHORTEST_ROOM_PAUSE_SECONDS, error.retry_after_seconds)
            self._waited_for_room += seconds
            if self._waited_for_room > self._room_seconds:
                raise error
        elif is_broken(error) and reached:
            seconds = max(self._next_backoff(), error.retry_after_seconds)
            now = time.monotonic()
            if self._lost_since is None:
                self._lost_since = now
            if now - self._lost_since + seconds > self._lost_seconds:
                if self._lost_seconds <= 0:
                    raise error
                raise errors.Unavailable(
                    f"lost the planish server at {target} and could not reach it again within "
                    f"{self._lost_seconds:g} s: {error.message}",
                    reason="CONNECTION_LOST",
                ) from error
        else:
            raise error
        self._deadline.check_pause(seconds, error)
        return seconds

    def _next_backoff(self) -> float:
        longest = min(LONGEST_PAUSE_SECONDS, self._backoff * 2.0 ** min(self._attempts, 30))
        self._attempts += 1
        return longest * (0.5 + 0.5 * random.random())
