"""Results in another folder than the sources, as in a container: `snakemake --snakefile ELSEWHERE/Snakefile`."""

import subprocess

from durations import HUNG_S

TARGETS = ("study", "extended_study", "loop", "measured", "blind", "closed_loop", "bad_rows", "planning", "audit", "crate")


def test_every_target_finds_its_sources_and_its_configuration(unstarted, tmp_path):
    place = tmp_path / "results of mine"
    place.mkdir()
    command = unstarted.command("-n", "--quiet", "--snakefile", str(unstarted.path("Snakefile")), "--", *TARGETS)
    done = subprocess.run(**command | {"cwd": place}, capture_output=True, text=True, timeout=HUNG_S)
    assert done.returncode == 0, done.stderr[-3000:]
