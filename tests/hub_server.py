"""A local server that speaks the Hub's HTTP API as far as an upload uses it, and fails as told."""

import base64
import hashlib
import json
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

PAGE = 7
"""Entries a page of a repository's listing, few so that there are several."""


@dataclass
class Repository:
    private: bool
    gated: Any = False
    files: dict[str, tuple[bytes, bool]] = field(default_factory=dict)  # path -> content, whether large
    commits: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    tags: dict[str, dict[str, tuple[bytes, bool]]] = field(default_factory=dict)


@dataclass
class Hub:
    """State of the server.

    `faults` are (pattern of `METHOD path`, what): a status to answer instead, `cut` to close the connection,
    `lose` to do as asked and then close it, `sleep` to answer too late.
    """

    address: str = ""
    repositories: dict[str, Repository] = field(default_factory=dict)
    objects: dict[str, bytes] = field(default_factory=dict)
    requests: list[str] = field(default_factory=list)
    faults: list[tuple[str, Any]] = field(default_factory=list)
    sleep_s: float = 1.0

    def put(self) -> list[str]:
        return [line for line in self.requests if line.startswith("PUT /objects/")]


@contextmanager
def hub() -> Iterator[Hub]:
    """Run the server for the time of the block."""
    state = Hub()

    class Handler(_Handler):
        hub = state

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    state.address = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


