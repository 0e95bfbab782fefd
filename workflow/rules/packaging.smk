# Needs: every artifact of a sequence with its report, never a raw image; the release templates; the splits.
# Makes: results/{id}/package/, one whole tree a licence under results/release/, its validation, the firewall's report.
# Every repository with its licence: the licence's own, and those of later batches.
REPOSITORIES = {
    batch_repository(terms["repository"], batch): spdx
    for spdx, terms in LICENSES["licenses"].items()
    for batch in sorted({1, *BATCHES.values()})
    if batch == 1
    or any(
        BATCHES.get(row.id) == batch and license_of(row.country, LICENSES) == spdx
        for row in ROWS
    )
}
TREE = f"{RELEASE}/{{repository}}"
TEMPLATES = Path(os.path.relpath(BASE / "release"))
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


rule package:
    input:
        unpack(package_inputs),
    output:
        inventory="results/{id}/package/inventory.parquet",
        report="results/{id}/package.report.json",
    log:
        "logs/{id}/package.log",
    params:
        cfg=cfg("packaging", "shard_max_bytes", "shard_frames", "classes"),
        code=code("package"),
        row=row(
            "id",
            "country",
            "place",
            "session",
            "road_type",
            "light",
            "role",
            "off_road",
            "modalities",
        ),
        spdx=lambda wildcards: license_of(SEQUENCES[wildcards.id].country, LICENSES),
        raw=raw_parts,
        takedowns=takedowns_of,
        out=subpath(output.inventory, parent=True),
    script:
        "../scripts/package.py"


rule assemble:
    input:
        packages=tree_packages,
        splits=tree_splits,
        split_report=rules.split_report.output.report,
        schemas=sorted(os.path.relpath(path) for path in schema_folder().glob("*.json")),
        records=earlier_releases,
        changelog=str(TEMPLATES / "CHANGELOG.md"),
        templates=sorted(str(path) for path in TEMPLATES.rglob("*") if path.is_file()),
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
        takedowns=tree_takedowns,
        reviews=tree_reviews,
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


rule assign_batches:
    # The committed ledger is not a result: this rule makes no file and runs whenever it is asked for.
    input:
        packages=expand(rules.package.output.inventory, id=list(SEQUENCES)),
    log:
        "logs/assign_batches.log",
    params:
        cfg=cfg("packaging", "hub"),
        ledger=SETTINGS["batches_ledger"],
        repositories=[
            LICENSES["licenses"][license_of(row.country, LICENSES)]["repository"]
            for row in SEQUENCES.values()
        ],
    script:
        "../scripts/assign_batches.py"


rule firewall:
    input:
        sums=tree_sums,
    output:
        report=f"{RELEASE}/firewall.report.json",
    log:
        "logs/release/firewall.log",
    params:
        cfg=LICENSES["countries"],
        code=code("firewall"),
    script:
        "../scripts/firewall.py"


rule validate:
    input:
        validations(),
        rules.firewall.output,
