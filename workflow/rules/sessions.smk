# Needs: calibration sessions, the day's Leica survey and the drawing in the raw layout.
# Makes: results/sessions/{session}/: boards.parquet, cameras.json, front_lidar.json, rear_and_imu.json and the bundle
# calibration.json; for a survey boards.parquet and rig_wheels.json; for a day drift-{mode}.json.
SESSION = f"{RAW}/sessions/{{session}}"
SURVEY = f"{RAW}/sessions/{{day}}-leica"
DRAWING = f"{RAW}/sessions/drawing.json"
OF_SESSION = "results/sessions/{session}"
OF_SURVEY = "results/sessions/{day}-leica"
# What a calibration bundle must keep; the settings of the steps that make one are theirs.
BUNDLE_SETTINGS = [
    name
    for name, value in SETTINGS["calibration"].items()
    if not isinstance(value, dict) and name != "mode"
]


rule boards:
    input:
        board=f"{SESSION}/board.yaml",
    output:
        boards=f"{OF_SESSION}/boards.parquet",
        report=f"{OF_SESSION}/boards.report.json",
    log:
        "logs/sessions/{session}/boards.log",
    priority: 1
    threads: 2
    params:
        cfg=step_cfg("boards"),
        code=code("detect_boards"),
        raw=session_fingerprint("camera_left", "camera_right", "survey-*/pose-*"),
        session=subpath(input.board, parent=True),
    script:
        "../scripts/detect_boards.py"


rule cameras:
    input:
        boards=rules.boards.output.boards,
        board=rules.boards.input.board,
    output:
        cameras=f"{OF_SESSION}/cameras.json",
        report=f"{OF_SESSION}/cameras.report.json",
    log:
        "logs/sessions/{session}/cameras.log",
    priority: 1
    params:
        cfg=step_cfg("cameras"),
        code=code("calibrate_cameras"),
    script:
        "../scripts/calibrate_cameras.py"


rule front_lidar:
    input:
        boards=rules.boards.output.boards,
        board=rules.boards.input.board,
        cameras=rules.cameras.output.cameras,
        drawing=DRAWING,
    output:
        front_lidar=f"{OF_SESSION}/front_lidar.json",
        report=f"{OF_SESSION}/front_lidar.report.json",
    log:
        "logs/sessions/{session}/front_lidar.log",
    priority: 1
    params:
        cfg=step_cfg("front_lidar"),
        code=code("calibrate_front_lidar"),
        raw=session_fingerprint("lidar_front"),
        session=subpath(input.board, parent=True),
    script:
        "../scripts/calibrate_front_lidar.py"


rule rear_and_imu:
    input:
        front_lidar=rules.front_lidar.output.front_lidar,
        drawing=DRAWING,
    output:
        rear_and_imu=f"{OF_SESSION}/rear_and_imu.json",
        report=f"{OF_SESSION}/rear_and_imu.report.json",
    log:
        "logs/sessions/{session}/rear_and_imu.log",
    priority: 1
    threads: 2
    params:
        cfg=step_cfg("rear_and_imu"),
        odometry=cfg("odometry")["settings"],
        code=code("calibrate_rear_and_imu"),
        raw=session_fingerprint("drive"),
        drive=f"{SESSION}/drive",
    script:
        "../scripts/calibrate_rear_and_imu.py"


rule rig_wheels:
    input:
        boards=f"{OF_SURVEY}/boards.parquet",
        board=f"{SURVEY}/board.yaml",
        front_lidar=first_session,
    output:
        rig_wheels=f"{OF_SURVEY}/rig_wheels.json",
        report=f"{OF_SURVEY}/rig_wheels.report.json",
    log:
        "logs/sessions/{day}-leica/rig_wheels.log",
    priority: 1
    params:
        cfg=step_cfg("rig_wheels"),
        code=code("calibrate_rig_wheels"),
        raw=session_fingerprint("survey-*/points.csv"),
        survey=subpath(input.board, parent=True),
    script:
        "../scripts/calibrate_rig_wheels.py"


rule session_calibration:
    input:
        front_lidar=rules.front_lidar.output.front_lidar,
        rear_and_imu=rules.rear_and_imu.output.rear_and_imu,
        rig_wheels=lambda wildcards: expand(
            rules.rig_wheels.output.rig_wheels, day=wildcards.session[:10]
        ),
        drawing=DRAWING,
    output:
        calibration=f"{OF_SESSION}/calibration.json",
        report=f"{OF_SESSION}/calibration.report.json",
    log:
        "logs/sessions/{session}/calibration.log",
    priority: 1
    params:
        cfg=step_cfg(*BUNDLE_SETTINGS),
        code=code("assemble_bundle"),
    script:
        "../scripts/assemble_bundle.py"


rule calibration_drift:
    input:
        bundles=lambda wildcards: day_bundles(wildcards.day, wildcards.mode),
    output:
        drift="results/sessions/{day}/drift-{mode}.json",
        report="results/sessions/{day}/drift-{mode}.report.json",
    log:
        "logs/sessions/{day}/drift-{mode}.log",
    wildcard_constraints:
        mode="estimate|import",
    params:
        cfg={"gates": gates_of("calibration_drift")},
        code=code("calibration_drift"),
    script:
        "../scripts/calibration_drift.py"
