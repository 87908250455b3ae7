"""The viewer's server answers its own page and nobody else."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPResponse

import pytest

from intersection_env import Intersection, Predictor
from intersection_env.viewer import server as serving
from intersection_env.viewer.page_files import page_files
from intersection_env.viewer.server import MOST_BODY, Server
from intersection_env.viewer.session import Place, Session

Answer = tuple[HTTPResponse, bytes]


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with Server(Session([Place(Intersection.load("t_junction"))], Predictor.load("idm"))) as one:
        thread = threading.Thread(target=one.serve_forever)
        thread.start()
        yield one
        one.shutdown()
        thread.join()


def ask(
    server: Server, path: str, body: bytes | None = None, *, method: str | None = None, **headers: str | None
) -> Answer:
    """The answer to a request with the page's own headers, but for those that are given; None leaves one out."""
    host = f"127.0.0.1:{server.server_port}"
    own = {"Host": host, "Origin": f"http://{host}" if body is not None else None, "Content-Type": "application/json"}
    sent = own | {name.replace("_", "-"): value for name, value in headers.items()}
    connection = HTTPConnection("127.0.0.1", server.server_port, timeout=60)
    connection.putrequest(method or ("GET" if body is None else "POST"), path, skip_host=True)
    for name, value in sent.items():
        if value is not None:
            connection.putheader(name, value)
    if body is not None and "Content_Length" not in headers and "Transfer_Encoding" not in headers:
        connection.putheader("Content-Length", str(len(body)))
    connection.endheaders(body)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer, content


def page(server: Server, name: str = "") -> str:
    return f"/{server.token}/{name}"


def test_it_listens_on_this_machine_alone_under_an_address_that_nobody_guesses(server: Server) -> None:
    assert server.server_address[0] == "127.0.0.1"
    assert server.address == f"http://127.0.0.1:{server.server_port}/{server.token}/"
    assert len(server.token) >= 32
    other = Server(server.session)
    other.server_close()
    assert other.token != server.token


def test_the_page_and_its_files_are_served_and_nothing_else(server: Server) -> None:
    answer, content = ask(server, page(server))
    assert answer.status == 200
    assert content == page_files()["index.html"]
    for name, wanted in page_files().items():
        answer, content = ask(server, page(server, name))
        assert (answer.status, content) == (200, wanted)
    for name in ("server.py", "../server.py", "..%2fserver.py", "page/main.js", "/etc/passwd", "opened"):
        answer, content = ask(server, page(server, name))
        assert answer.status == 404
        assert json.loads(content) == {"error": "there is no such file"}


def test_an_answer_is_sent_at_once(server: Server) -> None:
    """Its head and its body are two packets; by default the second waits 40 ms for the word that the first has come."""
    connection = HTTPConnection("127.0.0.1", server.server_port, timeout=60)
    connection.request("GET", page(server))
    connection.getresponse().read()
    (own,) = [one for one in server._open if one.getpeername() == connection.sock.getsockname()]
    assert own.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
    connection.close()


def test_answers_are_those_of_the_session(server: Server) -> None:
    answer, content = ask(server, page(server, "opened"), b"{}")
    assert answer.status == 200
    assert json.loads(content) == json.loads(json.dumps(server.session.opened()))
    answer, content = ask(server, page(server, "road"), b'{"place": "t_junction"}')
    assert json.loads(content)["name"] == "t_junction"
    answer, content = ask(server, page(server, "road"), b'{"place": "x"}')
    assert answer.status == 422
    assert json.loads(content)["error"] == 'place "x" is not open; there are t_junction'


