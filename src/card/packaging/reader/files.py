"""Where the files of a release are: in a folder, or on a web server that serves ranges of bytes."""

import os
import re
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request
from http.client import HTTPException
from pathlib import Path
from typing import Any, Protocol

from card.errors import CardError

HUB = "https://huggingface.co"
REPOSITORY = re.compile(r"hf://datasets/(?P<id>[^/@]+/[^/@]+)(?:@(?P<revision>.+))?")
TRIES, TIMEOUT_S, PAUSE_S = 4, 60.0, 0.5


class Files(Protocol):
    """Files of a tree by their path in it."""

    root: Path
    """Folder of what is on this machine: the tree itself, or what was fetched of it so far."""

    def local(self, path: str) -> Path:
        """A whole file on this machine, fetched if need be; a path without a file where there is none."""

    def part(self, path: str, offset: int, size: int) -> bytes:
        """`size` bytes of a file from `offset`, in one request; fewer at its end."""


def open_files(address: str | Path) -> Files:
    """Files of a folder, of a web address, or of ``hf://datasets/<owner>/<name>[@<revision>]``.

    The Hub's address is that of the variable HF_ENDPOINT, the token for private and gated repositories
    that of HF_TOKEN.
    """
    text = str(address)
    if match := REPOSITORY.fullmatch(text):
        endpoint = os.environ.get("HF_ENDPOINT", HUB).rstrip("/")
        revision = urllib.parse.quote(match["revision"] or "main", safe="")
        return WebFiles(f"{endpoint}/datasets/{match['id']}/resolve/{revision}", os.environ.get("HF_TOKEN"))
    if text.startswith(("http://", "https://")):
        return WebFiles(text)
    if text.startswith("hf://"):
        raise CardError("not a dataset on the Hub", found=text, wanted="hf://datasets/<owner>/<name>")
    return FolderFiles(Path(address))


class FolderFiles:
    """A downloaded tree."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def local(self, path: str) -> Path:
        """Path of the file in the folder."""
        return self.root / path

    def part(self, path: str, offset: int, size: int) -> bytes:
        """Bytes of the file; CardError if it is not there."""
        try:
            with (self.root / path).open("rb") as file:
                file.seek(offset)
                return file.read(size)
        except FileNotFoundError:
            raise CardError("file is missing", where=self.root / path) from None


class WebFiles:
    """A tree behind a web address. Whole files are fetched once, into a folder that goes with this object."""

    def __init__(self, address: str, token: str | None = None) -> None:
        self._address, self._token = address.rstrip("/"), token
        self._folder = tempfile.TemporaryDirectory(prefix="card-")
        self._opener = urllib.request.build_opener(_Redirects)
        self.root = Path(self._folder.name)

    def local(self, path: str) -> Path:
        """The file, fetched whole the first time."""
        target = self.root / path
        if not target.exists():
            content = self._get(path, {})
            if content is not None:
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
        return target

    def part(self, path: str, offset: int, size: int) -> bytes:
        """Bytes of the file by one range request; CardError if it is not there."""
        if size == 0:
            return b""
        content = self._get(path, {"Range": f"bytes={offset}-{offset + size - 1}"})
        if content is None:
            raise CardError("file is missing", where=f"{self._address}/{path}")
        return content

    def _get(self, path: str, headers: dict[str, str]) -> bytes | None:
        """Body of a file or range; None for a file that is not there. Tries again what may pass."""
        address = f"{self._address}/{urllib.parse.quote(path)}"
        failure: Exception | None = None
        for attempt in range(TRIES):
            if attempt:
                time.sleep(PAUSE_S * 2 ** (attempt - 1))
            request = urllib.request.Request(address, headers=headers)
            if self._token:
                request.add_unredirected_header("Authorization", f"Bearer {self._token}")
            try:
                with self._opener.open(request, timeout=TIMEOUT_S) as response:
                    if "Range" in headers and response.status != 206:
                        raise CardError("the server does not serve ranges of bytes", where=address)
                    content: bytes = response.read()
                    return content
            except urllib.error.HTTPError as error:
                if error.code == 404:
                    return None
                if error.code < 500 and error.code not in (408, 429):
                    raise CardError(
                        "the server refuses", where=address, found=f"{error.code} {error.reason}"
                    ) from None
                failure = error
            except (OSError, HTTPException) as error:
                failure = error
        raise CardError("cannot read from the server", where=address, found=failure) from failure


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Redirects that keep the token on the same host and never take it to another."""

    def redirect_request(self, request: Any, *details: Any) -> Any:
        following = super().redirect_request(request, *details)
        token = request.unredirected_hdrs.get("Authorization")
        if following is not None and token and following.host == request.host:
            following.add_unredirected_header("Authorization", token)
        return following
