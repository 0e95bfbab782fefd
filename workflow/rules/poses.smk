# Needs: the IMU, bursts and calibration, or a delivered trajectory; the times of bursts and frames.
# Makes: results/{id}/odometry.parquet, results/{id}/pose_graph/ (nodes, loops, trajectory, graph), and in either
# mode results/{id}/trajectory.parquet (IMU rate) and poses.json.


rule odometry:
    input:
        inventory=rules.ingest.output.inventory,
        bursts=rules.ingest.output.bursts,
        calibration=rules.calibration.output.calibration,
    output:
        odometry="results/{id}/odometry.parquet",
        report="results/{id}/odometry.report.json",
    log:
        "logs/{id}/odometry.log",
    priority: 1
    params:
        cfg=cfg("odometry"),
        code=code("odometry"),
        recording=recording_folder,
    script:
        "../scripts/odometry.py"


rule pose_graph:
    input:
        inventory=rules.ingest.output.inventory,
        bursts=rules.ingest.output.bursts,
        calibration=rules.calibration.output.calibration,
        odometry=rules.odometry.output.odometry,
    output:
        trajectory="results/{id}/pose_graph/trajectory.parquet",
        nodes="results/{id}/pose_graph/nodes.parquet",
        loops="results/{id}/pose_graph/loops.parquet",
        g2o="results/{id}/pose_graph/graph.g2o",
        report="results/{id}/pose_graph.report.json",
    log:
        "logs/{id}/pose_graph.log",
    priority: 1
    params:
        cfg=cfg("pose_graph"),
        odometry=cfg("odometry")["settings"],
        code=code("pose_graph"),
        recording=recording_folder,
    script:
        "../scripts/pose_graph.py"


rule poses:
    input:
        unpack(trajectory_source),
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
        cfg=poses_cfg,
        code=code("poses"),
        recording=recording_folder,
    script:
        "../scripts/poses.py"
