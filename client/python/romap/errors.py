"""The exception of this package, and what it says about the connection."""

from __future__ import annotations

from typing import Any

import grpc

_BROKEN_LINK = ("UNAVAILABLE", "DEADLINE_EXCEEDED", "CANCELLED", "UNKNOWN")


class Error(Exception):
    """An error of the server, the connection or the input: `code` is the name of a gRPC status, e.g. "NOT_FOUND"."""

    def __init__(self, code: str, message: str) -> None:
        self.code = code
        self.message = " ".join(message.split())
        super().__init__(f"{code}: {self.message}")

    @property
    def may_pass(self) -> bool:
        """Whether it may come from the connection, or from a server that stops or starts, so that the same call may
        succeed later."""
        return self.code in _BROKEN_LINK


def invalid(message: str) -> Error:
    return Error("INVALID_ARGUMENT", message)


def from_rpc(failure: Any) -> Error:
    """`failure`: a grpc.RpcError of a call."""
    code: grpc.StatusCode = failure.code()
    return Error(code.name, failure.details() or "no reason was given")
