"""A work folder of its own for a scale and a seed, in which the whole workflow runs."""

import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import yaml

from card.packaging.licenses import read_licenses
from card.recording.sheet import read_sequences

REPOSITORY = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Work:
    """A work folder: the repository's configuration with another scale and seed, and what comes of it."""

    folder: Path

    @property
    def truth(self) -> Path:
        """What the simulator knows."""
        return self.folder / "truth"

    def sequences(self) -> list[str]:
        """Ids of the simulated sequences that are released."""
        config = yaml.safe_load((self.folder / "config" / "config.yaml").read_text(encoding="utf-8"))
        licenses = read_licenses(self.folder / "config" / "licenses.yaml")
        rows = read_sequences(self.folder / "config" / "sequences.tsv", licenses["countries"])
        return [row.id for row in rows if row.id in config["simulation"]["drives"] and not row.quarantine]

    def release(self, cores: int) -> bool:
        """Run ``snakemake release`` in the folder; whether all of it succeeded."""
        command = [sys.executable, "-m", "snakemake", "release", "--cores", str(cores)]
        command += ["--snakefile", str(REPOSITORY / "Snakefile"), "--directory", str(self.folder)]
        return subprocess.run(command, cwd=REPOSITORY, check=False).returncode == 0


def prepare(folder: Path, scale: str, seed: int) -> Work:
    """Copy the configuration into ``folder`` with this scale and seed; earlier results there are kept."""
    shutil.copytree(REPOSITORY / "config", folder / "config", dirs_exist_ok=True)
    path = folder / "config" / "config.yaml"
    config = yaml.safe_load(path.read_text(encoding="utf-8"))
    config["scale"] = scale
    config["simulation"] |= {"seed": seed, "truth": "truth"}
    if scale == "tiny":  # its images show no corners of a board
        config["calibration"]["mode"] = "import"
    path.write_text(yaml.safe_dump(config, sort_keys=False), encoding="utf-8")
    return Work(folder)
