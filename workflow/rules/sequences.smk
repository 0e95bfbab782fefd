# What each sequence has, and what it therefore goes into: the functions that the rule files ask.
CONSENSUS = SETTINGS["ground_truth"]["consensus"]


def row(*names):
    """A param function: cells of the sequence's row in the sheet that a stage uses, as a dict of builtins."""

    def of_sequence(wildcards):
        cells = SEQUENCES[wildcards.id].as_dict()
        return {name: cells[name] for name in names}

    return of_sequence


def raw_folder(wildcards):
    return SEQUENCES[wildcards.id].recording


def recording_folder(wildcards):
    """Folder in the raw layout: as recorded, or as converted from a bag."""
    sequence = SEQUENCES[wildcards.id]
    return (
        f"results/{sequence.id}/recording"
        if sequence.format == "rosbag2"
        else sequence.recording
    )


def raw_fingerprint(folder_of, *names):
    """A param function: fingerprint of the named files and folders in a sequence's folder."""

    def of_sequence(wildcards):
        folder = Path(folder_of(wildcards))
        cache = Path("results", wildcards.id, "fingerprints", folder.name)
        return {
            name: fingerprint(folder / name, cache / f"{name}.json") for name in names
        }

    return of_sequence


def has(sequence, *modalities):
    return all(name in sequence.modalities for name in modalities)


def has_camera(sequence):
    return any(name in sequence.modalities for name in CAMERAS)


def poses_mode(name):
    return SETTINGS["poses"]["modes"].get(name, SETTINGS["poses"]["mode"])


def has_poses(sequence):
    estimated = poses_mode(sequence.id) == "estimate"
    needed = SETTINGS["odometry"]["lidars"] if estimated else []
    return bool(sequence.session) and has(sequence, "imu", *needed)


def is_estimated(sequence):
    return has_poses(sequence) and poses_mode(sequence.id) == "estimate"


def has_map(sequence):
    return has_poses(sequence) and has(sequence, "camera_left", *LIDARS)


def is_packed(name):
    return Path("results", name, "package", "inventory.parquet").is_file()


def ids(condition=lambda sequence: True):
    return [name for name, sequence in SEQUENCES.items() if condition(sequence)]


def one_of(names):
    # Without a name the rule must match nothing.
    return "|".join(names) or "(?!)"


def simulated_days():
    """All that a drive day of the embedded input consists of, whether or not a stage reads it yet."""
    days = {
        sequence.session.rsplit("-", 1)[0]
        for sequence in SEQUENCES.values()
        if sequence.session
    }
    sessions = [
        name for name in SIMULATED["sessions"] if name.rsplit("-", 1)[0] in days
    ]
    surveys = [name for name in SIMULATED["surveys"] if name in days]
    drawing = expand(
        rules.simulate_drawing.output.drawing, drawing=["drawing"] if sessions else []
    )
    return (
        drawing
        + expand(rules.simulate_session.output.bundle, simulated=sessions)
        + expand(rules.simulate_survey.output.board, day=surveys)
    )


def raw_bag_fingerprint(wildcards):
    """Fingerprint of all that belongs to the bag: not of labels and trajectories that lie beside it."""
    labels = {"annotations", "privacy_labels.csv"}
    beside = labels | {
        Path(path).name for path in delivered_trajectory(wildcards).values()
    }
    names = sorted(
        path.name
        for path in Path(raw_folder(wildcards)).glob("*")
        if path.name not in beside
    )
    return raw_fingerprint(raw_folder, *names)(wildcards)


def delivered_trajectory(wildcards):
    """The files of another system's trajectory, in the format that the settings name."""
    settings = SETTINGS["poses"]
    files = {
        "tum": {"delivered": "trajectory.tum"},
        "kitti": {"delivered": "trajectory.txt", "times": settings["times_file"]},
    }
    folder = raw_folder(wildcards)
    return {
        name: f"{folder}/{file}" for name, file in files[settings["format"]].items()
    }


