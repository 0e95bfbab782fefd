"""`croissant.json`: the tree as Croissant 1.1 metadata (https://docs.mlcommons.org/croissant/)."""

from collections.abc import Mapping, Sequence
from typing import Any

from card.artifacts import load_schema
from card.packaging.rai import VERSION, rai_fields
from card.packaging.reader import SPLITS

CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "recordSet": "cr:recordSet",
    "source": "cr:source",
}
DATA_TYPES = {
    "bool": "sc:Boolean",
    "binary": "sc:Text",
    "float64": "sc:Float",
    "int32": "sc:Integer",
    "int64": "sc:Integer",
    "string": "sc:Text",
}
TABLES = {
    **{f"metadata/frames-{split}.parquet": "release_frames" for split in SPLITS},
    "metadata/sequences.parquet": "release_sequences",
    "metadata/members.parquet": "release_members",
    "metadata/files.parquet": "release_files",
    "metadata/retractions.parquet": "retractions",
}


def croissant(
    release: Mapping[str, Any],
    terms: Mapping[str, Any],
    about: Mapping[str, Any],
    sha256: Mapping[str, str],
    sequences: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """Croissant document of a tree with files `sha256` (path -> hash) and rows `sequences` of their table."""
    files = [path for path in sorted(sha256) if path in TABLES or path.endswith(".tar")]
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": ["http://mlcommons.org/croissant/1.1", VERSION],
        "name": release["repository"],
        "description": f"{about['title']}: driving sequences with quasi-dense 3D ground truth of the road. "
        f"{terms['attribution']}.",
        "license": terms["url"],
        "url": about["url"],
        "version": release["version"],
        "datePublished": release["date"],
        "creator": {"@type": "sc:Organization", "name": about["creator"]},
        "citeAs": f"{about['creator']}: {about['title']}, {release['repository']} {release['version']}.",
        "distribution": [_file(path, sha256[path]) for path in files],
        "recordSet": [record_set(path, schema) for path, schema in TABLES.items()],
        **rai_fields(release, sequences, about["contact"]),
    }


def _file(path: str, sha256: str) -> dict[str, Any]:
    table = path.endswith(".parquet")
    return {
        "@type": "cr:FileObject",
        "@id": path,
        "name": path,
        "contentUrl": path,
        "encodingFormat": "application/x-parquet" if table else "application/x-tar",
        "sha256": sha256,
    }


def record_set(path: str, schema: str) -> dict[str, Any]:
    """One table of the tree with its columns."""
    name = path.split("/")[1].removesuffix(".parquet")
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": load_schema(schema)["description"],
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"{name}/{column}",
                "name": column,
                "description": field["description"],
                "dataType": DATA_TYPES[field["type"]],
                "source": {"fileObject": {"@id": path}, "extract": {"column": column}},
            }
            for column, field in load_schema(schema)["columns"].items()
        ],
    }
