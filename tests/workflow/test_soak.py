"""The worst of the faults of `make soak`: a plain run gets over it, and what it makes is that of an undisturbed run."""

import random
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "faults"))

from soak import contents, ended_by_itself, files_made, killed_for_sure, part_of_the_study

pytestmark = pytest.mark.slow
MEASURED = ("data/simulated/kuka/200um/measured.parquet", "data/simulated/kuka/0um/measured.parquet")


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """A few jobs, undisturbed, and what they made."""
    study = part_of_the_study(tmp_path_factory.mktemp("soak") / "study")
    study.replace("Snakefile", '"results/metrics/kuka/200um/6DoF.parquet",', f'"{MEASURED[0]}", "{MEASURED[1]}",')
    for target in ("results/metrics/kuka/0um/6DoF.parquet", "reports/tables/table1.csv", "reports/tables/table2.csv"):
        study.replace("Snakefile", f'        "{target}",\n', "")
    ended_by_itself(study)
    return study, contents(study)


def test_a_plain_run_finishes_what_a_killed_one_began(part, tmp_path):
    """Of Snakemake alone: its locks stay, its jobs go on without it."""
    study, expected = part
    assert len(expected) > 3
    again = part_of_the_study(tmp_path / "study")
    again.path("Snakefile").write_text(study.path("Snakefile").read_text(encoding="utf-8"), encoding="utf-8")
    middle = files_made(study) // 3, 2 * files_made(study) // 3
    killed_for_sure(again, "snakemake", range(*middle), random.Random(1))
    assert again.files(".snakemake/locks/*")
    ended_by_itself(again)
    assert contents(again) == expected
