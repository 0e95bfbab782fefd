# Needs: every artifact of a sequence with its report, never a raw image; the release templates; the splits.
# Makes: results/{id}/package/, one whole tree a licence under results/release/, and its validation.
REPOSITORIES = {
    terms["repository"]: spdx for spdx, terms in LICENSES["licenses"].items()
}
TREE = "results/release/{repository}"


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
    """Artifacts and reports by name, of the stages that this sequence goes through."""
    stages = [
        stage for stage in stages_of(SEQUENCES[wildcards.id]) if stage != "splits"
    ]
    found = {}
    for stage in stages:
        for name, path in getattr(rules, stage).output.items():
            found[f"{stage}_report" if name == "report" else f"{stage}_{name}"] = path
    return found


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
        recording=recording_folder,
        stages=lambda wildcards: stages_of(SEQUENCES[wildcards.id]),
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
