# Needs: nothing but a scale and a seed.
# Makes: the embedded default input under recordings/, and its truth, which no other rule file names.
SIMULATED = {
    name: SETTINGS["simulation"][name] for name in ("drives", "sessions", "surveys")
}
SEED = {"scale": SETTINGS["scale"], "seed": SETTINGS["simulation"]["seed"]}
TRUTH = SETTINGS["simulation"]["truth"]


rule simulate_drive:
    output:
        recording=f"{RAW}/{{drive}}/recording.yaml",
        trajectory=f"{RAW}/{{drive}}/trajectory.tum",
    log:
        "logs/simulation/{drive}.log",
    wildcard_constraints:
        drive=one_of(SIMULATED["drives"]),
    # The longest way to a release: start it before what can wait.
    priority: 1
    params:
        cfg={**SEED, "dual_returns": SETTINGS["simulation"]["dual_returns"]},
        code=code("simulate_drive"),
        recording=subpath(output.recording, parent=True),
        truth=f"{TRUTH}/{{drive}}",
    script:
        "../scripts/simulate_drive.py"


rule simulate_drawing:
    output:
        drawing=f"{RAW}/sessions/{{drawing}}.json",
    log:
        "logs/simulation/{drawing}.log",
    # A car of your own has its own drawing there.
    wildcard_constraints:
        drawing=one_of(["drawing"] if SIMULATED["sessions"] else []),
    params:
        cfg={"scale": SETTINGS["scale"]},
        code=code("simulate_drawing"),
    script:
        "../scripts/simulate_drawing.py"


rule simulate_session:
    output:
        board=f"{RAW}/sessions/{{simulated}}/board.yaml",
        bundle=f"{RAW}/sessions/{{simulated}}/calibration.json",
        ego_mask=f"{RAW}/sessions/{{simulated}}/ego_mask.png",
    log:
        "logs/simulation/{simulated}.log",
    wildcard_constraints:
        simulated=one_of(SIMULATED["sessions"]),
    params:
        cfg=SEED,
        code=code("simulate_session"),
        folder=subpath(output.bundle, parent=True),
        truth=f"{TRUTH}/sessions/{{simulated}}",
    script:
        "../scripts/simulate_session.py"


rule simulate_survey:
    output:
        board=f"{RAW}/sessions/{{day}}-leica/board.yaml",
    log:
        "logs/simulation/{day}-leica.log",
    wildcard_constraints:
        day=one_of(SIMULATED["surveys"]),
    params:
        cfg=SEED,
        code=code("simulate_survey"),
        folder=subpath(output.board, parent=True),
        truth=f"{TRUTH}/sessions/{{day}}-leica",
    script:
        "../scripts/simulate_survey.py"
