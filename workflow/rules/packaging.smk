# Needs: every artifact of a sequence with its report, never a raw image; the release templates; the splits.
# Makes: results/{id}/package/, one whole tree a licence under results/release/, and its validation.
REPOSITORIES = {
    terms["repository"]: spdx for spdx, terms in LICENSES["licenses"].items()
}
TREE = "results/release/{repository}"
PACKED = {
    "frames": ("ingest", "frames"),
    "bursts": ("ingest", "bursts"),
    "recording_inventory": ("ingest", "inventory"),
    "calibration": ("calibration", "calibration"),
    "poses": ("poses", "poses"),
    "ground_truth": ("ground_truth", "inventory"),
    "wheel_excitation": ("wheels", "wheel_excitation"),
    "road_planes": ("wheels", "road_planes"),
    "anonymized": ("privacy", "inventory"),
    "labels": ("annotations", "labels"),
    "label_states": ("annotations", "label_states"),
}


def license_of(sequence):
    return LICENSES["countries"][sequence.country]


def stages_of(sequence):
    """The stages whose modalities a sequence has."""
    planned = {
        "calibration": bool(sequence.session),
        "poses": has_poses(sequence),
        "ground_truth": has_map(sequence),
        "wheels": has_map(sequence),
        "privacy": has_camera(sequence),
        "annotations": has(sequence, "camera_left"),
        "splits": has(sequence, "camera_left"),
    }
    return ["ingest", *(stage for stage, wanted in planned.items() if wanted)]


def package_inputs(wildcards):
    """Artifacts by the names that packaging gives them, and the report of every stage, as far as planned."""
    stages = [
        stage for stage in stages_of(SEQUENCES[wildcards.id]) if stage != "splits"
    ]
    found = {f"{stage}_report": getattr(rules, stage).output.report for stage in stages}
    for name, (stage, output) in PACKED.items():
        if stage in stages:
            found[name] = getattr(getattr(rules, stage).output, output)
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


rule package:
    input:
        unpack(package_inputs),
    output:
        inventory="results/{id}/package/inventory.parquet",
        report="results/{id}/package.report.json",
    log:
        "logs/{id}/package.log",
    params:
        cfg=cfg("packaging", "shard_max_bytes", "classes"),
        code=code("package"),
        row=row(
            "id",
            "country",
            "place",
            "session",
            "road_type",
            "role",
            "off_road",
            "modalities",
        ),
        spdx=lambda wildcards: license_of(SEQUENCES[wildcards.id]),
        raw=raw_parts,
        out=subpath(output.inventory, parent=True),
    script:
        "../scripts/package.py"


def in_tree(repository):
    spdx = REPOSITORIES[repository]
    return [sequence for sequence in SEQUENCES.values() if license_of(sequence) == spdx]


def tree_packages(wildcards):
    return expand(
        rules.package.output.inventory,
        id=[sequence.id for sequence in in_tree(wildcards.repository)],
    )


def tree_splits(wildcards):
    chosen = [
        sequence.id
        for sequence in in_tree(wildcards.repository)
        if has(sequence, "camera_left")
    ]
    return expand(rules.splits.output.splits, id=chosen)


rule assemble:
    input:
        packages=tree_packages,
        splits=tree_splits,
        templates=[
            str(path)
            for path in sorted((BASE / "release").rglob("*"))
            if path.is_file()
        ],
    output:
        sums=f"{TREE}/SHA256SUMS",
        document=f"{TREE}/release.json",
        report=f"{TREE}.report.json",
    log:
        "logs/release/{repository}.log",
    params:
        cfg=cfg("packaging"),
        code=code("assemble"),
        spdx=lambda wildcards: REPOSITORIES[wildcards.repository],
        terms=lambda wildcards: LICENSES["licenses"][REPOSITORIES[wildcards.repository]],
        sequences=lambda wildcards: [
            sequence.id for sequence in in_tree(wildcards.repository)
        ],
        templates=str(BASE / "release"),
        out=subpath(output.sums, parent=True),
    script:
        "../scripts/assemble.py"


rule validate_tree:
    input:
        sums=rules.assemble.output.sums,
    output:
        validation=f"{TREE}.validation.json",
    log:
        "logs/release/{repository}.validation.log",
    params:
        cfg=cfg("packaging"),
        code=code("validate_tree"),
        tree=subpath(input.sums, parent=True),
        ledger=lambda wildcards: ledger_rows(
            {sequence.id for sequence in in_tree(wildcards.repository)}
        ),
    script:
        "../scripts/validate_tree.py"


def validations():
    repositories = [name for name in REPOSITORIES if in_tree(name)]
    return expand(rules.validate_tree.output.validation, repository=repositories)


rule validate:
    input:
        validations(),
