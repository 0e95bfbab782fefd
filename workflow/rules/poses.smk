# Needs: a delivered trajectory, the IMU, the times of bursts and frames.
# Makes: results/{id}/trajectory.parquet (IMU rate) and poses.json.


rule poses:
    input:
        unpack(delivered_trajectory),
        inventory=rules.ingest.output.inventory,
        bursts=rules.ingest.output.bursts,
        frames=rules.ingest.output.frames,
        calibration=rules.calibration.output.calibration,
    output:
        trajectory="results/{id}/trajectory.parquet",
        poses="results/{id}/poses.json",
        report="results/{id}/poses.report.json",
    log:
        "logs/{id}/poses.log",
    priority: 1
    params:
        cfg=cfg("poses"),
        code=code("poses"),
        recording=recording_folder,
    script:
        "../scripts/poses.py"
