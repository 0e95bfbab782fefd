# Needs: bursts of both LiDARs, calibration, the trajectory at IMU rate.
# Makes: results/{id}/ground_truth/ with one npz a frame, the static voxels and the coverage.
# With a monocular consensus also: the anonymized images, or a folder of depth maps.
CONSENSUS = SETTINGS["ground_truth"]["consensus"]


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


rule ground_truth:
    input:
        inventory=rules.ingest.output.inventory,
        bursts=rules.ingest.output.bursts,
        frames=rules.ingest.output.frames,
        calibration=rules.calibration.output.calibration,
        ego_mask=rules.calibration.output.ego_mask,
        trajectory=rules.poses.output.trajectory,
        anonymized=consensus_images,
    output:
        inventory="results/{id}/ground_truth/inventory.parquet",
        static_voxels="results/{id}/ground_truth/static_voxels.npz",
        coverage="results/{id}/ground_truth/coverage.parquet",
        report="results/{id}/ground_truth.report.json",
    log:
        "logs/{id}/ground_truth.log",
    priority: 1
    params:
        cfg=ground_truth_cfg,
        code=code("ground_truth"),
        maps=consensus_maps,
        recording=recording_folder,
        out=subpath(output.inventory, parent=True),
    script:
        "../scripts/ground_truth.py"
