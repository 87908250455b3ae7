"""Serves the viewer's page to browsers on this machine alone.

The address holds a random token, and a request must bear it, name this machine as its host, and come from this page
where it says where it comes from: so neither other users of the machine nor other pages in the browser are answered.
Nothing is served but the files of the page, which are read once, and the session's answers.
"""

from __future__ import annotations

import hmac
import json
import secrets
import socket
import sys
import traceback
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from intersection_env.viewer.page_files import KINDS, page_files
from intersection_env.viewer.session import Session

ADDRESS = "127.0.0.1"
NAMES = (ADDRESS, "localhost")
TOKEN_BYTES = 24
MOST_BODY = 1_000_000  # [byte], ours: 64 vehicles take a hundredth of it
PATIENCE = 30.0  # [s], for which a connection may be silent
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self';"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class Refused(Exception):  # noqa: N818, it is what is answered
    """A request that is not answered, and why."""

    def __init__(self, status: HTTPStatus, why: str) -> None:
        super().__init__(why)
        self.status = status


class Server(ThreadingHTTPServer):
    """A session behind an address that only who is told can guess."""

    daemon_threads = False  # who is being answered is answered before the process ends

    def __init__(self, session: Session, port: int = 0) -> None:
        """Listens on this port of the loopback address; 0 takes a free one.

        Raises:
            OSError: the port is taken, or may not be used.
        """
        self.session = session
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self.files = page_files()
        self._open: set[Any] = set()
        try:
            super().__init__((ADDRESS, port), Handler)
        except (OSError, OverflowError) as error:
            why = error.strerror if isinstance(error, OSError) else "ports are from 0 to 65535"
            raise OSError(f"port {port} of {ADDRESS}: {why}") from None

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://{ADDRESS}:{self.server_port}/{self.token}/"

    @property
    def hosts(self) -> tuple[str, ...]:
        """What a request may name as its host."""
        return tuple(f"{name}:{self.server_port}" for name in NAMES)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answers in a thread, and knows the connection until it is ended."""
        self._open.add(request)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Ends a connection."""
        self._open.discard(request)
        super().shutdown_request(request)

    def server_close(self) -> None:
        """Ends all connections, most of which only wait for another request."""
        for one in tuple(self._open):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RD)
        super().server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Reports what went wrong, but for a browser that has closed its tab."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """One connection."""

    server: Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "intersection_env", ""
    timeout = PATIENCE
    disable_nagle_algorithm = True  # or a body waits 40 ms for the word that its head has come

    def do_GET(self) -> None:
        """The files of the page, by their names."""
        try:
            name = self._admitted() or "index.html"
            if name not in self.server.files:
                raise Refused(HTTPStatus.NOT_FOUND, "there is no such file")
        except Refused as refused:
            self._refuse(refused)
        else:
            self._send(HTTPStatus.OK, KINDS[name.rpartition(".")[2]], self.server.files[name])

    def do_POST(self) -> None:
        """The session's answers, by their kinds."""
        try:
            answer = self._answer(self._admitted(from_page=True), self._body())
        except Refused as refused:
            self._refuse(refused)
        else:
            self._json(HTTPStatus.OK, answer)

    def _answer(self, kind: str, request: dict[str, Any]) -> dict[str, Any]:
        session = self.server.session
        try:
            return session.opened() if kind == "opened" else session.answer(kind, request)
        except (ValueError, TypeError) as error:
            raise Refused(HTTPStatus.UNPROCESSABLE_ENTITY, str(error)) from None
        except Exception:  # a bug: whoever started the command sees where, the page says that it is one
            traceback.print_exc()
            raise Refused(HTTPStatus.INTERNAL_SERVER_ERROR, "a bug: the command's terminal says where") from None

    def _admitted(self, from_page: bool = False) -> str:
        """What is asked for, below the token.

        Raises:
            Refused: another host, another page or another token; from_page: or no word of the page that asks.
        """
        hosts, origins = self.headers.get_all("Host", []), self.headers.get_all("Origin", [])
        allowed = [f"http://{host}" for host in self.server.hosts]
        if len(hosts) != 1 or hosts[0] not in self.server.hosts:
            raise Refused(HTTPStatus.FORBIDDEN, "another host is asked for")
        if len(origins) > 1 or (from_page and not origins) or any(one not in allowed for one in origins):
            raise Refused(HTTPStatus.FORBIDDEN, "another page asks")
        _, _, rest = urlsplit(self.path).path.partition("/")
        token, slash, name = rest.partition("/")
        if not slash or not hmac.compare_digest(token.encode(), self.server.token.encode()):
            raise Refused(HTTPStatus.FORBIDDEN, "the address is not the one that the command printed")
        return name

    def _body(self) -> dict[str, Any]:
        """The request's JSON.

        Raises:
            Refused: of another kind, without a length, too long, or no JSON object.
        """
        if self.headers.get_content_type() != "application/json":
            raise Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "wanted application/json")
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()) or "Transfer-Encoding" in self.headers:
            raise Refused(HTTPStatus.LENGTH_REQUIRED, "wanted a length")
        if len(length) > len(str(MOST_BODY)) or int(length) > MOST_BODY:
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"wanted at most {MOST_BODY} bytes")
        try:
            found = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            raise Refused(HTTPStatus.BAD_REQUEST, "wanted JSON") from None
        if not isinstance(found, dict):
            raise Refused(HTTPStatus.BAD_REQUEST, "wanted a JSON object")
        return found

    def _refuse(self, refused: Refused) -> None:
        self.close_connection = True  # what is left of such a request is not read
        self._json(refused.status, {"error": str(refused)})

    def _json(self, status: HTTPStatus, answer: dict[str, Any]) -> None:
        self._send(status, "application/json", json.dumps(answer, allow_nan=False, separators=(",", ":")).encode())

    def _send(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        if self.close_connection:
            self.send_header("Connection", "close")
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing: the address bears the token, and requests are many."""
