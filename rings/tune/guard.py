"""Access to the page: from this machine, with the token, and from no other site's page."""

import hmac

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

REFUSAL_TEXT = "tactograph tune: open the address that the terminal shows, with its token\n"


class Guard:
    """Refuses every request, and every web socket, without the token, or from elsewhere.

    The first address carries the token; later requests carry it in a cookie that no other site's
    page can make the browser send.  Host is compared, so that no foreign name can point to this
    machine; so is Origin, where the browser states it.
    """

    def __init__(self, app: ASGIApp, *, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._cookie = f"tactograph_{port}"
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        request = HTTPConnection(scope)
        query_token = request.query_params.get("token", "")
        token = query_token or request.cookies.get(self._cookie, "")
        is_known = hmac.compare_digest(token.encode(), self._token.encode())

        async def send_with_cookie(message: Message) -> None:
            if message["type"] == "http.response.start" and query_token:
                cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"
                message["headers"] = [*message.get("headers", ()), (b"set-cookie", cookie.encode())]
            await send(message)

        if is_known and self._is_here(request):
            await self._app(scope, receive, send_with_cookie)
        elif scope["type"] == "http":
            await PlainTextResponse(REFUSAL_TEXT, 403)(scope, receive, send)
        else:
            await WebSocketClose(1008)(scope, receive, send)

    def _is_here(self, request: HTTPConnection) -> bool:
        origin = request.headers.get("origin")
        from_here = origin is None or origin.removeprefix("http://") in self._hosts
        return request.headers.get("host", "") in self._hosts and from_here
