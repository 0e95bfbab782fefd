"""A hash over a script and every module of this package that it can reach by import.

Workflow engines see the script that a rule names, not the library behind it. This hash, given to a rule as a
parameter, makes an edit of any module rerun just the rules that depend on it. Comments, docstrings and layout
do not count.
"""

import ast
import hashlib
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def code_hash(script: Path) -> str:
    """Hexadecimal SHA-256 over the syntax trees of a script and of all it imports from this package."""
    digest = hashlib.sha256()
    pending, seen = [script.resolve()], set()
    while pending:
        path = pending.pop()
        if path not in seen:
            seen.add(path)
            pending.extend(_imports(path))
    for path in sorted(seen):
        digest.update(path.name.encode() + b"\0" + _tree(path).encode() + b"\0")
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
