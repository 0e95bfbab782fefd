"""Numbers as people read them."""

NONE = "–"


def number(value: float | None) -> str:
    """Four digits that count, thousands grouped; an en dash for none."""
    if value is None:
        return NONE
    if float(value).is_integer() or abs(value) >= 1000:
        return f"{value:,.0f}"
    return f"{value:.4g}" if abs(value) >= 1e-4 else f"{value:.1e}"


def size(count: int) -> str:
    """Bytes in decimal units, as disks and the Hub count them."""
    value = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if value < 1000:
            return f"{value:.3g} {unit}"
        value /= 1000
    return f"{value:.3g} TB"


def duration(seconds: float) -> str:
    """Seconds as ``45 s``, ``12 min`` or ``4.7 h``."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def distance(metres: float) -> str:
    """Metres as ``480 m`` or ``12.3 km``."""
    return f"{metres:.0f} m" if metres < 1000 else f"{metres / 1000:.1f} km"
