"""A web server of a folder that serves ranges of bytes, counts requests and fails as told."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any


@dataclass
class Served:
    """Address of the server, the requests it had (path, range), and statuses to answer the next ones with."""

    address: str
    requests: list[tuple[str, str | None]] = field(default_factory=list)
    tokens: list[str | None] = field(default_factory=list)
    faults: list[int] = field(default_factory=list)
    prefix: str = "/"
    elsewhere: str | None = None
    ranges: bool = True


@contextmanager
def served(folder: Path) -> Iterator[Served]:
    """Serve `folder` for the time of the block; status 0 among the faults cuts the connection."""

    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *arguments: Any) -> None:
            pass

        def do_GET(self) -> None:
            state.requests.append((self.path, self.headers["Range"]))
            state.tokens.append(self.headers["Authorization"])
            fault = state.faults.pop(0) if state.faults else None
            if fault == 0:
                self.connection.close()
                return
            if fault:
                self.send_error(fault)
                return
            if state.elsewhere:
                self.send_response(302)
                self.send_header("Location", state.elsewhere + self.path)
                self.end_headers()
                return
            path = folder / self.path.removeprefix(state.prefix)
            if not path.is_file():
                self.send_error(404)
                return
            content = path.read_bytes()
            match = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers["Range"] or "")
            if match and state.ranges:
                content = content[int(match[1]) : int(match[2]) + 1]
                self.send_response(206)
            else:
                self.send_response(200)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    state = Served(f"http://127.0.0.1:{server.server_port}")
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