def trajectory_source(wildcards):
    """What the poses of a sequence are made from: its own pose graph, or what was delivered with it."""
    if poses_mode(wildcards.id) == "estimate":
        return {"refined": rules.pose_graph.output.trajectory}
    return delivered_trajectory(wildcards)


def poses_cfg(wildcards):
    """Settings and gates of the poses with only the sequence's own mode."""
    chosen = cfg("poses")
    own = {"mode": poses_mode(wildcards.id), "modes": {}}
    return {**chosen, "settings": {**chosen["settings"], **own}}


def privacy_cfg(wildcards):
    """Settings and gates of the privacy stage with only those overrides that are signed for the sequence."""
    chosen = cfg("privacy")
    signed = [
        {**override, "sequences": [wildcards.id]}
        for override in chosen["settings"]["overrides"]
        if wildcards.id in override["sequences"]
    ]
    return {**chosen, "settings": {**chosen["settings"], "overrides": signed}}


def privacy_sight(wildcards):
    """What carries boxes from image to image, where the sequence has it."""
    sequence = SEQUENCES[wildcards.id]
    if not (has_poses(sequence) and has(sequence, "lidar_front")):
        return {}
    return {
        "calibration": rules.calibration.output.calibration,
        "trajectory": rules.poses.output.trajectory,
        "bursts": rules.ingest.output.bursts,
    }


def ledger_rows(names):
    return [line for line in LEDGER if line["sequence"] in names]


def stages_of(sequence):
    """The stages whose modalities a sequence has."""
    planned = {
        "calibration": bool(sequence.session),
        **dict.fromkeys(("odometry", "pose_graph"), is_estimated(sequence)),
        "poses": has_poses(sequence),
        "ground_truth": has_map(sequence),
        "wheels": has_map(sequence),
        "privacy": has_camera(sequence),
        "annotations": has(sequence, "camera_left"),
        "privacy_audit": has(sequence, "camera_left"),
        "irregularities": has_map(sequence),
        "splits": has(sequence, "camera_left"),
    }
    return ["ingest", *(stage for stage, wanted in planned.items() if wanted)]


def package_inputs(wildcards):
    """Artifacts by the names that packaging gives them, and the report of every stage, as far as planned."""
    stages = [
        stage
        for stage in stages_of(SEQUENCES[wildcards.id])
        if stage not in ("splits", "irregularities", "privacy_audit")
    ]
    found = {f"{stage}_report": getattr(rules, stage).output.report for stage in stages}
    if has_drift(SEQUENCES[wildcards.id]):
        found["calibration_drift_report"] = drift_report(SEQUENCES[wildcards.id])
    for name, (stage, output) in PACKED.items():
        if stage in stages:
            found[name] = getattr(getattr(rules, stage).output, output)
    if has_regions(wildcards.id):
        found["regions"] = rules.regions.output.inventory
    return found


def raw_parts(wildcards):
    """What is released as it was recorded: never an image."""
    folder, modalities = (
        Path(recording_folder(wildcards)),
        SEQUENCES[wildcards.id].modalities,
    )
    parts = {
        "lidar_front": "lidar_front",
        "lidar_rear": "lidar_rear",
        "imu": "imu.parquet",
    }
    return {
        name: str(folder / file) for name, file in parts.items() if name in modalities
    }


def report_inputs(wildcards):
    return [
        path
        for sequence in SEQUENCES.values()
        for stage in [*stages_of(sequence), "package"]
        for path in expand(list(getattr(rules, stage).output), id=sequence.id)
    ]


def method_settings(name, repository):
    """What the configuration says of a method, for one tree, as a dict of builtins."""
    method = SETTINGS["benchmark"]["methods"][name]
    task = method.get("task", "depth")
    split = "zero_shot" if task == "odometry" else SETTINGS["benchmark"]["split"]
    return {
        "predictions": str(Path(method["predictions"], repository)),
        "task": task,
        "split": method.get("split", split),
        "space": method.get("space", "original"),
        "unit_m": method.get("unit_m"),
    }


def method_of(wildcards):
    return method_settings(wildcards.method, wildcards.repository)


