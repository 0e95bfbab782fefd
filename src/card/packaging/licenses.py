"""Which licence a drive has, and what each licence says."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.artifacts import read_yaml
from card.errors import CardError


def read_licenses(path: Path) -> dict[str, Any]:
    """Countries and licences of `config/licenses.yaml`.

    CardError for a country with a licence that is not listed, and for two licences that share a
    repository: one tree has one licence.
    """
    document: dict[str, Any] = read_yaml(path, "licenses")
    known = document["licenses"]
    for country, spdx in document["countries"].items():
        if spdx not in known:
            raise CardError(
                "unknown licence", where=f"{path}: countries/{country}", found=spdx, wanted=sorted(known)
            )
    owner: dict[str, str] = {}
    for spdx, terms in known.items():
        other = owner.setdefault(terms["repository"], spdx)
        if other != spdx:
            raise CardError(
                "two licences share a repository",
                where=path,
                found=f"{other} and {spdx}",
                wanted="a repository for each licence",
            )
    return document


def license_of(country: str, licenses: Mapping[str, Any]) -> str:
    """SPDX id of the licence of drives in `country` (ISO 3166 alpha-2); CardError for an unknown one."""
    spdx = licenses["countries"].get(country)
    if spdx is None:
        raise CardError(
            "country without a licence",
            where="config/licenses.yaml",
            found=country,
            wanted=" | ".join(sorted(licenses["countries"])),
        )
    return str(spdx)
