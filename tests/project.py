"""A copy of the repository in which a test runs the workflow."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
#: The sequence whose poses are estimated at the tiny scale.
ESTIMATED = "it_zero_shot"
# Heads are lower than what recall counts from: unknown recall fails its gate unless somebody signs.
NO_FACE_AT_TINY = """\
    - figure: recall_face_pct_low
      sequences: [de_town_bumps, de_rural_potholes, de_gravel_offroad, it_town_revisit, it_zero_shot]
      signed_by: the tests
      reason: at 140 px no head is high enough to be counted
"""
JOB = re.compile(r"^(?:localrule|rule|checkpoint) (\w+):$", re.MULTILINE)


@dataclass(frozen=True)
class Project:
    """A copy of the repository in which snakemake runs as a user would run it."""

    root: Path

    def run(self, *arguments: str) -> "subprocess.CompletedProcess[str]":
        """Run snakemake; its output, both streams together, is in ``stdout``."""
        environment = {
            **os.environ,
            # What the caller has on its path stays behind the copy's own library.
            "PYTHONPATH": os.pathsep.join([str(self.root / "src"), os.environ.get("PYTHONPATH", "")]),
            "OMP_NUM_THREADS": "1",
            "XDG_CACHE_HOME": str(self.root / ".cache"),
        }
        return subprocess.run(
            [sys.executable, "-m", "snakemake", "--cores", "2", "--nocolor", *arguments],
            cwd=self.root,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )

    def build(self, *arguments: str) -> None:
        """Run snakemake and expect success."""
        result = self.run(*arguments)
        assert result.returncode == 0, result.stdout[-5000:]

    def plan(self, *arguments: str) -> set[tuple[str, str]]:
        """The jobs a run would execute, as (rule, id or repository); targets without output are left out."""
        result = self.run("--dry-run", "--quiet", "progress", *arguments)
        assert result.returncode == 0, result.stdout[-5000:]
        jobs = set()
        blocks = JOB.split(result.stdout)[1:]
        for name, block in zip(blocks[::2], blocks[1::2], strict=True):
            wildcards = re.search(r"^    wildcards: \w+=(\S+)$", block.split("\n\n")[0], re.MULTILINE)
            jobs.add((name, wildcards.group(1) if wildcards else ""))
        return {job for job in jobs if job[0] not in ("release", "validate")}

    @contextmanager
    def changed(self, name: str, old: str, new: str) -> Iterator[None]:
        """Replace text in a file for the time of the block; its times change, as an editor's would."""
        path = self.root / name
        text = path.read_text()
        assert old in text, f"{old!r} is not in {name}"
        path.write_text(text.replace(old, new, 1))
        try:
            yield
        finally:
            path.write_text(text)


def copy_repository(folder: Path, scale: str) -> Project:
    """Copy what git tracks or would track, and set the scale.

    A tiny LiDAR, with 90 columns, is too thin to register everywhere: all but one sequence are delivered with
    a trajectory. In tiny images a board has no corners to speak of: bundles are delivered.
    """
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        check=True,
    )
    for name in listed.stdout.decode().split("\0"):
        source = REPOSITORY / name
        if name and source.is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, folder / name)
    config = folder / "config" / "config.yaml"
    text = config.read_text().replace("scale: demo", f"scale: {scale}")
    if scale == "tiny":
        text = text.replace("  overrides:\n", f"  overrides:\n{NO_FACE_AT_TINY}")
        text = text.replace("\ncalibration:\n", "\ncalibration:\n  mode: import\n")
        text += f"\nposes: {{mode: import, modes: {{{ESTIMATED}: estimate}}}}\n"
    config.write_text(text)
    return Project(folder)
