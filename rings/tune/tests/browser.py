"""A real browser without a window, driven as a person does: mouse, keys, eyes."""

import base64
import itertools
import json
import shutil
import subprocess
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any


class Browser:
    """Debian's chromium; `look` runs a script in the page, `wait` until one is true."""

    def __init__(self, folder: Path, size: tuple[int, int] = (1480, 960)) -> None:
        found = shutil.which("chromium") or shutil.which("chromium-browser")
        assert found, "chromium is missing; tests/install_system.sh installs it"
        self._process = subprocess.Popen(
            [found, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
             "--remote-debugging-port=0", f"--user-data-dir={folder}", "--disable-dev-shm-usage",
             f"--window-size={size[0]},{size[1]}", "about:blank"],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )  # fmt: skip
        self.pid = self._process.pid
        port_file = folder / "DevToolsActivePort"
        self._until(
            lambda: port_file.exists() and len(port_file.read_text().splitlines()) == 2, "chromium"
        )
        port, path = port_file.read_text().splitlines()
        # 'make test-all' installs it.
        from websockets.sync.client import connect

        self._connected = ExitStack()
        self._socket = self._connected.enter_context(
            connect(f"ws://127.0.0.1:{port}{path}", max_size=None)
        )
        self._numbers = itertools.count(1)
        self._session: str | None = None
        (target,) = [t for t in self._do("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        attached = self._do("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]

    def open(self, address: str) -> None:
        self._do("Page.navigate", url=address)

    def look(self, script: str) -> Any:
        """The value of an expression in the page."""
        done = self._do(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in done, done["exceptionDetails"]
        return done["result"].get("value")

    def wait(self, script: str, seconds: float = 20.0) -> Any:
        return self._until(lambda: self.look(script), script, seconds)

    def text(self, name: str) -> str:
        """The text of an element by its test id."""
        return str(self.look(f"{_element(name)}?.innerText ?? ''"))

    def click(self, selector: str) -> None:
        x, y = self._middle(selector)
        self._mouse("mousePressed", x, y)
        self._mouse("mouseReleased", x, y)

    def click_until(self, selector: str, script: str, then: str = "") -> None:
        """Click, and look at `then`, again and again until a script is true.

        What opens, moves or is drawn anew may not take a click.
        """
        for _ in range(9):
            if self.look(f"document.querySelector(`{selector}`) !== null"):
                self.click(selector)
            end = time.monotonic() + 2
            while time.monotonic() < end:
                if then:
                    self.look(then)
                if self.look(script):
                    return
                time.sleep(0.06)
        page = self.look("document.body.innerText")
        raise AssertionError(f"never came true: {script}; the page says {page}")

    def drag(self, selector: str, parts: list[float], down: float = 0.5, hold: str = "") -> None:
        """Press at the first part of an element's width, go through the others, let go.

        Before letting go, wait until the script `hold` is true.
        """
        box = self._box(selector)
        ys = box["y"] + down * box["height"]
        xs = [box["x"] + part * box["width"] for part in parts]
        self._mouse("mousePressed", xs[0], ys)
        for x in xs[1:]:
            self._mouse("mouseMoved", x, ys)
        if hold:
            self.wait(hold)
        self._mouse("mouseReleased", xs[-1], ys)

    def hover(self, selector: str, across: float, down: float) -> None:
        box = self._box(selector)
        x, y = box["x"] + across * box["width"], box["y"] + down * box["height"]
        self._do("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def type(self, selector: str, text: str) -> None:
        """Replace an input's text, and leave it; a dialog that opens may take the focus away."""
        self._box(selector)
        element = f"document.querySelector(`{selector}`)"
        for _ in range(20):
            self.look(f"(e => {{ e.focus(); e.select() }})({element})")
            self.insert(text)
            if self.look(f"{element}.value") == text:
                break
            time.sleep(0.06)
        self.look(f"{element}.blur()")

    def insert(self, text: str) -> None:
        """Type where the keys go to, and stay there."""
        self._do("Input.insertText", text=text)

    def picture(self, file: Path) -> None:
        shot = self._do("Page.captureScreenshot", format="png")
        file.write_bytes(base64.b64decode(shot["data"]))

    def close(self) -> None:
        self._connected.close()
        self._process.terminate()
        self._process.wait(timeout=20)

    def _middle(self, selector: str) -> tuple[float, float]:
        box = self._box(selector)
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def _box(self, selector: str) -> dict[str, float]:
        script = (
            "(e => { if (!e) return null;"
            " e.scrollIntoView({block: 'center', inline: 'center'});"
            f" return e.getBoundingClientRect().toJSON() }})(document.querySelector(`{selector}`))"
        )
        box: dict[str, float] = self.wait(script)
        while True:  # a moving element cannot be hit
            time.sleep(0.06)
            before, box = box, self.wait(script)
            if before == box:
                return box

    def _mouse(self, kind: str, x: float, y: float) -> None:
        self._do(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1
        )

    def _do(self, method: str, **words: Any) -> Any:
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": words}
        if self._session is not None:
            message["sessionId"] = self._session
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=30))
            if answer.get("id") == number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]

    def _until(self, true: Any, what: str, seconds: float = 20.0) -> Any:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = true()
            if found:
                return found
            time.sleep(0.03)
        raise AssertionError(f"never came true: {what}")


def _element(name: str) -> str:
    return f"document.querySelector('[data-testid={name}]')"
