"""What changed decides what runs; nothing else does."""

import os
import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from project import ESTIMATED, Project

TOWN = "de_town_bumps"
GERMANY, ITALY = "card-germany", "card-italy"
DRIVES = [TOWN, "de_rural_potholes", "de_gravel_offroad", "it_town_revisit", "it_zero_shot"]
# Of a sequence that is delivered with a trajectory, as all but one are at the tiny scale.
STAGES = [
    "ingest",
    "poses",
    "ground_truth",
    "wheels",
    "privacy_search",
    "privacy",
    "annotations",
    "splits",
    "package",
]


def chain(id: str, *stages: str) -> set[tuple[str, str]]:
    return {(stage, id) for stage in stages}


def tree(*repositories: str) -> set[tuple[str, str]]:
    pairs = {(rule, name) for name in repositories for rule in ("assemble", "validate_tree")}
    return pairs | {("firewall", "")}


def split_tree(*repositories: str) -> set[tuple[str, str]]:
    """A tree, and what is said about the splits of its sequences; Germany's may be used commercially."""
    return tree(*repositories) | {("split_report", name) for name in repositories} | {("split_lists", "")}


@contextmanager
def without(path: Path, aside: Path) -> Iterator[None]:
    """Take a file or folder away for the time of the block, keeping its times."""
    shutil.move(path, aside)
    try:
        yield
    finally:
        if path.is_dir():
            shutil.rmtree(path)
        shutil.move(aside, path)


def test_nothing_runs_twice(built: Project) -> None:
    assert built.plan() == set()


def test_touching_everything_runs_nothing(built: Project) -> None:
    for folder in ("recordings", "config", "schemas", "src", "workflow", "release"):
        for path in (built.root / folder).rglob("*"):
            if path.is_file():
                os.utime(path)
    assert built.plan() == set()


def test_one_raw_sweep_reruns_its_own_sequence_and_tree(built: Project) -> None:
    sweep = sorted((built.root / "recordings" / TOWN / "lidar_front").iterdir())[3]
    content = sweep.read_bytes()
    sweep.write_bytes(content + b"\0")
    try:
        assert built.plan() == chain(TOWN, *STAGES) | split_tree(GERMANY)
    finally:
        sweep.write_bytes(content)


def test_a_removed_raw_image_reruns_its_own_sequence_and_tree(built: Project, tmp_path: Path) -> None:
    image = sorted((built.root / "recordings" / TOWN / "camera_right").iterdir())[0]
    with without(image, tmp_path / image.name):
        assert built.plan() == chain(TOWN, *STAGES) | split_tree(GERMANY)


def test_one_label_file_reruns_annotations_and_what_packs_them(built: Project) -> None:
    label = next((built.root / "recordings" / TOWN / "annotations" / "labels").glob("*.txt"))
    name = label.relative_to(built.root).as_posix()
    text = label.read_text()
    label.write_text(text + "1 0.5 0.5 0.1 0.1\n")
    try:
        assert built.plan() == chain(TOWN, "annotations", "splits", "package") | split_tree(GERMANY), name
    finally:
        label.write_text(text)


def test_a_setting_of_one_stage_reruns_that_stage_and_its_dependents(built: Project) -> None:
    expected = {(stage, id) for id in DRIVES for stage in ("wheels", "package")} | tree(GERMANY, ITALY)
    with built.changed("config/config.yaml", "simulation:", "wheels: {knot_spacing_m: 0.25}\nsimulation:"):
        assert built.plan() == expected


def test_a_setting_of_the_batch_leaves_the_odometry_and_imported_poses_alone(built: Project) -> None:
    with built.changed("config/config.yaml", "\nposes:", "\npose_graph: {anchor_m: 11}\nposes:"):
        plan = built.plan()
    assert chain(ESTIMATED, "pose_graph", "poses", "ground_truth", "wheels", "package") <= plan
    assert ("odometry", ESTIMATED) not in plan
    assert ("poses", TOWN) not in plan


def test_another_mode_reruns_the_poses_of_its_sequence_only(built: Project) -> None:
    with built.changed("config/config.yaml", f"{ESTIMATED}: estimate", f"{ESTIMATED}: import"):
        plan = built.plan()
    assert chain(ESTIMATED, "poses", "ground_truth", "wheels", "package") <= plan
    assert not {("odometry", ESTIMATED), ("pose_graph", ESTIMATED), ("poses", TOWN)} & plan


def test_a_changed_session_reruns_only_the_sequence_that_takes_it(built: Project) -> None:
    german = [id for id in DRIVES if id.startswith("de_")]
    session = "recordings/sessions/2026-04-14-start/calibration.json"
    with built.changed(session, '"views": 3', '"views": 4'):
        plan = built.plan()
    # The day's drift is told with each of its sequences.
    drift = {("calibration_drift", "")} | {("package", id) for id in german}
    assert drift | chain(TOWN, "calibration", "poses", "ground_truth", "wheels") <= plan
    assert {id for rule, id in plan - drift if id in DRIVES} == {TOWN}


