"""A folder with the study: made from the sources of the repository, edited, run and
inspected."""

import os
import re
import shutil
import sys
from pathlib import Path

import yaml
from snakemake_starts import started

REPOSITORY = Path(__file__).resolve().parents[2]
SOURCES = (
    "Snakefile",
    "requirements",
    "config.yaml",
    "config",
    "workflow",
    "profiles",
    "src",
    "README.md",
)
SOURCES += ("paper", "CITATION.cff")
# Changes of config.yaml with which the study takes minutes.
SMALL = yaml.safe_load(
    Path(__file__).with_name("small_study.yaml").read_text(encoding="utf-8")
)
# Changes for most tests: the paper's tables and figures of one robot.
ROBOT = "kuka"
LEVEL = "200"
PAPER = "paper"
TINY = {
    "robots": [ROBOT],
    "strategies": ["6DoF", "4-6DoF-after-3DoF"],
    "noise_um": [200],
    "data_sets": 20,
}
_JOB = re.compile(
    r"^(?:local)?rule (\w+):\n(.*?)(?=^\[|^\S|\Z)", re.MULTILINE | re.DOTALL
)


class Study:
    """A folder with the sources of the study and, once it has run, its outputs."""

    def __init__(self, folder):
        self.folder = Path(folder)

    @classmethod
    def of_sources(cls, folder, changes=None):
        """Copy the sources of the repository, and configure the small study with some
        changes."""
        study = cls(folder)
        study.folder.mkdir(parents=True)
        for name in SOURCES:
            source = REPOSITORY / name
            if source.is_dir():
                shutil.copytree(
                    source,
                    study.folder / name,
                    ignore=shutil.ignore_patterns("*.egg-info"),
                )
            elif source.exists():
                shutil.copy2(source, study.folder / name)
        if not study.path("README.md").exists():
            study.path("README.md").write_text("# Stand-in\n", encoding="utf-8")
        study.configure(SMALL | (changes or {}))
        return study

    @classmethod
    def of_links(cls, folder):
        """Link to the sources of the repository; the results are separate."""
        for name in SOURCES:
            (folder / name).symlink_to(REPOSITORY / name)
        return cls(folder)

    def copied_to(self, folder):
        """Copy the folder with the times of its files."""
        shutil.copytree(self.folder, folder)
        return Study(folder)

    def path(self, name):
        return self.folder / name

    def configure(self, changes):
        """Change entries of config.yaml. A mapping is merged into the present one."""
        file = self.path("config.yaml")
        config = yaml.safe_load(file.read_text(encoding="utf-8"))
        for key, value in changes.items():
            if isinstance(value, dict):
                value = config[key] | value
            config[key] = value
        file.write_text(yaml.safe_dump(config, sort_keys=False), encoding="utf-8")

    def replace(self, name, old, new):
        """Edit a source, in which `old` must occur once."""
        text = self.path(name).read_text(encoding="utf-8")
        assert text.count(old) == 1, f"{name} holds {old!r} {text.count(old)} times"
        self.path(name).write_text(text.replace(old, new), encoding="utf-8")

    def append(self, name, text):
        with open(self.path(name), "a", encoding="utf-8") as file:
            file.write(text)

    def edit(self, name):
        """Change the text of a Python source, but not what it does."""
        self.append(name, "\nEDITED = True\n")

    def command(self, *arguments):
        """Return the arguments of a `subprocess` call that runs Snakemake in the folder."""
        environment = os.environ | {
            "PYTHONPATH": str(self.folder / "src"),
            "OMP_NUM_THREADS": "1",
        }
        return {
            "args": [sys.executable, "-m", "snakemake", *arguments],
            "cwd": self.folder,
            "env": environment,
        }

    def snakemake(self, *arguments):
        return started(**self.command(*arguments))

    def run(self, *arguments):
        """Run Snakemake, which must succeed."""
        finished = self.snakemake("-j2", *arguments)
        assert finished.returncode == 0, finished.stderr[-3000:]
        return finished

    def planned(self, *arguments):
        """Return the jobs that Snakemake would run, as (rule, wildcard, wildcard, ...)."""
        finished = self.snakemake("-n", "-p", *arguments)
        assert finished.returncode == 0, finished.stderr[-3000:]
        jobs = []
        for rule, body in _JOB.findall(finished.stdout):
            wildcards = re.search(r"^    wildcards: (.*)$", body, re.MULTILINE)
            values = []
            if wildcards:
                values = [pair.split("=", 1)[1] for pair in wildcards[1].split(", ")]
            jobs.append((rule, *values))
        total = re.search(r"^total +(\d+)$", finished.stdout, re.MULTILINE)
        assert len(jobs) == (int(total[1]) if total else 0), finished.stdout
        assert total or "Nothing to be done" in finished.stdout
        return set(jobs)

    def inputs_by_rule(self, *arguments):
        """Return the files that the jobs of each rule read, from Snakemake's own plan."""
        plan = self.snakemake("-n", "-p", "--forceall", *arguments)
        assert plan.returncode == 0, plan.stderr[-2000:]
        inputs = re.findall(
            r"^(?:local)?rule (\w+):\n    input: (.*)$", plan.stdout, re.MULTILINE
        )
        return {rule: set(files.split(", ")) for rule, files in inputs}

    def files(self, *patterns):
        """Return the relative paths of files by glob patterns, sorted."""
        return sorted(
            p.relative_to(self.folder).as_posix()
            for pattern in patterns
            for p in self.folder.glob(pattern)
        )
