"""Show what an upload would do, or do it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.packaging.upload.checks import check_ready
from card.packaging.upload.plan import make_plan, remote_files
from card.packaging.upload.send import attempt, send


def upload(tree: Path, records: Path, settings: Mapping[str, Any], really: bool) -> list[str]:
    """Lines that tell what an upload of `tree` would do, or with `really` what it did.

    Parameters
    ----------
    records : folder for the records of what was sent.
    settings : of packaging. The token is the client's own: from HF_TOKEN or its login.

    CardError for a tree that may not be sent, and where the Hub refuses.
    """
    from huggingface_hub import HfApi

    hub = settings["hub"]
    check_ready(tree, settings["release"], hub)
    api = HfApi(endpoint=hub["endpoint"] or None)
    if really:
        return [*send(tree, records, hub, api).lines(), "sent"]
    repository = f"{hub['namespace']}/{tree.name}"
    plan = make_plan(tree, repository, attempt(lambda: remote_files(api, repository)))
    return [*plan.lines(), "nothing was sent: this is the plan"]