def test_estimating_one_sequence_s_calibration_uses_all_sessions_of_its_day(built: Project) -> None:
    modes = f"  mode: import\n  modes: {{{ESTIMATED}: estimate}}\n  cameras"
    with built.changed("config/config.yaml", "  mode: import\n  cameras", modes):
        plan = built.plan()
    sessions = [f"2026-05-19-{part}" for part in ("start", "mid", "end")]
    steps = ("boards", "cameras", "front_lidar", "rear_and_imu", "session_calibration")
    of_sessions = {(step, session) for step in steps for session in sessions}
    assert of_sessions | {("boards", "2026-05-19-leica"), ("rig_wheels", "2026-05-19")} <= plan
    assert {("calibration", ESTIMATED), ("calibration_drift", ""), ("package", ESTIMATED)} <= plan
    assert not {entry for entry in plan if entry[1].startswith(("2026-04-14", "de_", "it_town"))}


def test_a_session_that_the_sheet_names_is_taken_instead_of_the_nearest(built: Project) -> None:
    line = sheet_line(built, TOWN)
    with built.changed("config/sequences.tsv", line, line.replace("\t2026-04-14\t", "\t2026-04-14-start\t")):
        assert built.plan() == set()
    with built.changed("config/sequences.tsv", line, line.replace("\t2026-04-14\t", "\t2026-04-14-end\t")):
        assert chain(TOWN, "calibration", "poses", "ground_truth", "package") <= built.plan()


def test_an_override_reruns_only_the_sequence_it_is_signed_for(built: Project) -> None:
    with built.changed("config/config.yaml", ", it_zero_shot]\n      signed_by", "]\n      signed_by"):
        assert built.plan() == chain("it_zero_shot", "privacy", "package") | tree(ITALY)


def test_an_edited_module_reruns_the_stages_that_reach_it(built: Project) -> None:
    expected = {(stage, id) for id in DRIVES for stage in ("wheels", "package")} | tree(GERMANY, ITALY)
    source = "src/card/wheels/road_plane.py"
    with built.changed(source, "import numpy as np\n", "import numpy as np\n\nEDITED = 1\n"):
        assert built.plan() == expected


def test_an_edited_comment_reruns_nothing(built: Project) -> None:
    with built.changed(
        "src/card/wheels/road_plane.py", "import numpy as np\n", "import numpy as np  # arrays\n"
    ):
        assert built.plan() == set()


def test_a_subset_plans_only_its_sequences_and_leaves_the_release_alone(built: Project) -> None:
    assert built.plan("--config", f"sequences={TOWN}") == split_tree(GERMANY)
    assert built.plan("--forceall", "--config", f"sequences={TOWN}") == (
        chain(TOWN, "calibration", *STAGES, "simulate_drive")
        | split_tree(GERMANY)
        | {("simulate_session", f"2026-04-14-{part}") for part in ("start", "mid", "end")}
        | {("simulate_survey", "2026-04-14"), ("simulate_drawing", "drawing"), ("calibration_drift", "")}
    )


def sheet_line(built: Project, id: str) -> str:
    lines = (built.root / "config" / "sequences.tsv").read_text().splitlines(keepends=True)
    return next(line for line in lines if line.startswith(f"{id}\t"))


def test_a_removed_sequence_reassembles_its_tree_only(built: Project) -> None:
    with built.changed("config/sequences.tsv", sheet_line(built, TOWN), ""):
        assert built.plan() == split_tree(GERMANY)


def test_a_quarantined_sequence_reassembles_its_tree_only(built: Project) -> None:
    line = sheet_line(built, TOWN)
    with built.changed("config/sequences.tsv", line, line.replace("\t-\n", "\tblurred by rain\n")):
        assert built.plan() == split_tree(GERMANY)


def test_an_added_sequence_runs_its_own_chain(built: Project) -> None:
    added = "de_second_town"
    line = sheet_line(built, TOWN)
    folder = built.root / "recordings" / added
    shutil.copytree(built.root / "recordings" / TOWN, folder)
    description = folder / "recording.yaml"
    description.write_text(description.read_text().replace(f"id: {TOWN}", f"id: {added}"))
    try:
        with built.changed("config/sequences.tsv", line, line + line.replace(TOWN, added)):
            assert built.plan() == chain(added, "calibration", *STAGES) | split_tree(GERMANY)
    finally:
        shutil.rmtree(folder)


