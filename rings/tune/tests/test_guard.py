"""Only this machine, with the token, and no other page of the same browser."""

import asyncio
from typing import Any

import pytest

pytest.importorskip("starlette", reason="'make test-all' installs it")
from tactograph.rings.tune.guard import Guard

pytestmark = pytest.mark.slow
HOST = (b"host", b"127.0.0.1:8123")
COOKIE = (b"cookie", b"other=1; tactograph_8123=right")


def answer(
    *headers: tuple[bytes, bytes], query: bytes = b"", kind: str = "http"
) -> tuple[bool, list[dict[str, Any]]]:
    """Whether a request reaches the page, and what is sent back."""
    reached: list[str] = []
    sent: list[dict[str, Any]] = []

    async def page(scope: Any, receive: Any, send: Any) -> None:
        reached.append(scope["type"])
        if scope["type"] == "http":
            await send({"type": "http.response.start", "status": 200, "headers": []})

    async def receive() -> dict[str, Any]:
        return {"type": f"{kind}.connect"}

    async def send(message: Any) -> None:
        sent.append(message)

    guard = Guard(page, token="right", port=8123)
    scope = {"type": kind, "headers": [*headers], "query_string": query}
    asyncio.run(guard(scope, receive, send))
    return bool(reached), sent


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_the_token_opens_the_page(kind: str) -> None:
    assert answer(HOST, query=b"token=right", kind=kind)[0]
    assert answer(HOST, COOKIE, kind=kind)[0]
    assert answer((b"host", b"localhost:8123"), COOKIE, kind=kind)[0]
    assert answer(HOST, COOKIE, (b"origin", b"http://127.0.0.1:8123"), kind=kind)[0]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    ("headers", "query"),
    [
        ((HOST,), b""),
        ((HOST,), b"token=wrong"),
        ((HOST,), b"token="),
        ((HOST, (b"cookie", b"tactograph_8123=wrong")), b""),
        ((HOST, (b"cookie", b"tactograph_9999=right")), b""),
        ((COOKIE,), b"token=right"),
        (((b"host", b"evil.example"), COOKIE), b"token=right"),
        (((b"host", b"127.0.0.1:9999"), COOKIE), b""),
        ((HOST, COOKIE, (b"origin", b"http://evil.example")), b"token=right"),
        ((HOST, COOKIE, (b"origin", b"http://127.0.0.1:9999")), b""),
        ((HOST, COOKIE, (b"origin", b"null")), b""),
    ],
)
def test_nothing_else_does(kind: str, headers: tuple[Any, ...], query: bytes) -> None:
    reached, sent = answer(*headers, query=query, kind=kind)
    assert not reached
    assert sent[0]["code" if kind == "websocket" else "status"] in (403, 1008)


def test_other_sites_cannot_make_the_browser_send_the_cookie() -> None:
    _, sent = answer(HOST, query=b"token=right")
    (cookie,) = [value for name, value in sent[0]["headers"] if name == b"set-cookie"]
    assert cookie == b"tactograph_8123=right; Path=/; HttpOnly; SameSite=Strict"