def predictions_fingerprint(wildcards):
    return fingerprint(
        Path(method_of(wildcards)["predictions"]),
        Path(
            "results/benchmark",
            wildcards.method,
            f"{wildcards.repository}.fingerprint.json",
        ),
    )


def methods_of(*tasks):
    methods = SETTINGS["benchmark"]["methods"]
    return [name for name in methods if methods[name].get("task", "depth") in tasks]


def methods_for(repository, *tasks):
    """The methods that have predictions for a tree."""
    return [
        name
        for name in methods_of(*tasks)
        if in_tree(repository)
        and Path(method_settings(name, repository)["predictions"]).is_dir()
    ]


def compared_methods(wildcards):
    """The methods of depth maps for a tree on the common split: others have a table of their own."""
    found = {
        name: method_settings(name, wildcards.repository)
        for name in methods_for(wildcards.repository, "depth", "completion")
    }
    common = SETTINGS["benchmark"]["split"]
    return {name: method for name, method in found.items() if method["split"] == common}


def compared_evaluations(wildcards):
    return [
        f"results/benchmark/{method}/{wildcards.repository}/evaluation.json"
        for method in compared_methods(wildcards)
    ]


def evaluations(wildcards):
    """Tables of all methods on each tree that they have predictions for, and those that compare them."""
    tables = []
    for repository in REPOSITORIES:
        tables += [
            f"results/benchmark/{method}/{repository}/table.md"
            for method in methods_for(repository, "depth", "completion", "odometry")
        ]
        of_tree = SimpleNamespace(repository=repository)
        if compared_methods(of_tree):
            tables.append(f"results/benchmark/{repository}/table.md")
    if not tables:
        raise WorkflowError(
            "card: no predictions to evaluate: name them in config.yaml under benchmark.methods"
        )
    return tables


def consensus_images(wildcards):
    """Only a model looks at images, and at none but anonymized ones."""
    if wildcards.id in CONSENSUS["sequences"] and CONSENSUS["model"]:
        return [f"results/{wildcards.id}/anonymized/inventory.parquet"]
    return []


def consensus_maps(wildcards):
    """Fingerprint of the depth maps that a user gives for a sequence."""
    if wildcards.id not in CONSENSUS["sequences"] or not CONSENSUS["depth_maps"]:
        return None
    return fingerprint(
        Path(CONSENSUS["depth_maps"], wildcards.id),
        Path("results", wildcards.id, "depth_maps.fingerprint.json"),
    )


def ground_truth_cfg(wildcards):
    """Settings of the stage; a consensus of other sequences is none of this one's."""
    found = cfg("ground_truth")
    if wildcards.id not in CONSENSUS["sequences"]:
        found["settings"] |= {"consensus": {"sequences": []}}
    else:
        found["settings"] |= {"consensus": CONSENSUS | {"sequences": [wildcards.id]}}
    return found


def detectors():
    """By the split it was trained on, each detector that the configuration names."""
    named = SETTINGS["proposals"]["detectors"]
    return {way: detector for way, detector in named.items() if detector["model"]}


def sampled():
    """Rows of the sample of the sequences to build; it is drawn by `card annotations sample`."""
    path = Path(SETTINGS["proposals"]["sample"])
    if not path.is_file():
        raise WorkflowError(
            f"card: no sample: draw it into {path} with `card annotations sample`"
        )
    return [row for row in read_sample(path) if row.sequence in SEQUENCES]


def sample_rows(wildcards):
    return [asdict(row) for row in sampled() if row.sequence == wildcards.id]


def sampled_outputs(rule, way):
    """Outputs of a rule, for one detector, of all sequences that have sampled frames."""
    names = sorted({row.sequence for row in sampled()})
    return expand(list(rule.output), id=names, way=way)


def proposals_of_all(wildcards):
    """Proposals and their review for each detector, and its figures where it can be judged."""
    if not detectors():
        raise WorkflowError(
            "card: no detector: name one in config.yaml under proposals.detectors"
        )
    return [
        path
        for way in detectors()
        for path in sampled_outputs(rules.proposal_review, way)
    ]
