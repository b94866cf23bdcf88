"""Who may connect to a server of streams, and how fast a client may send."""

from __future__ import annotations

import asyncio
import hmac
import http
import logging
import secrets
import socket
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

# Answers to a flood of pings whose sender is gone.
logging.getLogger("asyncio").addFilter(lambda r: r.msg != "socket.send() raised exception.")
LOCAL = ("localhost", "127.0.0.1", "::1")
MAX_BYTES_PER_S = 1 << 15  # a client that sends more must wait: parsing takes the simulation's time


@dataclass(frozen=True)
class Access:
    """Rule for who may connect: whoever has the token; without one, only programs of this machine.

    Attributes:
        token: token in the address, as `?token=…`; None: a page in a browser must be of this
            machine or have one of the origins, so that no other website can steer the robot.
        origins: origins of pages that may connect without a token, such as "https://example.org";
            None: only the server's own page may connect, even with a token.
        server: name of the server in refusals.
    """

    token: str | None
    origins: tuple[str, ...] | None = ()
    server: str = "omnisim serve"

    @classmethod
    def to(cls, host: str, origins: tuple[str, ...] = ()) -> Access:
        """Access to a server that listens on a host: with a new token, unless it is local."""
        return cls(None if host in LOCAL else new_token(), origins)

    @property
    def query(self) -> str:
        """End of the server's address: the token, if there is one."""
        return "" if self.token is None else f"/?token={self.token}"

    def check_host(self, connection: ServerConnection, request: Request) -> Response | None:
        """Refuse a request to another host than this machine, unless there is a token."""
        # another site's host name may resolve to this machine (DNS rebinding)
        if self.token is None and _host(f"//{request.headers.get('Host', '')}") not in LOCAL:
            return self.refuse(connection, 403, "expected the name of this machine as host")
        return None

    def check(self, connection: ServerConnection, request: Request) -> Response | None:
        """Refuse a connection; None accepts it. This is the server's `process_request`."""
        if (refusal := self.check_host(connection, request)) is not None:
            return refusal
        # programs send no origin, or file:// if they show pages of their own
        origin = request.headers.get("Origin", "file://")
        if self.origins is None:
            own = request.headers.get("Host", "")
            if "Origin" in request.headers and origin.partition("://")[2] != own:
                return self.refuse(connection, 403, "expected this server's own page as origin")
        if self.token is not None:
            given = parse_qs(request.path.partition("?")[2]).get("token", [""])[0].encode()
            if not hmac.compare_digest(given, self.token.encode()):
                expected = "expected the token of the address, as in ?token=…"
                return self.refuse(connection, 401, expected)
        elif origin not in ("file://", *(self.origins or ())) and _host(origin) not in LOCAL:
            expected = "expected a page of this machine as origin, or a token"
            return self.refuse(connection, 403, expected)
        return None

    def refuse(self, connection: ServerConnection, status: int, words: str) -> Response:
        """Answer in words why not."""
        return connection.respond(http.HTTPStatus(status), f"{self.server}: {words}\n")


def new_token() -> str:
    """Random token of 128 bits."""
    return secrets.token_urlsafe(16)


def _host(url: str) -> str:
    """Host name of a URL; empty if it has none."""
    try:
        return urlsplit(url).hostname or ""
    except ValueError:  # malformed IPv6
        return ""


class PacedConnection(ServerConnection):
    """Connection that reads at most `MAX_BYTES_PER_S`: TCP makes a client that floods it wait."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Limit what is received at once."""
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 14)
        super().connection_made(transport)

    def data_received(self, data: bytes) -> None:
        """Parse frames, and read the next ones when their time has come."""
        super().data_received(data)
        self.transport.pause_reading()
        self.loop.call_later(len(data) / MAX_BYTES_PER_S, self._read_on)

    def _read_on(self) -> None:
        if not self.recv_messages.paused:  # else the queue resumes reading, once it is shorter
            self.transport.resume_reading()
