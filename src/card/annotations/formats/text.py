"""Text files as label tools on several systems write them."""

from pathlib import Path

from card.annotations.issues import Issue

BOM = b"\xef\xbb\xbf"


def read_text(path: Path, file: str, issues: list[Issue]) -> str | None:
    """A UTF-8 file, a byte order mark taken off as a repair; None, with an error, in other encodings."""
    content = path.read_bytes()
    if content.startswith(BOM):
        issues.append(Issue(file, 1, "bom", "byte order mark"))
        content = content.removeprefix(BOM)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        issues.append(Issue(file, line, "not_text", f"found byte {content[error.start]:02x}, wanted UTF-8"))
        return None


def read_lines(path: Path, file: str, issues: list[Issue]) -> list[str]:
    """Lines of a UTF-8 file without their ends; a BOM and CRLF are repaired, other encodings an error."""
    text = read_text(path, file, issues)
    if text is None:
        return []
    if ends := text.count("\r\n"):
        line = text[: text.index("\r\n")].count("\n") + 1
        issues.append(Issue(file, line, "crlf", f"{ends} lines end in CR LF"))
        text = text.replace("\r\n", "\n")
    lines = text.split("\n")
    return lines[:-1] if lines[-1] == "" else lines
