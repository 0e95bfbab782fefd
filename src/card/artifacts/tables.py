"""Parquet tables and npz arrays, checked for type, shape, range and order on both ways."""

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts.atomic import atomic_file
from card.artifacts.schemas import load_schema
from card.errors import CardError

# The zip format's epoch: a constant stamp keeps the bytes repeatable.
ZIP_EPOCH = (1980, 1, 1, 0, 0, 0)
# Points hardly deflate further at 6, the library's own level, which takes six times as long.
DEFLATE_LEVEL = 1


def write_table(path: Path, columns: Any, schema: str) -> None:
    """Write a Parquet table (zstd) whose columns, in the schema's order, fit ``schema``.

    Parameters
    ----------
    columns : mapping of name to array or list (``None`` is null), or a ``pyarrow.Table``.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = load_schema(schema)["columns"]
    names = columns.column_names if isinstance(columns, pa.Table) else list(columns)
    if set(names) != set(fields):
        raise CardError("wrong columns", where=path, found=sorted(names), wanted=sorted(fields))
    arrays = []
    for name, field in fields.items():
        try:
            arrays.append(_arrow(columns[name], field))
        except (pa.ArrowException, TypeError, ValueError, OverflowError) as error:
            raise CardError(f"column {name} does not fit schema {schema}", where=path, found=error) from error
    table = pa.table(arrays, names=list(fields))
    _check_table(table, schema, path)
    with atomic_file(path) as partial:
        pq.write_table(table, partial, compression="zstd", write_page_index=False)


def read_table(path: Path, schema: str) -> Any:
    """Read a Parquet table as ``pyarrow.Table`` and check it against ``schema``."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not path.is_file():
        raise CardError("file is missing", where=path)
    try:
        table = pq.read_table(path, partitioning=None)
    except (pa.ArrowException, OSError) as error:
        raise CardError("unreadable Parquet", where=path, found=error) from error
    _check_table(table, schema, path)
    return table


def write_arrays(path: Path, arrays: Mapping[str, Any], schema: str) -> None:
    """Write arrays as npz (deflate level 1, constant stamps) that fit ``schema``; ``np.load`` reads it."""
    _check_arrays(arrays, schema, path)
    with (
        atomic_file(path) as partial,
        zipfile.ZipFile(partial, "w") as archive,
    ):
        for name in load_schema(schema)["arrays"]:
            buffer = io.BytesIO()
            np.save(buffer, np.asarray(arrays[name], order="C"), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy", ZIP_EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, buffer.getvalue(), compresslevel=DEFLATE_LEVEL)


def read_arrays(path: Path, schema: str) -> dict[str, Any]:
    """Read an npz and check its arrays against ``schema``."""
    if not path.is_file():
        raise CardError("file is missing", where=path)
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise CardError("unreadable npz", where=path, found=error) from error
    _check_arrays(arrays, schema, path)
    return arrays


def _arrow(values: Any, field: Mapping[str, Any]) -> Any:
    import pyarrow as pa

    kind = {"bool": pa.bool_(), "string": pa.string(), "binary": pa.binary()}.get(field["type"])
    kind = kind if kind is not None else pa.type_for_alias(field["type"])
    if isinstance(values, pa.ChunkedArray):
        return values.combine_chunks().cast(kind)
    if isinstance(values, pa.Array):
        return values.cast(kind)
    if isinstance(values, np.ndarray) and values.dtype == object:
        values = values.tolist()
    return pa.array(values, type=kind)


def _check_table(table: Any, schema: str, path: Path) -> None:
    fields = load_schema(schema)["columns"]
    if table.column_names != list(fields):
        raise CardError("wrong columns", where=path, found=table.column_names, wanted=list(fields))
    for name, field in fields.items():
        column = table[name]
        if str(column.type) != str(_arrow([], field).type):
            raise CardError(
                f"wrong type of column {name}", where=path, found=column.type, wanted=field["type"]
            )
        if column.null_count and not field.get("nullable", False):
            raise CardError(f"nulls in column {name}", where=path, found=column.null_count, wanted=0)
        values = column.drop_null()
        if "enum" in field:
            strange = sorted(set(values.unique().to_pylist()) - set(field["enum"]))
            if strange:
                raise CardError(
                    f"unknown value in column {name}", where=path, found=strange[0], wanted=field["enum"]
                )
        if field["type"] not in ("string", "binary", "bool"):
            _check_numbers(values.to_numpy(), name, field, path)


def _check_arrays(arrays: Mapping[str, Any], schema: str, path: Path) -> None:
    fields = load_schema(schema)["arrays"]
    if set(arrays) != set(fields):
        raise CardError("wrong arrays", where=path, found=sorted(arrays), wanted=sorted(fields))
    sizes: dict[str, int] = {}
    for name, field in fields.items():
        array = np.asarray(arrays[name])
        if str(array.dtype) != field["dtype"]:
            raise CardError(
                f"wrong type of array {name}", where=path, found=array.dtype, wanted=field["dtype"]
            )
        fits = len(field["shape"]) == array.ndim and all(
            (sizes.setdefault(wanted, found) if isinstance(wanted, str) else wanted) == found
            for wanted, found in zip(field["shape"], array.shape, strict=True)
        )
        if not fits:
            raise CardError(
                f"wrong shape of array {name}", where=path, found=array.shape, wanted=field["shape"]
            )
        _check_numbers(array, name, field, path)


def _check_numbers(values: Any, name: str, field: Mapping[str, Any], path: Path) -> None:
    if values.size == 0:
        return
    if values.dtype.kind == "f" and not field.get("nonfinite", False) and not np.isfinite(values).all():
        raise CardError(f"{name} is not finite", where=path, found=f"row {_first(~np.isfinite(values))}")
    for bound, outside in (("minimum", np.less), ("maximum", np.greater)):
        if bound in field and (wrong := outside(values, field[bound])).any():
            found = f"{values[wrong][0]} in row {_first(wrong)}"
            raise CardError(f"{name} out of range", where=path, found=found, wanted=f"{bound} {field[bound]}")
    if field.get("order") == "increasing" and (wrong := values[1:] <= values[:-1]).any():
        raise CardError(f"{name} does not increase", where=path, found=f"row {_first(wrong) + 1}")


def _first(mask: Any) -> int:
    return int(np.argwhere(mask)[0][0])
