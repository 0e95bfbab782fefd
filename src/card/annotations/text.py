"""Text files as label tools on several systems write them."""

from pathlib import Path

from card.annotations.issues import Issue

BOM = b"\xef\xbb\xbf"


def read_lines(path: Path, file: str, issues: list[Issue]) -> list[str]:
    """Lines of a UTF-8 file without their ends; a BOM and CRLF are repaired, other encodings an error."""
    content = path.read_bytes()
    if content.startswith(BOM):
        issues.append(Issue(file, 1, "bom", "byte order mark"))
        content = content.removeprefix(BOM)
    if ends := content.count(b"\r\n"):
        line = content[: content.index(b"\r\n")].count(b"\n") + 1
        issues.append(Issue(file, line, "crlf", f"{ends} lines end in CR LF"))
        content = content.replace(b"\r\n", b"\n")
    try:
        lines = content.decode("utf-8").split("\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        issues.append(Issue(file, line, "not_text", f"found byte {content[error.start]:02x}, wanted UTF-8"))
        return []
    return lines[:-1] if lines[-1] == "" else lines
