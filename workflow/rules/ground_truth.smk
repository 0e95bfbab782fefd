# Needs: bursts of both LiDARs, calibration, the trajectory at IMU rate.
# Makes: results/{id}/ground_truth/ with one npz a frame, the static voxels and the coverage.
# With a monocular consensus also: the anonymized images, or a folder of depth maps.


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
