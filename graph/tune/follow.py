"""What follows a slider: small changes to the page, sent together, the next after the last."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

from nicegui import Client, ui

from tactograph.graph.tune.picture_view import PictureView

SHOW_TIMEOUT_S = 3.0
"""So long a page may take to show a picture before it is sent the next, as one in the back does."""


class Follow:
    """Collects changes; `send` sends what differs from what the page has.

    The page answers when it shows them.  Until then the newest of each is kept: what a browser
    cannot show in time is never sent.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._wanted: dict[tuple[int, str], tuple[Any, ...]] = {}
        self._sent: dict[tuple[int, str], tuple[Any, ...]] = {}
        script = (resources.files("tactograph.graph.tune") / "follow.js").read_text("utf-8")
        ui.add_body_html(f"<script>{script}</script>")

    def html(self, element: ui.element, markup: str) -> None:
        """Markup for an element that has nothing else in it."""
        self._wanted[element.id, "html"] = (markup,)

    def background(self, element: ui.element, colours: str) -> None:
        """What an element has behind it, as in CSS."""
        self._wanted[element.id, "background"] = (colours,)

    def value(self, element: ui.element, words: str) -> None:
        """What stands in an input, whatever the page has made of it since."""
        self._sent.pop((element.id, "value"), None)
        self._wanted[element.id, "value"] = (words,)

    def picture(self, view: PictureView, uri: str, size: tuple[int, int], lines: str) -> None:
        """A picture, and the lines on it."""
        self._wanted[view.id, "picture"] = (uri, *size, lines)

    async def send(self) -> None:
        """Send what is new, and wait until it is shown."""
        there = self._client.elements
        self._sent = {key: words for key, words in self._sent.items() if key[0] in there}
        new = {key: words for key, words in self._wanted.items() if self._sent.get(key) != words}
        self._wanted.clear()
        if not new:
            return
        self._sent.update(new)
        changes = json.dumps([[*key, *words] for key, words in new.items()])
        try:
            await self._client.run_javascript(f"return follow({changes})", timeout=SHOW_TIMEOUT_S)
        except TimeoutError:
            return  # it will show them when it comes to the front
