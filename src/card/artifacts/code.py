"""A hash over a script, every module of this package that it can reach by import, and the schemas they name.

Workflow engines see the script that a rule names, not the library behind it. This hash, given to a rule as a
parameter, makes an edit of any module rerun just the rules that depend on it. Comments, docstrings, layout
and the descriptions in schemas do not count.
"""

import ast
import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

from card.artifacts.schemas import schema_folder

PACKAGE = Path(__file__).resolve().parents[1]


def code_hash(script: Path) -> str:
    """Hexadecimal SHA-256 over a script, all it imports from this package and the schemas named there."""
    digest = hashlib.sha256()
    pending, seen = [script.resolve()], set()
    while pending:
        path = pending.pop()
        if path not in seen:
            seen.add(path)
            pending.extend(_imports(path))
    for path in sorted(seen):
        digest.update(path.name.encode() + b"\0" + _tree(path).encode() + b"\0")
    for name in sorted(frozenset().union(*map(_words, seen))):
        schema = schema_folder() / f"{name}.schema.json"
        if schema.is_file():
            rules = _without_words(json.loads(schema.read_text(encoding="utf-8")))
            # In its own order, which is that of a table's columns.
            digest.update(f"{name}\0{json.dumps(rules)}\0".encode())
    return digest.hexdigest()


@cache
def _parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


@cache
def _tree(path: Path) -> str:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [statement for statement in node.body if not _is_docstring(statement)]
    return ast.dump(tree)


@cache
def _words(path: Path) -> frozenset[str]:
    """String constants that could be the name of a schema."""
    constants = (node.value for node in ast.walk(_parse(path)) if isinstance(node, ast.Constant))
    return frozenset(value for value in constants if isinstance(value, str) and value.isidentifier())


def _without_words(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_without_words(item) for item in schema]
    if isinstance(schema, dict):
        # A field may be called like a keyword, but what describes is always a string.
        return {
            name: _without_words(value)
            for name, value in schema.items()
            if name not in ("description", "title") or not isinstance(value, str)
        }
    return schema


def _is_docstring(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


@cache
def _imports(path: Path) -> tuple[Path, ...]:
    files: list[Path] = []
    for node in ast.walk(_parse(path)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                files += _files(alias.name)
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(node, path)
            files += _files(base)
            for alias in node.names:
                files += _files(f"{base}.{alias.name}")
    return tuple(files)


def _absolute(node: ast.ImportFrom, path: Path) -> str:
    if node.level == 0:
        return node.module or ""
    package = path.parents[node.level - 1].relative_to(PACKAGE.parent).parts
    return ".".join([*package, *([node.module] if node.module else [])])


def _files(module: str) -> list[Path]:
    """The files that importing ``module`` runs: its packages' ``__init__`` and itself."""
    parts = module.split(".")
    if parts[0] != PACKAGE.name:
        return []
    files = []
    folder = PACKAGE.parent
    for part in parts:
        folder = folder / part
        candidates = (folder / "__init__.py", folder.with_suffix(".py"))
        files += [candidate for candidate in candidates if candidate.is_file()]
    return files
