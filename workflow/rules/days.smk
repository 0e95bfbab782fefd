# Which calibration session of its day a sequence takes, and what the day has: the functions that the rule files ask.
PARTS = ("start", "mid", "end")


def check_session(row):
    """The session must be there too, and with it what the day has in common if it is to be estimated."""
    if not row.session:
        return
    simulated, folder = SETTINGS["simulation"], Path(RAW, "sessions")
    if row.session not in simulated["sessions"] and not (folder / row.session).is_dir():
        there = sorted(path.name for path in folder.glob("*-*-*-*"))
        raise CardError(
            "unknown session",
            where=row.id,
            found=row.session,
            wanted=f"one of {there + simulated['sessions']}",
        )
    if calibration_mode(row.id) == "import":
        return
    day = row.session[:10]
    if day not in simulated["surveys"] and not (folder / f"{day}-leica").is_dir():
        raise CardError(
            "no survey of the wheels on that day",
            where=row.id,
            found=day,
            wanted=f"{folder}/{day}-leica; or a delivered bundle and calibration.mode import",
        )
    if not simulated["sessions"] and not (folder / "drawing.json").is_file():
        raise CardError(
            "drawing is missing", where=row.id, wanted=folder / "drawing.json"
        )


def calibration_mode(name):
    return SETTINGS["calibration"]["modes"].get(name, SETTINGS["calibration"]["mode"])


def sessions_of(day):
    """The calibration sessions of a drive day, in order of time."""
    names = [path.name for path in Path(RAW, "sessions").glob(f"{day}-*")]
    names += SETTINGS["simulation"]["sessions"]
    return [f"{day}-{part}" for part in PARTS if f"{day}-{part}" in names]


def with_session(row):
    """The row with the nearest session of its day, where the sheet names only the day."""
    if len(row.session) != len("2026-01-01"):
        return row
    starts = {name: session_start(name) for name in sessions_of(row.session)}
    # A single session is the nearest whenever the recording was.
    start = recording_start(row) if len(starts) > 1 else 0
    return replace(row, session=nearest_session(start, starts, row.id))


def session_start(name):
    # What will be simulated has no files yet that say when.
    if name in SETTINGS["simulation"]["sessions"]:
        from card.simulation.calibrations import session_start_ns

        return session_start_ns(name)
    return start_of(Path(RAW, "sessions", name))


def recording_start(row):
    if row.id in SETTINGS["simulation"]["drives"]:
        from card.simulation.drives import drive_named

        return drive_named(row.id).start_ns
    return start_of(Path(row.recording))


def raw_session(wildcards):
    return f"{RAW}/sessions/{SEQUENCES[wildcards.id].session}"


def bundle_of(session, mode):
    folder = "results" if mode == "estimate" else RAW
    return f"{folder}/sessions/{session}/calibration.json"


def session_bundle(wildcards):
    return bundle_of(SEQUENCES[wildcards.id].session, calibration_mode(wildcards.id))


def calibration_cfg(wildcards):
    """Gates, and of the settings those of a bundle, with only the sequence's own mode."""
    chosen = cfg("calibration", *BUNDLE_SETTINGS)
    own = {"mode": calibration_mode(wildcards.id), "modes": {}}
    return {**chosen, "settings": {**chosen["settings"], **own}}


def has_drift(sequence):
    """Whether there is another session to compare a sequence's own with."""
    return (
        bool(sequence.session)
        and len(day_bundles(sequence.session[:10], calibration_mode(sequence.id))) > 1
    )


def day_bundles(day, mode):
    """The bundles of a day's sessions; of delivered ones those that are there."""
    return [
        bundle_of(session, mode)
        for session in sessions_of(day)
        if mode == "estimate"
        or session in SIMULATED["sessions"]
        or Path(bundle_of(session, mode)).is_file()
    ]


def drift_report(sequence):
    return expand(
        rules.calibration_drift.output.report,
        day=sequence.session[:10],
        mode=calibration_mode(sequence.id),
    )[0]


def step_cfg(*names):
    """Settings of a step of the calibration; its figures are gated in the bundle of a sequence."""
    return {"settings": cfg("calibration", *names)["settings"], "gates": []}


def session_fingerprint(*names):
    """A param function: fingerprint of the named files and folders of a session or survey."""

    def of_session(wildcards):
        session = getattr(wildcards, "session", None) or f"{wildcards.day}-leica"
        folder = Path(RAW, "sessions", session)
        cache = Path("results", "sessions", session, "fingerprints")
        found = [path for name in names for path in sorted(folder.glob(name))] or [
            folder / names[0]
        ]
        return {
            str(path.relative_to(folder)): fingerprint(
                path, cache / f"{'-'.join(path.relative_to(folder).parts)}.json"
            )
            for path in found
        }

    return of_session


def first_session(wildcards):
    """The survey follows the day's first session: its cameras look at the board."""
    return f"results/sessions/{sessions_of(wildcards.day)[0]}/front_lidar.json"
