"""Small changes to the page that follow a slider, sent together once the last are shown."""

import json
from importlib import resources
from typing import Any

from nicegui import Client, ui

SHOW_TIMEOUT_S = 3.0
"""Time for a page to show a picture; one in the background takes longer, and gets the next."""


class Follow:
    """Collects changes; `send` sends those that differ from the page.

    The page answers when it shows them.  Until then only the newest change of each element is kept,
    so a slow browser is never sent outdated ones.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._pending: dict[tuple[int, str], tuple[Any, ...]] = {}
        self._sent: dict[tuple[int, str], tuple[Any, ...]] = {}
        script = (resources.files("tactograph.rings.tune") / "follow.js").read_text("utf-8")
        ui.add_body_html(f"<script>{script}</script>")

    def html(self, element: ui.element, markup: str) -> None:
        """Set the markup of an element that holds nothing else."""
        self._pending[element.id, "html"] = (markup,)

    def background(self, element: ui.element, colours: str) -> None:
        """Set the background of an element, as in CSS."""
        self._pending[element.id, "background"] = (colours,)

    def value(self, element: ui.element, words: str) -> None:
        """Set the text of an input, even if the page has changed it since."""
        self._sent.pop((element.id, "value"), None)
        self._pending[element.id, "value"] = (words,)

    def picture(self, view: ui.element, uri: str, size: tuple[int, int], lines: str) -> None:
        """Set a picture, and the lines on it."""
        self._pending[view.id, "picture"] = (uri, *size, lines)

    async def send(self) -> None:
        """Send the new changes, and wait until they are shown."""
        elements = self._client.elements
        self._sent = {key: words for key, words in self._sent.items() if key[0] in elements}
        new = {key: words for key, words in self._pending.items() if self._sent.get(key) != words}
        self._pending.clear()
        if not new:
            return
        self._sent.update(new)
        changes = json.dumps([[*key, *words] for key, words in new.items()])
        try:
            await self._client.run_javascript(f"return follow({changes})", timeout=SHOW_TIMEOUT_S)
        except TimeoutError:
            return  # the page shows them when it comes to the front
