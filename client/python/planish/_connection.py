"""How to connect to a server: options, the environment, TLS and tokens."""

from __future__ import annotations

import ipaddress
import os
from dataclasses import dataclass
from typing import Any, List, Optional, Tuple

import grpc

try:
    from grpc import aio
except ImportError:  # grpcio 1.30 and 1.31
    from grpc.experimental import aio  # type: ignore[no-redef]

from ._version import __version__
from .errors import InvalidArgument

_TRUE = frozenset({"1", "true", "on", "yes", "enable"})
_FALSE = frozenset({"", "0", "false", "off", "no", "disable"})


def _invalid(message: str) -> InvalidArgument:
    return InvalidArgument(message, reason="OPTIONS_INVALID")


@dataclass(frozen=True)
class ConnectionOptions:
    """How to encrypt a connection and identify the caller. None: as the environment variable says, which the command
    ``planish`` reads too."""

    #: Whether to encrypt "host:port". Also encrypted if one of the files or the name below is given. None:
    #: $PLANISH_TLS.
    tls: Optional[bool] = None
    #: The certificate authority of the server's certificate, PEM; empty: those that gRPC trusts. None: $PLANISH_TLS_CA.
    tls_ca_file: Optional[str] = None
    #: The caller's certificate and its key, PEM; both or none. None: $PLANISH_TLS_CERT and $PLANISH_TLS_KEY.
    tls_cert_file: Optional[str] = None
    tls_key_file: Optional[str] = None
    #: The name in the server's certificate; empty: the host. None: $PLANISH_TLS_SERVER_NAME.
    tls_server_name: Optional[str] = None
    #: Identifies the caller. None: the content of token_file, else $PLANISH_TOKEN.
    token: Optional[str] = None
    #: A file with the token. It is read for every call, so it may change at any time. None: $PLANISH_TOKEN_FILE.
    token_file: Optional[str] = None
    #: Send the token to other machines even without TLS, where anybody on the way can read it.
    token_over_plaintext: bool = False

    def with_environment(self) -> "ConnectionOptions":
        """These options with each None replaced by the environment's value."""
        token, token_file = self.token, self.token_file
        if token is None and token_file is None:
            token_file = os.environ.get("PLANISH_TOKEN_FILE", "")
            token = "" if token_file else os.environ.get("PLANISH_TOKEN", "")
        return ConnectionOptions(
            tls=_flag("PLANISH_TLS") if self.tls is None else self.tls,
            tls_ca_file=_text(self.tls_ca_file, "PLANISH_TLS_CA"),
            tls_cert_file=_text(self.tls_cert_file, "PLANISH_TLS_CERT"),
            tls_key_file=_text(self.tls_key_file, "PLANISH_TLS_KEY"),
            tls_server_name=_text(self.tls_server_name, "PLANISH_TLS_SERVER_NAME"),
            token=token or "",
            token_file=token_file or "",
            token_over_plaintext=self.token_over_plaintext,
        )


def _text(value: Optional[str], variable: str) -> str:
    return os.environ.get(variable, "") if value is None else value


def _flag(variable: str) -> bool:
    value = os.environ.get(variable, "").strip().lower()
    if value in _TRUE:
        return True
    if value in _FALSE:
        return False
    raise _invalid(f"${variable} is {value!r}, which is neither true nor false")


def is_unix(target: str) -> bool:
    return target.startswith(("unix:", "unix-abstract:"))


def is_within_this_machine(target: str) -> bool:
    """Whether the connection stays within this machine."""
    if is_unix(target):
        return True
    host = target.rpartition(":")[0].strip("[]")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Connection:
    """Makes channels to one server, and the metadata of every call. Thread-safe.

    Raises :class:`InvalidArgument` (OPTIONS_INVALID) if options do not match each other or `target`, or one of their
    files cannot be used. All files except the token's are read only here.
    """

    def __init__(self, target: str, options: ConnectionOptions, connect_timeout_seconds: float) -> None:
        if not target:
            raise _invalid('target is empty; it must be "host:port" or "unix:/path"')
        self.target = target
        self._options = options
        self._connect_timeout_seconds = connect_timeout_seconds
        files = (options.tls_ca_file, options.tls_cert_file, options.tls_key_file, options.tls_server_name)
        self.uses_tls = not is_unix(target) and (bool(options.tls) or any(files))
        if bool(options.tls_cert_file) != bool(options.tls_key_file):
            raise _invalid("a client certificate takes two files: the certificate and its key")
        self._pem: Tuple[Optional[bytes], Optional[bytes], Optional[bytes]] = (None, None, None)
        if self.uses_tls:
            self._pem = (
                _read_pem("the CA", options.tls_ca_file),
                _read_pem("the client's key", options.tls_key_file),
                _read_pem("the client certificate", options.tls_cert_file),
            )
        has_token = bool(options.token or options.token_file)
        if has_token and not (self.uses_tls or options.token_over_plaintext or is_within_this_machine(target)):
            raise _invalid(f"the token would travel to {target} unencrypted, for everybody on the way to read: use TLS")
        self._token()

    def channel(self, module: Any) -> Any:
        """A new channel of `module`, which is `grpc` or `grpc.aio`."""
        arguments: List[Tuple[str, Any]] = [
            ("grpc.max_receive_message_length", -1),
            ("grpc.max_send_message_length", -1),
            # gRPC's defaults, 20 s an attempt and 1 s and more between attempts, suit servers that talk to servers.
            ("grpc.min_reconnect_backoff_ms", int(1000 * self._connect_timeout_seconds)),
            ("grpc.initial_reconnect_backoff_ms", 100),
            ("grpc.max_reconnect_backoff_ms", 2000),
            # Notices a silently vanished peer within half a minute.
            ("grpc.keepalive_time_ms", 20000),
            ("grpc.keepalive_timeout_ms", 10000),
            # Clients of different servers, or of a restarted server, must not share connections and their back-off.
            ("grpc.use_local_subchannel_pool", 1),
            ("grpc.primary_user_agent", f"planish-python/{__version__}"),
        ]
        if is_within_this_machine(self.target):
            arguments.append(("grpc.enable_http_proxy", 0))
        if not self.uses_tls:
            return module.insecure_channel(self.target, options=arguments)
        if self._options.tls_server_name:
            arguments.append(("grpc.ssl_target_name_override", self._options.tls_server_name))
        ca, key, certificate = self._pem
        credentials = grpc.ssl_channel_credentials(ca, key, certificate)
        return module.secure_channel(self.target, credentials, options=arguments)

    def metadata(self) -> List[Tuple[str, str]]:
        """The metadata that identifies the caller."""
        token = self._token()
        return [("authorization", f"Bearer {token}")] if token else []

    def _token(self) -> str:
        token = self._options.token or ""
        if not token and self._options.token_file:
            token = _read("the token", self._options.token_file).decode("latin-1").strip()
            if not token:
                raise _invalid(f"there is no token in {self._options.token_file}")
        if any(not "!" <= c <= "~" for c in token):
            raise _invalid("the token has a character that is no letter, digit or sign of ASCII")
        return token


def _read(what: str, path: str) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError as error:
        raise _invalid(f"cannot read {what} {path}: {error.strerror}") from error


def _read_pem(what: str, path: Optional[str]) -> Optional[bytes]:
    if not path:
        return None
    pem = _read(what, path)
    if b"-----BEGIN " not in pem:
        raise _invalid(f"{path} is no PEM file")
    return pem
