"""What is wrong with the sheet or the raw data is said in one line before anything runs."""

import pytest
from project import Project

SHEET = "config/sequences.tsv"


def refused(project: Project, *arguments: str) -> str:
    """The line a user sees."""
    result = project.run("--dry-run", *arguments)
    assert result.returncode != 0
    lines = [line for line in result.stdout.splitlines() if "card:" in line]
    assert len(lines) == 1, result.stdout
    assert "Traceback" not in result.stdout
    return lines[0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("\tDE\t", "\tFR\t", "country without a licence (found FR"),
        ("de_rural_potholes\t", "de_town_bumps\t", "duplicate id (found de_town_bumps"),
        ("\t2026-04-14\t", "\t2026-04-13-start\t", "unknown session (found 2026-04-13-start"),
        ("\t2026-04-14\t", "\t2026-04-13\t", "de_town_bumps: no calibration session of that day"),
        (
            "de_town_bumps\trecordings/de_town_bumps",
            "my_drive\trecordings/my_drive",
            "my_drive: recording is missing",
        ),
        ("\tzero_shot\t", "\tzero shot\t", "role does not fit schema sequences"),
    ],
)
def test_a_wrong_sheet_is_refused(fresh: Project, old: str, new: str, message: str) -> None:
    with fresh.changed(SHEET, old, new):
        assert message in refused(fresh)


def test_a_day_without_a_survey_cannot_be_estimated(fresh: Project) -> None:
    with (
        fresh.changed("config/config.yaml", "  mode: import\n", "  mode: estimate\n"),
        fresh.changed("config/config.yaml", '["2026-04-14", "2026-05-19"]', '["2026-05-19"]'),
    ):
        assert "de_town_bumps: no survey of the wheels on that day (found 2026-04-14" in refused(fresh)


def test_an_unknown_setting_is_refused(fresh: Project) -> None:
    with fresh.changed("config/config.yaml", "scale: tiny", "scale: tiny\nvoxels: 3"):
        assert "'voxels' was unexpected" in refused(fresh)


def test_proposals_without_a_detector_or_a_sample_say_what_to_do(fresh: Project) -> None:
    result = fresh.run("--dry-run", "proposals")
    assert result.returncode != 0
    assert "card: no detector: name one in config.yaml under proposals.detectors" in result.stdout
    detector = "scale: tiny\nproposals: {detectors: {random: {model: road.onnx}}}"
    with fresh.changed("config/config.yaml", "scale: tiny", detector):
        result = fresh.run("--dry-run", "proposals")
    assert result.returncode != 0
    assert "card: no sample: draw it into config/annotation_sample.tsv" in result.stdout


def test_an_unknown_sequence_on_the_command_line_is_refused(fresh: Project) -> None:
    assert "unknown sequence (found nowhere)" in refused(fresh, "--config", "sequences=nowhere")