@pytest.mark.parametrize(
    "path", ["/", "", "/x/", "/x/main.js", "//", "/{token}", "/{token}x/", "/{start}/", "/%C3%A9/"]
)
def test_another_token_is_refused(server: Server, path: str) -> None:
    asked = path.format(token=server.token, start=server.token[:-1])
    for body in (None, b"{}"):
        answer, content = ask(server, asked or "x", body)
        assert answer.status == 403
        assert server.token.encode() not in content


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "0.0.0.0:{port}", "[::1]:{port}", "", None],
)
def test_another_host_is_refused_as_names_may_be_bound_anew(server: Server, host: str | None) -> None:
    named = None if host is None else host.format(port=server.server_port)
    for body in (None, b"{}"):
        answer, _ = ask(server, page(server, "" if body is None else "opened"), body, Host=named)
        assert answer.status == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1:{port}", "http://127.0.0.1:1", "http://127.0.0.1"]
)
def test_another_page_is_refused(server: Server, origin: str) -> None:
    named = origin.format(port=server.server_port)
    assert ask(server, page(server), Origin=named)[0].status == 403
    assert ask(server, page(server, "opened"), b"{}", Origin=named)[0].status == 403


def test_a_question_that_does_not_say_which_page_asks_is_refused(server: Server) -> None:
    assert ask(server, page(server, "opened"), b"{}", Origin=None)[0].status == 403
    local = f"localhost:{server.server_port}"
    assert ask(server, page(server, "opened"), b"{}", Host=local, Origin=f"http://{local}")[0].status == 200


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "HEAD", "CONNECT"])
def test_other_methods_are_not_known(server: Server, method: str) -> None:
    assert ask(server, page(server), method=method)[0].status == 501


@pytest.mark.parametrize(
    ("body", "headers", "status"),
    [
        (b"{", {}, 400),
        (b"[]", {}, 400),
        (b"\xff", {}, 400),
        (b"[" * 100_000, {}, 400),
        (b"{}", {"Content_Type": "text/plain"}, 415),
        (b"{}", {"Content_Type": "application/x-www-form-urlencoded"}, 415),
        (b"", {"Content_Length": str(MOST_BODY + 1)}, 413),
        (b"", {"Content_Length": "9" * 10_000}, 413),
        (b"", {"Content_Length": "-1"}, 411),
        (b"", {"Content_Length": "x"}, 411),
        (b"", {"Transfer_Encoding": "chunked"}, 411),
    ],
)
def test_what_is_no_question_is_refused(server: Server, body: bytes, headers: dict[str, str], status: int) -> None:
    answer, content = ask(server, page(server, "opened"), body, **headers)
    assert answer.status == status
    assert "error" in json.loads(content)


def test_every_answer_forbids_what_the_page_does_not_need(server: Server) -> None:
    for path, body in ((page(server), None), (page(server, "opened"), b"{}"), ("/x/", None)):
        answer, _ = ask(server, path, body)
        policy = answer.headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self';")
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert answer.headers["Cache-Control"] == "no-store"
        assert answer.headers["Access-Control-Allow-Origin"] is None


def test_a_bug_is_said_to_be_one_and_does_not_end_the_server(
    server: Server, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(kind: str, request: object) -> None:
        raise ZeroDivisionError("secret")

    monkeypatch.setattr(server.session, "answer", broken)
    answer, content = ask(server, page(server, "road"), b"{}")
    assert answer.status == 500
    assert b"secret" not in content
    assert "ZeroDivisionError" in capsys.readouterr().err
    assert ask(server, page(server))[0].status == 200


def test_a_connection_that_says_nothing_is_ended(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving.Handler, "timeout", 0.1)
    connection = HTTPConnection("127.0.0.1", server.server_port, timeout=30)
    connection.connect()
    assert connection.sock.recv(1) == b""
    connection.close()


def test_a_connection_that_is_open_does_not_keep_the_server_from_ending(server: Server) -> None:
    with Server(server.session) as other:
        thread = threading.Thread(target=other.serve_forever)
        thread.start()
        connection = HTTPConnection("127.0.0.1", other.server_port, timeout=60)
        connection.request("GET", f"/{other.token}/")
        assert connection.getresponse().read() == page_files()["index.html"]
        other.shutdown()
        thread.join()
        begin = time.monotonic()
    assert time.monotonic() - begin < 0.5 * serving.PATIENCE
    assert connection.sock.recv(1) == b""
    connection.close()


def test_a_port_that_is_taken_is_said(server: Server) -> None:
    with pytest.raises(OSError, match=f"port {server.server_port} of .*: Address already in use"):
        Server(server.session, server.server_port)
    with pytest.raises(OSError, match="ports are from 0 to 65535"):
        Server(server.session, 70000)
