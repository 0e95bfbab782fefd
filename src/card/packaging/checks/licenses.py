"""One tree, one licence; and nothing in it that failed a gate or that privacy does not answer for."""

from collections.abc import Iterator

import yaml

from card.packaging.checks.contents import Contents
from card.packaging.modalities import CAMERAS


def check_licenses(contents: Contents) -> Iterator[str]:
    """The licence of every row, sidecar and page is the tree's; every gate passed or was signed for."""
    if contents.release is None:
        return
    spdx = contents.release["spdx"]
    rows = {"metadata/sequences.parquet": contents.sequences, "metadata/members.parquet": contents.members}
    rows["mini/mini.parquet"] = contents.mini
    rows |= {f"metadata/frames-{split}.parquet": frames for split, frames in contents.frames.items()}
    for path, table in rows.items():
        for row in table:
            if row["spdx"] != spdx:
                yield f"{path}: a row of {row['sequence']} is under {row['spdx']}, the tree under {spdx}"
    with_images = {row["sequence"] for row in contents.members if row["modality"] in CAMERAS}
    for sequence, sidecars in contents.sidecars.items():
        stated = sidecars.get("provenance.json", {"spdx": spdx})["spdx"]
        if stated != spdx:
            yield f"sequences/{sequence}/provenance.json: under {stated}, the tree under {spdx}"
        stages = sidecars.get("quality.json", {"stages": {}})["stages"]
        if "privacy" not in stages and sequence in with_images:
            yield f"sequences/{sequence}/quality.json: images without a report of the privacy stage"
        for stage, quality in stages.items():
            for gate in quality["gates"]:
                if gate["verdict"] == "fail":
                    yield f"sequences/{sequence}/quality.json: gate {gate['figure']} of {stage} failed"
    for page in ("LICENSE", "NOTICE"):
        file = contents.tree / page
        if file.is_file() and f"SPDX-License-Identifier: {spdx}\n" not in file.read_text(
            encoding="utf-8", errors="replace"
        ):
            yield f"{page}: does not name {spdx}"
    citation = contents.tree / "CITATION.cff"
    if citation.is_file():
        try:
            cited = yaml.safe_load(citation.read_text(encoding="utf-8"))
            wanted = {"license": spdx, "version": contents.release["version"]}
            if {name: cited.get(name) for name in wanted} != wanted:
                yield f"CITATION.cff: licence or version is not {spdx}, {wanted['version']}"
        except (yaml.YAMLError, UnicodeDecodeError, AttributeError) as error:
            yield f"CITATION.cff: not readable ({' '.join(str(error).split())})"
