# Needs: the static voxels, bursts, calibration and trajectory.
# Makes: results/{id}/wheel_excitation.json and road_planes.parquet.


rule wheels:
    input:
        inventory=rules.ingest.output.inventory,
        bursts=rules.ingest.output.bursts,
        frames=rules.ingest.output.frames,
        calibration=rules.calibration.output.calibration,
        trajectory=rules.poses.output.trajectory,
        static_voxels=rules.ground_truth.output.static_voxels,
    output:
        wheel_excitation="results/{id}/wheel_excitation.json",
        road_planes="results/{id}/road_planes.parquet",
        report="results/{id}/wheels.report.json",
    log:
        "logs/{id}/wheels.log",
    threads: 2
    params:
        cfg=cfg("wheels"),
        code=code("wheels"),
        recording=recording_folder,
    script:
        "../scripts/wheels.py"
