"""Snakemake's own lint has nothing to say."""

import re

from project import Project

# Every rule runs in the one environment that requirements.lock pins; there is no second one a rule.
ONE_ENVIRONMENT = "Specify a conda environment or container for each rule"


def test_the_workflow_is_lint_free(fresh: Project) -> None:
    result = fresh.run("--lint")
    titles = re.findall(r"^    \* (.*)$", result.stdout, re.MULTILINE)
    assert any(title.startswith(ONE_ENVIRONMENT) for title in titles), result.stdout[-3000:]
    assert [title for title in titles if not title.startswith(ONE_ENVIRONMENT)] == []
