"""The detectors that the settings ask for; what any of them finds is redacted."""

from collections.abc import Mapping
from typing import Any

from card.errors import CardError
from card.privacy.centerface import CenterFaceDetector
from card.privacy.detection import Detector
from card.privacy.models import CENTERFACE, TEXT
from card.privacy.text import TextDetector
from card.privacy.user_model import UserModel


def detectors_of(settings: Mapping[str, Any]) -> list[Detector]:
    """The embedded detectors, if wanted, and the user's models.

    Raises
    ------
    CardError
        If there is none, or one cannot be had: no image is released unseen.
    """
    tile = settings["tile_px"], settings["tile_overlap_px"]
    found: list[Detector] = [UserModel(model) for model in settings["models"]]
    if settings["embedded"]:
        found += [CenterFaceDetector(settings["face"], *tile), TextDetector(settings["plate"], *tile)]
    if not found:
        raise CardError(
            "no detector of faces and plates", where="settings privacy", wanted="embedded: true, or models"
        )
    return found


def models_of(settings: Mapping[str, Any]) -> list[dict[str, str]]:
    """``{name, sha256, license}`` of every model that `detectors_of` uses."""
    packaged = [CENTERFACE, TEXT] if settings["embedded"] else []
    return [
        {"name": model["path"], "sha256": model["sha256"], "license": model["license"]}
        for model in settings["models"]
    ] + [{"name": model.name, "sha256": model.sha256, "license": model.license} for model in packaged]
