"""A page in headless Chromium, driven over its debugging pipe: no port, no package."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--remote-debugging-pipe",
)  # fmt: skip
DRAWN = "document.querySelectorAll('figure.plot[data-drawn]').length"


def find_chromium() -> str | None:
    """Path of a Chromium, None if there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Page:
    """One page. `errors` : console errors and exceptions;  `requests` : addresses asked for besides the page's own"""

    def __init__(self, chromium: str, width: int = 1400, height: int = 1000, scheme: str = "light") -> None:
        self.errors: list[str] = []
        self.requests: list[str] = []
        self._profile = tempfile.mkdtemp(prefix="vgyro-chromium-")
        to_child, from_us = os.pipe()
        to_us, from_child = os.pipe()
        # Chromium reads commands on descriptor 3 and answers on 4.
        script = (
            f"import os, sys; os.dup2({to_child}, 3); os.dup2({from_child}, 4); os.execv(sys.argv[1], sys.argv[1:])"
        )
        window = f"--window-size={width},{height}"
        command = [sys.executable, "-c", script, chromium, *FLAGS, f"--user-data-dir={self._profile}", window]
        self._process = subprocess.Popen(
            command, pass_fds=(to_child, from_child), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
        os.close(to_child)
        os.close(from_child)
        self._write, self._read, self._buffer, self._number = from_us, to_us, b"", 0
        target = self.call("Target.createTarget", {"url": "about:blank"}, session=None)["targetId"]
        attached = self.call("Target.attachToTarget", {"targetId": target, "flatten": True}, session=None)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", metrics)
        self.set_scheme(scheme)

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(20)
        os.close(self._write)
        os.close(self._read)
        shutil.rmtree(self._profile, ignore_errors=True)

    def set_scheme(self, scheme: str) -> None:
        """What prefers-color-scheme says: light or dark."""
        self.call("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})

    def open(self, path: Path, fragment: str = "") -> None:
        """Load a file and wait for its load event."""
        self.call("Page.navigate", {"url": path.resolve().as_uri() + fragment})
        self.wait_for("document.readyState === 'complete' && location.protocol === 'file:'")

    def run(self, expression: str) -> Any:
        """Value of a JavaScript expression."""
        answer = self.call("Runtime.evaluate", {"expression": expression, "returnByValue": True, "awaitPromise": True})
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, condition: str, seconds: float = 60.0) -> None:
        """Wait until a JavaScript condition holds.  raises : TimeoutError"""
        limit = time.monotonic() + seconds
        while not self.run(condition):
            if time.monotonic() > limit:
                raise TimeoutError(f"{condition} did not come true in {seconds} s; errors: {self.errors}")
            time.sleep(0.1)

    def screenshot(self, path: Path, full: bool = False) -> None:
        """PNG of what is in sight, or of the whole page."""
        if full:
            size = self.call("Page.getLayoutMetrics")["cssContentSize"]
            metrics = {
                "width": int(size["width"]),
                "height": int(size["height"]),
                "deviceScaleFactor": 1,
                "mobile": False,
            }
            self.call("Emulation.setDeviceMetricsOverride", metrics)
            self.wait_for(
                f"{DRAWN} >= [...document.querySelectorAll('figure.plot')].filter(f => f.checkVisibility()).length"
            )
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", {"format": "png"})["data"]))

    def call(
        self, method: str, parameters: dict[str, Any] | None = None, session: str | None = "page"
    ) -> dict[str, Any]:
        """One command of the DevTools protocol and its answer; events that come meanwhile are noted."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters or {}}
        if session is not None:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return answer["result"]
            self._note(answer)

    def _next(self, seconds: float = 60.0) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], seconds)
            if not ready:
                raise TimeoutError(f"Chromium did not answer in {seconds} s")
            chunk = os.read(self._read, 1 << 20)
            if not chunk:
                raise ConnectionError("Chromium ended")
            self._buffer += chunk
        message, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(message)

    def _note(self, event: dict[str, Any]) -> None:
        method, parameters = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(parameters["exceptionDetails"])[:500])
        elif method == "Runtime.consoleAPICalled" and parameters["type"] in {"error", "warning"}:
            self.errors.append(json.dumps(parameters["args"])[:500])
        elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(parameters["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            address = parameters["request"]["url"]
            if parameters.get("type") != "Document" and not address.startswith(("data:", "blob:")):
                self.requests.append(address)
