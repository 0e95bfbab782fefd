"""What was sent: enough of a release to compare the next one with."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.artifacts import atomic_folder, write_json
from card.packaging.versions import RECORDED


def write_record(folder: Path, tree: Path, upload: Mapping[str, Any]) -> None:
    """Write `folder`: the tables of `tree` that tell what it holds, and the document `upload`."""
    with atomic_folder(folder) as partial:
        for path in RECORDED:
            (partial / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(tree / path, partial / path)
        write_json(partial / "upload.json", dict(upload), "upload")
