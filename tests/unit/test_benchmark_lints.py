"""Lints of result tables, on tables made wrong on purpose and on figures as the paper prints them."""

import numpy as np

from card.benchmark.lints import lint_tables

# Printed rows (supplement, 'Quantitative Results'): the columns of a depth table, F and B side by side.
KEYS = [
    f"{metric}/{region}"
    for metric in ("abs_rel", "sq_rel", "rmse", "rmse_log", "delta_1", "delta_2", "delta_3")
    for region in ("full", "boxes")
]


def printed(text: str) -> dict[str, float]:
    return dict(zip(KEYS, map(float, text.split()), strict=True))


RAW = {
    "MoGe": printed("0.108 0.092 0.349 0.143 2.440 1.013 0.123 0.089 0.919 0.963 0.993 0.993 0.998 0.993"),
    "UniDepth": printed(
        "0.078 0.062 0.314 0.074 2.242 0.764 0.099 0.062 0.975 0.992 0.995 0.993 0.998 0.993"
    ),
    "FS": printed("0.040 0.014 0.411 0.006 2.162 0.185 0.088 0.016 0.976 0.994 0.989 0.994 0.994 0.994"),
}
SCALED = {
    "MoGe": printed("0.045 0.027 0.177 0.022 1.807 0.337 0.074 0.029 0.980 0.989 0.996 0.993 0.999 0.993"),
    "Metric3D": printed(
        "0.060 0.039 0.165 0.034 1.836 0.474 0.085 0.042 0.976 0.990 0.997 0.993 0.999 0.993"
    ),
    "UniDepth": printed(
        "0.046 0.029 0.204 0.022 1.825 0.382 0.074 0.032 0.981 0.992 0.995 0.993 0.999 0.993"
    ),
    "FS": printed("0.036 0.009 0.401 0.003 2.126 0.137 0.086 0.011 0.977 0.994 0.989 0.994 0.994 0.994"),
}
MAIN = {**SCALED, "FS": RAW["FS"]}


def test_the_printed_tables_are_found_out() -> None:
    tables = {"main": MAIN, "raw": RAW, "scaled": SCALED}
    findings = lint_tables(tables, nearest_m=4.0, same=[("main", "scaled")])
    assert "FS: 9 of 14 values differ between main and scaled" in findings
    assert "FS: the rows of main and raw are identical" in findings
    # SqRel 0.003 m cannot be if 0.6 % of the pixels, 4 m away or more, are wrong by a factor of 1.95.
    assert any(
        f.startswith("scaled, FS, boxes: SqRel 0.003 m is too small for delta 3 0.994") for f in findings
    )


def test_a_ceiling_that_methods_share_is_saturated() -> None:
    table = {name: {"delta_3/boxes": 0.993, "delta_1/boxes": 0.9 + k / 100} for k, name in enumerate("abc")}
    findings = lint_tables({"t": table}, nearest_m=1.0)
    assert len(findings) == 1
    assert "delta_3/boxes: 3 methods share the best value 0.993" in findings[0]
    table["d"] = {"delta_3/boxes": 0.999}
    assert lint_tables({"t": table}, nearest_m=1.0) == []
    perfect = {name: {"delta_3/boxes": 1.0} for name in "abc"}
    assert lint_tables({"t": perfect}, nearest_m=1.0) == []


def test_rows_of_two_methods_should_not_be_the_same() -> None:
    findings = lint_tables({"t": {"a": RAW["FS"], "b": RAW["FS"], "c": RAW["MoGe"]}}, nearest_m=0.1)
    assert findings == ["t: the rows of a and b are identical"]


def test_results_that_can_be_are_never_inconsistent() -> None:
    """Whatever the errors, real figures satisfy the bound."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        truth = rng.uniform(4, 60, 200)
        factor = np.where(rng.random(200) < rng.uniform(0, 0.2), rng.choice([0.3, 0.51, 1.96, 4]), 1.0)
        prediction = truth * factor
        ratio = np.maximum(truth / prediction, prediction / truth)
        figures = {
            "sq_rel/full": float(np.mean((truth - prediction) ** 2 / truth)),
            "delta_3/full": float(np.mean(ratio < 1.25**3)),
        }
        assert lint_tables({"t": {"m": figures}}, nearest_m=float(truth.min())) == []


def test_values_that_are_not_there_are_no_oddity() -> None:
    nothing = dict.fromkeys(KEYS)
    assert lint_tables({"t": {"a": nothing, "b": nothing}, "u": {"a": nothing}}, nearest_m=1.0) == []
