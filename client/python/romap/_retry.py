"""How a client tries again after the connection broke."""

from __future__ import annotations

import random
import time
from dataclasses import dataclass
from typing import Callable, TypeVar

from .errors import Error

Result = TypeVar("Result")


@dataclass(frozen=True)
class Retry:
    """With delays that double and vary at random, so that many clients do not return together."""

    initial_delay_s: float = 0.1
    max_delay_s: float = 5.0
    jitter: float = 0.5  # share of a delay by which it varies
    max_down_s: float = 600.0  # gives up after this time without progress


class Delays:
    def __init__(self, options: Retry) -> None:
        self._options = options
        self.reset()

    def reset(self) -> None:
        self._next_s = self._options.initial_delay_s

    def next_s(self) -> float:
        delay_s = self._next_s * random.uniform(1 - self._options.jitter, 1 + self._options.jitter)
        self._next_s = min(2 * self._next_s, self._options.max_delay_s)
        return delay_s


def retry_while_unavailable(call: Callable[[], Result], options: Retry) -> Result:
    """Calls `call`, which must be idempotent, until it succeeds, fails for another reason than a broken link, or the
    time of `options` is over."""
    delays = Delays(options)
    deadline = time.monotonic() + options.max_down_s
    while True:
        try:
            return call()
        except Error as error:
            left_s = deadline - time.monotonic()
            if not error.may_pass or left_s <= 0:
                raise
            time.sleep(min(delays.next_s(), left_s))