def test_the_sheet_may_not_contradict_the_recording(built: Project) -> None:
    line = sheet_line(built, TOWN)
    with built.changed("config/sequences.tsv", line, line.replace("\tDE\t", "\tIT\t")):
        result = built.run("--dry-run")
    assert result.returncode != 0
    assert "country differs from the sheet (found DE, wanted IT)" in result.stdout


def test_another_country_moves_the_sequence(built: Project) -> None:
    line = sheet_line(built, TOWN)
    with (
        built.changed("config/sequences.tsv", line, line.replace("\tDE\t", "\tIT\t")),
        built.changed(f"recordings/{TOWN}/recording.yaml", "country: DE", "country: IT"),
    ):
        assert built.plan() == chain(TOWN, *STAGES) | split_tree(GERMANY, ITALY)


def test_another_licence_of_a_country_repacks_its_sequences(built: Project) -> None:
    german = [id for id in DRIVES if id.startswith("de_")]
    with built.changed("config/licenses.yaml", "DE: CC-BY-4.0", "DE: CC-BY-NC-4.0"):
        plan = built.plan()
    # The emptied tree is assembled too: nothing of the old licence may stay in it.
    assert plan == {("package", id) for id in german} | split_tree(GERMANY, ITALY)


def test_a_ledger_row_moves_only_its_sequence(built: Project) -> None:
    ledger = "config/ledger/splits.tsv"
    line = next(x for x in (built.root / ledger).read_text().splitlines(keepends=True) if x.startswith(TOWN))
    with built.changed(
        ledger, line, line.replace(line.split("\t")[3], "test" if "train" in line else "train", 1)
    ):
        assert built.plan() == chain(TOWN, "splits") | split_tree(GERMANY)


def taken_down(built: Project, entry: str) -> AbstractContextManager[None]:
    return built.changed(
        "config/takedowns.yaml",
        "takedowns: []",
        f"takedowns:\n  - {{{entry}, reason: person, date: 2026-05-01}}",
    )


def test_a_takedown_of_frames_repacks_its_sequence_only(built: Project) -> None:
    with taken_down(built, f"sequence: {TOWN}, frames: [2, 3]"):
        assert built.plan() == {("package", TOWN)} | tree(GERMANY)


def test_a_takedown_of_a_region_fills_the_anonymized_images_again(built: Project) -> None:
    region = "region: {camera: camera_left, x_min: 0, y_min: 0, x_max: 16, y_max: 16}"
    with taken_down(built, f"sequence: {TOWN}, frames: 2, {region}"):
        assert built.plan() == chain(TOWN, "regions", "package") | tree(GERMANY)


def test_a_takedown_of_a_sequence_reassembles_its_tree_only(built: Project) -> None:
    with taken_down(built, f"sequence: {TOWN}"):
        assert built.plan() == split_tree(GERMANY)


def test_a_second_batch_is_a_tree_of_its_own(built: Project) -> None:
    with built.changed("config/ledger/batches.tsv", "batch\n", f"batch\n{TOWN}\t2\n"):
        assert built.plan() == split_tree(GERMANY, f"{GERMANY}-batch2")


def test_a_takedown_of_an_unknown_sequence_stops_the_run(built: Project) -> None:
    with taken_down(built, "sequence: de_nowhere, frames: 2"):
        result = built.run("--dry-run")
    assert result.returncode != 0
    assert "takedown of an unknown sequence (found de_nowhere" in result.stdout


def test_part_of_a_release_is_not_uploaded(built: Project) -> None:
    result = built.run("upload", "--config", f"sequences={TOWN}", "send=true")
    assert result.returncode != 0
    assert "part of a release cannot be uploaded" in result.stdout


def test_an_upload_is_only_planned_and_placeholders_are_refused(built: Project) -> None:
    result = built.run("upload")
    assert result.returncode != 0
    assert "placeholder" in result.stdout


def test_lost_records_are_refused(built: Project, tmp_path: Path) -> None:
    with without(built.root / ".snakemake", tmp_path / "aside"):
        result = built.run("--dry-run")
        assert result.returncode != 0
        assert "results are there but not the records of how they were made" in result.stdout
        assert built.run("--dry-run", "--forceall").returncode == 0


def test_an_interrupted_run_is_taken_up_where_it_stopped(built: Project) -> None:
    image = sorted((built.root / "recordings" / TOWN / "camera_left").iterdir())[0]
    content = image.read_bytes()
    other = sorted((built.root / "recordings" / "de_rural_potholes" / "camera_left").iterdir())[0]
    image.write_bytes(other.read_bytes())
    try:
        built.build(f"results/{TOWN}/frames.parquet")
        assert chain(TOWN, "privacy", "package") <= built.plan()
    finally:
        image.write_bytes(content)
        built.build("release")
    assert built.plan() == set()
