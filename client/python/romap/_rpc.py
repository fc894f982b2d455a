"""The connection to a server: its channel, and calls with the token, time limits and errors of this package."""

from __future__ import annotations

import ipaddress
import os
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator, List, Optional, Tuple

import grpc

from romap.v1.mapping_pb2_grpc import MappingStub

from .errors import Error, from_rpc, invalid

MAX_MESSAGE_BYTES = 32 << 20  # as the server's transport.max_message_bytes
CONNECT_TIMEOUT_S = 3.0
CALL_TIMEOUT_S = 30.0
EXPORT_TIMEOUT_S = 300.0
_KEEPALIVE_MS = 20_000


@dataclass(frozen=True)
class Tls:
    """How the client proves the server's identity and its own. All files are PEM files."""

    ca: Optional[str] = None  # who may have signed the server's certificate; None: as gRPC's built-in list says
    certificate: Optional[str] = None  # the client's own, for servers that want one
    key: Optional[str] = None
    server_name: Optional[str] = None  # in the server's certificate; None: the host of the address


def read_token(token: Optional[str], token_file: Optional[str]) -> Optional[str]:
    """`token`, or the content of `token_file` or of the file that ROMAP_TOKEN_FILE names; None: there is none."""
    path = token_file or os.environ.get("ROMAP_TOKEN_FILE")
    if token is None and path:
        token = _read(path).decode("utf-8", "replace")
        if len(token.split()) != 1:
            raise invalid(f"{path}: must have one token, as printed by: romap-server token create")
    token = token.strip() if token else None
    if token and not (token.isascii() and token.isprintable() and " " not in token):
        raise invalid("the token is not one that romap-server token create printed")
    return token or None


def _read(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        code = "NOT_FOUND" if isinstance(error, FileNotFoundError) else "FAILED_PRECONDITION"
        raise Error(code, f"cannot read {path}: {error.strerror}") from None


def stays_on_this_machine(address: str) -> bool:
    """Only numbers and "localhost" count: a name may lead anywhere."""
    if address.startswith("unix:"):
        return True
    host = address.rpartition(":")[0]
    if host in ("localhost", "[::1]"):
        return True
    try:
        return ipaddress.IPv4Address(host).is_loopback
    except ValueError:
        return False


class Rpc:
    """Thread-safe. Every call raises Error."""

    def __init__(self, address: str, token: Optional[str], tls: Optional[Tls]) -> None:
        host, colon, port = address.rpartition(":")
        if not address.startswith("unix:") and not (host and colon and port.isdigit() and int(port) < 65536):
            raise invalid(f"the address must be HOST:PORT, is '{address}'")
        if token and tls is None and not stays_on_this_machine(address):
            raise invalid(f"the token is not sent to {address} in clear text; connect with TLS")
        self.address = address
        self.tls = tls
        self._closed = False
        self._metadata: List[Tuple[str, str]] = [("authorization", f"Bearer {token}")] if token else []
        options: List[Tuple[str, Any]] = [
            ("grpc.max_receive_message_length", MAX_MESSAGE_BYTES),
            ("grpc.max_send_message_length", MAX_MESSAGE_BYTES),
            # Detects a server that disappears without closing the connection (power or network failure).
            ("grpc.keepalive_time_ms", _KEEPALIVE_MS),
            ("grpc.keepalive_timeout_ms", _KEEPALIVE_MS),
            ("grpc.http2.max_pings_without_data", 0),
            # Connects quickly to a server that is still starting.
            ("grpc.initial_reconnect_backoff_ms", 100),
            ("grpc.max_reconnect_backoff_ms", 2000),
            # The global pool would share the back-off with other channels to the same address.
            ("grpc.use_local_subchannel_pool", 1),
        ]
        if tls is None:
            self._channel = grpc.insecure_channel(address, options)
        else:
            if (tls.certificate is None) != (tls.key is None):
                raise invalid("TLS: a client certificate needs both the certificate and its key")
            if tls.server_name:
                options.append(("grpc.ssl_target_name_override", tls.server_name))
            files = [None if path is None else _read(path) for path in (tls.ca, tls.key, tls.certificate)]
            self._channel = grpc.secure_channel(address, grpc.ssl_channel_credentials(*files), options)
        self.stub = MappingStub(self._channel)

    def wait_until_ready(self) -> None:
        ready = grpc.channel_ready_future(self._channel)
        try:
            ready.result(timeout=CONNECT_TIMEOUT_S)
        except grpc.FutureTimeoutError:
            hint = (
                "with TLS (does it run there, with TLS, and did the CA sign its certificate for this name?)"
                if self.tls
                else f"(start it with: romap-server --listen {self.address}; if it uses TLS: tls=romap.Tls(...))"
            )
            raise Error("UNAVAILABLE", f"cannot connect to romap-server at {self.address} {hint}") from None
        finally:
            ready.cancel()

    def call(self, method: str, request: Any, timeout_s: float = CALL_TIMEOUT_S) -> Any:
        """A call with one answer."""
        self._check_open()
        try:
            return getattr(self.stub, method)(request, timeout=timeout_s, metadata=self._metadata)
        except grpc.RpcError as failure:
            raise from_rpc(failure) from None

    def read(self, method: str, request: Any, timeout_s: float = EXPORT_TIMEOUT_S) -> Iterator[Any]:
        """The answers of a call that ends by itself."""
        self._check_open()
        call = getattr(self.stub, method)(request, timeout=timeout_s, metadata=self._metadata)
        try:
            yield from call
        except grpc.RpcError as failure:
            raise from_rpc(failure) from None
        finally:
            call.cancel()

    def open(self, method: str, request: Any) -> Tuple[Any, Any]:
        """Opens a stream and waits for its first answer. Returns the call and StreamOpened."""
        self._check_open()
        call = getattr(self.stub, method)(request, metadata=self._metadata)
        is_late = threading.Event()

        def give_up() -> None:
            is_late.set()
            call.cancel()

        timer = threading.Timer(CALL_TIMEOUT_S, give_up)
        timer.daemon = True
        timer.start()
        try:
            return call, next(call).opened
        except StopIteration:
            raise Error("UNKNOWN", "the server closed the stream without an answer") from None
        except grpc.RpcError as failure:
            if is_late.is_set():
                raise Error("DEADLINE_EXCEEDED", f"the server did not answer within {CALL_TIMEOUT_S:.0f} s") from None
            raise from_rpc(failure) from None
        finally:
            timer.cancel()

    def _check_open(self) -> None:
        if self._closed:
            raise Error("FAILED_PRECONDITION", "this connection was closed by the program")

    def close(self) -> None:
        self._closed = True
        self._channel.close()
