"""When a call is made again, after which pause, and when it is given up: the one place that decides."""

from __future__ import annotations

import random
import time
from dataclasses import dataclass
from typing import Optional

from . import errors
from ._status import is_from_server

#: Between attempts to reach a server that was lost.
LONGEST_PAUSE_SECONDS = 5.0
#: Between attempts to get room on a server that is full and does not say when it will have some.
_SHORTEST_ROOM_PAUSE_SECONDS = 0.05


@dataclass(frozen=True)
class RetryPolicy:
    """How patient a client is. Thread-safe, like all that is never changed."""

    #: A call gives up with SERVER_UNREACHABLE when no connection stands after this time. A refused connection fails at once.
    connect_timeout_seconds: float = 5.0
    #: How long calls about a job wait for a server that was lost on the way, from its last word on.
    reattach_seconds: float = 60.0
    #: The wait between attempts starts with this and doubles up to 5 s, a little at random.
    backoff_seconds: float = 0.1
    #: How long a new job waits for room in a queue or store that is full, at the pace that the server asks for; 0: not at all.
    queue_full_wait_seconds: float = 60.0
    #: How long the other calls are repeated; 0: not at all.
    retry_seconds: float = 10.0


class Deadline:
    """The time that the caller gave to a whole call; None: no limit."""

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
        """Raises if the time is over before the pause is."""
        if self._end is not None and time.monotonic() + seconds > self._end:
            message = f"the time given to the call passed while waiting: {why.message}"
            raise errors.DeadlineExceeded(message) from why


def is_broken(error: errors.Error) -> bool:
    """Whether the connection broke, as opposed to a server that answered."""
    if isinstance(error, errors.Unavailable):
        return True
    if error.reason == "UPLOAD_BUSY":
        return True  # by a call that broke, which the server has not noticed yet
    # Resets and broken frames come from the transport; what the server itself says has a reason of its own.
    return not is_from_server(error) and error.code in ("INTERNAL", "UNKNOWN")


def asks_to_wait(error: errors.Error) -> bool:
    """Whether the server is full and says so."""
    if not isinstance(error, errors.ResourceExhausted):
        return False
    return error.retry_after_seconds > 0 or error.reason == "QUEUE_FULL"


class Patience:
    """Of one call, over all its attempts.

    `lost_seconds`, `room_seconds`: how long to bear a server that is lost, and one that is full.
    """

    def __init__(self, policy: RetryPolicy, deadline: Deadline, *, lost_seconds: float, room_seconds: float) -> None:
        self._backoff = policy.backoff_seconds
        self._deadline = deadline
        self._lost_seconds = lost_seconds
        self._room_seconds = room_seconds
        self._attempts = 0
        self._lost_since: Optional[float] = None
        self._waited_for_room = 0.0
        #: For this call a private server has been started again.
        self.has_revived = False

    def succeeded(self) -> None:
        """Something came through: the next trouble is a new one."""
        self._attempts = 0
        self._lost_since = None

    def pause(self, error: errors.Error, *, reached: bool, target: str) -> float:
        """Seconds to wait before the next attempt. Raises where there is to be none.

        `reached`: the server has answered this client before. One that was never there is not coming back soon.
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