class _Handler(BaseHTTPRequestHandler):
    hub: Hub

    def log_message(self, *arguments: Any) -> None:
        pass

    def do_GET(self) -> None:
        self._serve("GET")

    def do_POST(self) -> None:
        self._serve("POST")

    def do_PUT(self) -> None:
        self._serve("PUT")

    def _serve(self, method: str) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"] or 0))
        path = unquote(urlsplit(self.path).path)
        line = f"{method} {path}"
        self.hub.requests.append(line)
        fault = next((item for item in self.hub.faults if re.search(item[0], line)), None)
        if fault:
            self.hub.faults.remove(fault)
            if isinstance(fault[1], int):
                return self._answer({"error": "as told"}, fault[1])
            if fault[1] == "cut":
                return self._cut()
            if fault[1] == "sleep":
                time.sleep(self.hub.sleep_s)
        status, answer, headers = self._route(method, path, body)
        if fault and fault[1] == "lose":
            return self._cut()
        self._answer(answer, status, headers)

    def _cut(self) -> None:
        self.close_connection = True
        self.connection.shutdown(2)

    def _answer(self, answer: Any, status: int = 200, headers: dict[str, str] | None = None) -> None:
        content = b"" if answer is None else json.dumps(answer).encode()
        try:
            self.send_response(status)
            for name, value in (headers or {}).items():
                self.send_header(name, value)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)
        except OSError:  # the client has given up
            self.close_connection = True

    def _route(self, method: str, path: str, body: bytes) -> tuple[int, Any, dict[str, str]]:
        routes = (
            ("POST", r"/api/repos/create", self._create),
            ("POST", r"/api/validate-yaml", lambda body: {"errors": [], "warnings": []}),
            ("PUT", r"/objects/(\w+)", self._store),
            ("PUT", r"/api/datasets/(\w+/[\w.-]+)/settings", self._settings),
            ("GET", r"/api/datasets/(\w+/[\w.-]+)/refs", self._refs),
            ("GET", r"/api/datasets/(\w+/[\w.-]+)/tree/([\w.-]+)", self._tree),
            ("POST", r"/api/datasets/(\w+/[\w.-]+)/preupload/main", self._preupload),
            ("POST", r"/datasets/(\w+/[\w.-]+)\.git/info/lfs/objects/batch", self._batch),
            ("POST", r"/api/datasets/(\w+/[\w.-]+)/commit/main", self._commit),
            ("POST", r"/api/datasets/(\w+/[\w.-]+)/tag/main", self._tag),
        )
        for wanted, pattern, action in routes:
            match = re.fullmatch(pattern, path)
            if match and method == wanted:
                if "datasets/" in pattern and match[1] not in self.hub.repositories:
                    return 404, {"error": "Repository not found"}, {"X-Error-Code": "RepoNotFound"}
                answer = action(*match.groups(), body)  # type: ignore[operator]
                return answer if isinstance(answer, tuple) else (200, answer, {})
        return 404, {"error": f"no such endpoint {method} {path}"}, {}

    def _create(self, body: bytes) -> Any:
        asked = json.loads(body)
        name = f"{asked['organization']}/{asked['name']}"
        if name in self.hub.repositories:
            return 409, {"error": "exists", "url": f"{self.hub.address}/datasets/{name}"}, {}
        private = asked.get("visibility") == "private" or asked.get("private", False)
        self.hub.repositories[name] = Repository(private)
        self.hub.repositories[name].files[".gitattributes"] = b"*.tar filter=lfs\n", False
        return {"url": f"{self.hub.address}/datasets/{name}"}

    def _settings(self, name: str, body: bytes) -> Any:
        asked = json.loads(body)
        self.hub.repositories[name].gated = asked.get("gated")
        return {}

    def _refs(self, name: str, body: bytes) -> Any:
        tags = self.hub.repositories[name].tags
        return {
            "branches": [{"name": "main", "ref": "refs/heads/main", "targetCommit": "0" * 40}],
            "converts": [],
            "tags": [{"name": tag, "ref": f"refs/tags/{tag}", "targetCommit": "0" * 40} for tag in tags],
        }

    def _tree(self, name: str, revision: str, body: bytes) -> Any:
        repository = self.hub.repositories[name]
        files = repository.files if revision == "main" else repository.tags[revision]
        first = int(parse_qs(urlsplit(self.path).query).get("cursor", ["0"])[0])
        entries = [_entry(path, *files[path]) for path in sorted(files)]
        headers = {}
        if first + PAGE < len(entries):
            following = (
                f"{self.hub.address}/api/datasets/{name}/tree/{revision}?recursive=True&cursor={first + PAGE}"
            )
            headers["Link"] = f'<{following}>; rel="next"'
        return 200, entries[first : first + PAGE], headers

    def _preupload(self, name: str, body: bytes) -> Any:
        files = self.hub.repositories[name].files
        there = {path: _entry(path, *content)["oid"] for path, content in files.items()}
        return {
            "files": [
                {
                    "path": file["path"],
                    "uploadMode": "lfs" if file["path"].endswith((".tar", ".parquet")) else "regular",
                    "shouldIgnore": False,
                    "oid": there.get(file["path"]),
                }
                for file in json.loads(body)["files"]
            ]
        }

    def _batch(self, name: str, body: bytes) -> Any:
        objects = []
        for item in json.loads(body)["objects"]:
            actions = {"upload": {"href": f"{self.hub.address}/objects/{item['oid']}"}}
            objects.append(item if item["oid"] in self.hub.objects else {**item, "actions": actions})
        return {"transfer": "basic", "objects": objects}

    def _store(self, oid: str, body: bytes) -> Any:
        if hashlib.sha256(body).hexdigest() != oid:
            return 400, {"error": "content has another hash"}, {}
        self.hub.objects[oid] = body
        return None

    def _commit(self, name: str, body: bytes) -> Any:
        repository = self.hub.repositories[name]
        for line in map(json.loads, body.splitlines()):
            value = line["value"]
            if line["key"] == "header":
                repository.messages.append(value["summary"])
            elif line["key"] == "file":
                repository.files[value["path"]] = base64.b64decode(value["content"]), False
            elif line["key"] == "lfsFile":
                repository.files[value["path"]] = self.hub.objects[value["oid"]], True
            elif line["key"] == "deletedFile":
                del repository.files[value["path"]]
        oid = hashlib.sha1(body).hexdigest()
        repository.commits.append(oid)
        return {"commitUrl": f"{self.hub.address}/datasets/{name}/commit/{oid}", "commitOid": oid}

    def _tag(self, name: str, body: bytes) -> Any:
        repository = self.hub.repositories[name]
        tag = json.loads(body)["tag"]
        if tag in repository.tags:
            return 409, {"error": "tag exists"}, {}
        repository.tags[tag] = dict(repository.files)
        return {}


def _entry(path: str, content: bytes, large: bool) -> dict[str, Any]:
    blob = hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest()
    entry = {"type": "file", "path": path, "size": len(content), "oid": blob}
    if large:
        sha256 = hashlib.sha256(content).hexdigest()
        entry |= {"oid": sha256[:40], "lfs": {"oid": sha256, "size": len(content), "pointerSize": 134}}
    return entry
