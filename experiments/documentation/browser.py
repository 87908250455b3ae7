"""A Chromium without a window, driven as its driver is told over HTTP: for pictures of pages, and for their tests.

Needs Debian's `chromium` and `chromium-driver`, and no package of Python.

Source: W3C WebDriver.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any
from urllib.error import HTTPError

MISSING = "a browser is missing; Debian: apt-get install chromium chromium-driver"
PATIENCE = 300.0  # [s] for whatever is waited for, on a machine that does other things too
BETWEEN = 0.05  # [s] between looks
KEYS = {"ArrowLeft": "\ue012", "ArrowUp": "\ue013", "ArrowRight": "\ue014", "ArrowDown": "\ue015", "Home": "\ue011"}
KEYS |= {"Enter": "\ue007", "Escape": "\ue00c", "Delete": "\ue017"}
NO_PROXY = urllib.request.build_opener(urllib.request.ProxyHandler({}))


class Browser:
    """One window, of `width` by `height` pixels.

    Raises:
        FileNotFoundError: Chromium or its driver is not installed.
    """

    def __init__(self, width: int = 1280, height: int = 800) -> None:
        chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
        if chromium is None or driver is None:
            raise FileNotFoundError(MISSING)
        self._folder = tempfile.TemporaryDirectory(prefix="browser.")
        said = Path(self._folder.name) / "said"
        with said.open("w") as log:
            command = [driver, "--port=0", "--allowed-origins=http://127.0.0.1"]
            self._driver = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
        try:
            self._address = f"http://127.0.0.1:{_port(said)}/session"
            wanted = {"alwaysMatch": _capabilities(chromium, self._folder.name, (width, height))}
            self._address += "/" + self._tell("", {"capabilities": wanted})["sessionId"]
            inner = "return [outerWidth - innerWidth, outerHeight - innerHeight]"
            more_width, more_height = self.run(inner)
            self._tell("window/rect", {"width": width + more_width, "height": height + more_height})
        except BaseException:
            self._end()
            raise

    def open(self, address: str) -> None:
        """Loads a page."""
        self._tell("url", {"url": address})

    def run(self, script: str, *arguments: object) -> Any:
        """What a script of the page returns."""
        return self._tell("execute/sync", {"script": script, "args": list(arguments)})

    def until(self, condition: str, *arguments: object) -> Any:
        """What an expression is in the page once it is true.

        Raises:
            TimeoutError: it never was.
        """
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if found := self.run(f"return {condition}", *arguments):
                return found
            time.sleep(BETWEEN)
        raise TimeoutError(f"not within {PATIENCE:g} s: {condition}; the page said {self.said()}")

    def press(self, *keys: str) -> None:
        """Presses keys one after the other, by their names in the browser."""
        actions = [{"type": kind, "value": KEYS.get(key, key)} for key in keys for kind in ("keyDown", "keyUp")]
        self._tell("actions", {"actions": [{"type": "key", "id": "keyboard", "actions": actions}]})

    def drag(self, *places: Sequence[float]) -> None:
        """Presses the pointer at the first place of the window, moves it over the others, and lets it go."""
        moves = [
            {"type": "pointerMove", "duration": 50, "x": round(x), "y": round(y), "origin": "viewport"}
            for x, y in places
        ]
        actions = [moves[0], {"type": "pointerDown", "button": 0}, *moves[1:], {"type": "pointerUp", "button": 0}]
        pointer = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": actions}
        self._tell("actions", {"actions": [pointer]})

    def click(self, selector: str) -> None:
        """Clicks the first element of a CSS selector in its middle."""
        script = (
            "const box = document.querySelector(arguments[0]).getBoundingClientRect();"
            "return [box.x + box.width / 2, box.y + box.height / 2]"
        )
        self.drag(self.run(script, selector))

    def darken(self) -> None:
        """Has the page believe that its reader prefers dark colours."""
        dark = [{"name": "prefers-color-scheme", "value": "dark"}]
        self._tell("goog/cdp/execute", {"cmd": "Emulation.setEmulatedMedia", "params": {"features": dark}})

    def picture(self, path: Path) -> None:
        """Writes what the window shows, as PNG."""
        path.write_bytes(base64.b64decode(self._tell("screenshot")))

    def said(self) -> list[str]:
        """What the console was told since the last time: errors and warnings of the page and the browser."""
        return [entry["message"] for entry in self._tell("se/log", {"type": "browser"})]

    def _tell(self, what: str, body: Mapping[str, object] | None = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{self._address}/{what}".rstrip("/"), data)
        request.add_header("Content-Type", "application/json")
        try:
            with NO_PROXY.open(request, timeout=PATIENCE) as answer:
                return json.load(answer)["value"]
        except HTTPError as error:
            raise RuntimeError(f"{what}: {json.load(error)['value']['message']}") from None

    def _end(self) -> None:
        self._driver.terminate()
        self._driver.wait()
        self._folder.cleanup()

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        request = urllib.request.Request(self._address, method="DELETE")
        try:
            NO_PROXY.open(request, timeout=PATIENCE).close()
        finally:
            self._end()


def _port(said: Path) -> int:
    """On which port the driver says that it listens."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        _, found, rest = said.read_text().partition("started successfully on port ")
        if found and "." in rest:
            return int(rest.partition(".")[0])
        time.sleep(BETWEEN)
    raise TimeoutError(f"the browser's driver does not start: {said.read_text()}")


def _capabilities(chromium: str, folder: str, size: tuple[int, int]) -> dict[str, object]:
    width, height = size
    arguments = [
        "--headless=new",
        "--disable-gpu",
        "--hide-scrollbars",
        f"--window-size={width},{height}",
        f"--user-data-dir={folder}/profile",
        "--force-device-scale-factor=1",
    ]
    arguments += ["--no-sandbox"] if os.geteuid() == 0 else []  # root has none
    return {
        "browserName": "chrome",
        "goog:chromeOptions": {
            "binary": chromium,
            "args": arguments,
            "browserStartupTimeout": round(1000 * PATIENCE),
        },
        "goog:loggingPrefs": {"browser": "ALL"},
    }
