"""How metrics are printed: their names, units and better side, in the order of the paper's tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from card.benchmark.pixel_metrics import COMPLETION_METRICS, DEPTH_METRICS, HEIGHT_METRICS


@dataclass(frozen=True)
class Column:
    """Name and unit as plain text and as LaTeX; higher: whether more is better; digits: decimals in print."""

    text: str
    latex: str
    unit: str
    higher: bool
    digits: int = 3

    @property
    def head(self) -> str:
        """Name, unit and arrow as plain text."""
        unit = f" [{self.unit}]" if self.unit else ""
        return f"{self.text}{unit} {'↑' if self.higher else '↓'}"

    @property
    def latex_head(self) -> str:
        """The same as LaTeX."""
        unit = f" [{self.unit}]" if self.unit else ""
        return rf"{self.latex}{unit} $\{'up' if self.higher else 'down'}arrow$"


COLUMNS = {
    "abs_rel": Column("AbsRel", "AbsRel", "", False),
    "sq_rel": Column("SqRel", "SqRel", "m", False),
    "rmse": Column("RMSE", "RMSE", "m", False),
    "rmse_log": Column("RMSElog", "RMSElog", "", False),
    **{f"delta_{n}": Column(f"δ{n}", rf"$\delta_{n}$", "", True) for n in (1, 2, 3)},
    "mae": Column("MAE", "MAE", "m", False),
    "irmse": Column("iRMSE", "iRMSE", "1/m", False, 4),
    "imae": Column("iMAE", "iMAE", "1/m", False, 4),
    "height_abs_diff": Column("height AbsDiff", "Height AbsDiff", "m", False),
    "height_rmse": Column("height RMSE", "Height RMSE", "m", False),
}


def columns(names: Sequence[str], settings: Mapping[str, Any]) -> dict[str, Column]:
    """The columns of some metrics; the height accuracies are named by the thresholds of the settings."""
    taus = [f"{100 * tau:g}" for tau in settings["height_thresholds_m"]]
    accuracies = {
        f"height_delta_{n}": Column(f"height δ@{tau} cm", rf"Height $\delta@{tau}$\,cm", "", True)
        for n, tau in enumerate(taus, 1)
    }
    known = COLUMNS | accuracies
    return {name: known[name] for name in names}


TASK_METRICS = {
    "depth": (*DEPTH_METRICS, *HEIGHT_METRICS),
    "completion": (*COMPLETION_METRICS, *HEIGHT_METRICS),
}
