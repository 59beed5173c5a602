# SPDX-License-Identifier: Apache-2.0
"""Pages in a headless Chromium, by its DevTools protocol over a pipe."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from fledge.programs import without_preload

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any

PROGRAM = shutil.which("chromium")
SWITCHES = ["--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
            "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
            "--disable-sync", "--disable-extensions", "--hide-scrollbars", "--remote-debugging-pipe"]


class Browser:
    """A browser with one page. problems: warnings and errors on the page's console, and exceptions.

        with Browser(1280, 720) as browser:
            browser.open("view.html", "#t=60")
            browser.evaluate("document.title")
    """

    def __init__(self, width: int = 1280, height: int = 720, dark: bool = True, wait: float = 60.0) -> None:
        self.problems: list[str] = []
        self._wait, self._number, self._rest = wait, 0, b""
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._from, output = os.pipe()
        input_, self._to = os.pipe()
        # The browser reads its descriptor 3 and writes 4, so the ends of the pipes get higher numbers first.
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (input_, output)]
        self._process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{ends[0]} 4>&{ends[1]}', "bash", str(PROGRAM), *SWITCHES,
             f"--user-data-dir={self._folder.name}", f"--window-size={width},{height}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, pass_fds=ends,
            env=without_preload(os.environ))
        for end in (input_, output, *ends):
            os.close(end)
        self._session = None
        pages = [targetInfo for targetInfo in self._call("Target.getTargets")["targetInfos"]
                 if targetInfo["type"] == "page"]
        self._session = self._call("Target.attachToTarget", targetId=pages[0]["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self._call("Emulation.setEmulatedMedia",
                   features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._to)
        os.close(self._from)
        self._folder.cleanup()

    @property
    def pid(self) -> int:
        """The id of its first process, the parent of the others."""
        return self._process.pid

    def open(self, page: str | Path, anchor: str = "") -> None:
        """Open a file, and wait until the viewer in it has drawn its first picture."""
        self._call("Page.navigate", url="about:blank")
        self._call("Page.navigate", url=Path(page).resolve().as_uri() + anchor)
        self.wait_for("document.querySelector('.fledge-view')?.dataset.opened || document.querySelector('.failure')")

    def go(self, address: str) -> None:
        """Go to an address."""
        self._call("Page.navigate", url=address)

    def wait_for(self, expression: str) -> object:
        """Wait until an expression is true; returns it."""
        end = time.monotonic() + self._wait
        while not (value := self.evaluate(expression)):
            if time.monotonic() > end:
                raise TimeoutError(f"{expression} is still {value!r}; {self.problems}")
            time.sleep(0.02)
        return value

    def evaluate(self, expression: str) -> object:
        """The value of an expression on the page, also of a promise."""
        reply = self._call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in reply:
            raise RuntimeError(reply["exceptionDetails"]["exception"].get("description", expression))
        return reply["result"].get("value")

    def picture(self) -> bytes:
        """The picture of the page, as PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        request = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            request["sessionId"] = self._session
        os.write(self._to, json.dumps(request).encode() + b"\0")
        end = time.monotonic() + self._wait
        while True:
            reply = self._read(end)
            if reply.get("id") == self._number:
                if "error" in reply:
                    raise RuntimeError(f"{method}: {reply['error']['message']}")
                return reply["result"]

    def _read(self, end: float) -> dict[str, Any]:
        while b"\0" not in self._rest:
            if not select.select([self._from], [], [], max(0, end - time.monotonic()))[0]:
                raise TimeoutError("the browser does not answer")
            more = os.read(self._from, 1 << 20)
            if not more:
                raise RuntimeError("the browser has ended")
            self._rest += more
        text, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(text)
        self._collect_problem(message.get("method"), message.get("params", {}))
        return message

    def _collect_problem(self, event: str | None, parameters: dict[str, Any]) -> None:
        if event == "Runtime.exceptionThrown":
            self.problems.append(parameters["exceptionDetails"]["exception"].get("description", "an exception"))
        if event == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
            self.problems.append(" ".join(str(argument.get("value", argument.get("description")))
                                          for argument in parameters["args"]))
        if event == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.problems.append(parameters["entry"]["text"])
