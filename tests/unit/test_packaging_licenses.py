"""Licence by country."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from card.errors import CardError
from card.packaging.licenses import license_of, read_licenses

ROOT = Path(__file__).resolve().parents[2]
PATH = ROOT / "config" / "licenses.yaml"


def changed(tmp_path: Path, change: Any) -> Path:
    document = yaml.safe_load(PATH.read_text())
    change(document)
    path = tmp_path / "licenses.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


def test_germany_and_italy_have_the_licences_of_the_paper() -> None:
    licenses = read_licenses(PATH)
    assert license_of("DE", licenses) == "CC-BY-4.0"
    assert license_of("IT", licenses) == "CC-BY-NC-4.0"
    assert licenses["licenses"]["CC-BY-4.0"]["commercial"]
    assert not licenses["licenses"]["CC-BY-NC-4.0"]["commercial"]


def test_each_licence_has_its_text() -> None:
    for spdx, terms in read_licenses(PATH)["licenses"].items():
        text = (ROOT / "release" / "licenses" / terms["text"]).read_text()
        assert f"SPDX-License-Identifier: {spdx}\n" in text
        assert terms["name"] in text
        assert "Section 8" in text  # the legal code to its end, no summary of it


def test_an_unknown_country_is_an_error() -> None:
    with pytest.raises(CardError, match=r"country without a licence \(found FR, wanted DE \| IT\)"):
        license_of("FR", read_licenses(PATH))


def test_a_country_with_an_unknown_licence_is_an_error(tmp_path: Path) -> None:
    path = changed(tmp_path, lambda document: document["countries"].update(FR="ODbL-1.0"))
    with pytest.raises(CardError, match=r"countries/FR: unknown licence \(found ODbL-1.0"):
        read_licenses(path)


def test_two_licences_cannot_share_a_tree(tmp_path: Path) -> None:
    path = changed(
        tmp_path, lambda document: document["licenses"]["CC-BY-4.0"].update(repository="card-italy")
    )
    with pytest.raises(CardError, match="share a repository"):
        read_licenses(path)


def test_a_licence_without_attribution_is_an_error(tmp_path: Path) -> None:
    path = changed(tmp_path, lambda document: document["licenses"]["CC-BY-4.0"].pop("attribution"))
    with pytest.raises(CardError, match="attribution"):
        read_licenses(path)
