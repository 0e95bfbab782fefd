# Needs: labels, ground truth, road planes, calibration and trajectory of a sequence.
# Makes: results/{id}/irregularities.parquet, a row a box, and irregularity_tracks.parquet, a row an irregularity.


rule irregularities:
    input:
        labels=rules.annotations.output.labels,
        frames=rules.ingest.output.frames,
        calibration=rules.calibration.output.calibration,
        trajectory=rules.poses.output.trajectory,
        ground_truth=rules.ground_truth.output.inventory,
        road_planes=rules.wheels.output.road_planes,
    output:
        irregularities="results/{id}/irregularities.parquet",
        tracks="results/{id}/irregularity_tracks.parquet",
        report="results/{id}/irregularities.report.json",
    log:
        "logs/{id}/irregularities.log",
    params:
        cfg=cfg("irregularities"),
        code=code("irregularities"),
    script:
        "../scripts/irregularities.py"
