"""Responsible-AI fields of the Croissant document (Croissant RAI 1.0, https://docs.mlcommons.org/croissant/)."""

from collections.abc import Mapping, Sequence
from typing import Any

VERSION = "http://mlcommons.org/croissant/RAI/1.0"


def rai_fields(
    release: Mapping[str, Any], sequences: Sequence[Mapping[str, Any]], contact: str
) -> dict[str, Any]:
    """Fields `rai:...` of a release from its counts and the rows of its sequences."""
    frames = sum(row["frames"] for row in sequences)
    reviewed = sum(row["reviewed_frames"] for row in sequences)
    places = sorted({f"{row['place']} ({row['country']})" for row in sequences})
    days = sorted({(row["session"] or "")[:10] for row in sequences} - {""})
    without_poses = sum(row["distance_m"] is None for row in sequences)
    fields = {
        "dataCollection": "Drives of a car with two global-shutter cameras, two LiDARs and an IMU on public "
        f"roads, in {len(places)} places: {', '.join(places) or 'none'}.",
        "dataCollectionType": ["Direct measurement"],
        "dataCollectionMissingData": f"{without_poses} of {len(sequences)} sequences have no poses; the "
        "has_ columns of the frame tables tell which files a frame lacks.",
        "dataCollectionRawData": "LiDAR bursts as recorded; images only with faces and number plates filled.",
        "dataImputationProtocol": "None: what was not measured is missing, never filled in.",
        "dataPreprocessingProtocol": [
            "Faces and number plates are detected and filled with a constant colour in the compressed image.",
            "Ground truth is made from the bursts of a time window around a frame, without moving objects.",
        ],
        "dataAnnotationProtocol": "Boxes around positive and negative road irregularities, in the original "
        f"image; {reviewed} of {frames} frames were reviewed by a person.",
        "dataUseCases": [
            "Depth estimation and completion",
            "Detection of road irregularities",
            "Estimation of the road's shape under the wheels",
        ],
        "dataBiases": f"Only the places, roads and days named here ({', '.join(days) or 'no days'}), one "
        "car, right-hand traffic; irregularities are more frequent than on an average road.",
        "dataLimitations": "Sparse ground truth beyond the LiDARs' range and on moving objects; frames whose "
        "labels nobody has reviewed say so in label_state.",
        "dataSocialImpact": "Meant to make driving on bad roads safer, not to identify people or vehicles.",
        "personalSensitiveInformation": "People and vehicles in public; faces and number plates are filled, "
        f"those that were missed are removed on request to {contact}.",
        "dataReleaseMaintenancePlan": "Semantic versions; a takedown is a new major version with tombstones "
        "in metadata/retractions.parquet; changes.json tells what changed.",
    }
    if days:
        fields["dataCollectionTimeFrame"] = [days[0], days[-1]]
    return {f"rai:{name}": value for name, value in fields.items()}
