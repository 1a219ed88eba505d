"""The same seeds give the same study: on one core or two, whatever else is asked for
beside them, and as it was.

Golden tables of the small study are what they were when a second implementation agreed
in every cell. Where a table is meant to change, copy it from a run of the small study;
where one goes, delete its golden file.
"""

import json
import subprocess

import pandas as pd
import pyarrow.parquet as pq
import pytest
from durations import HUNG_S
from PIL import Image
from study_folder import REPOSITORY, TINY, Study

GOLDEN = sorted((REPOSITORY / "tests" / "golden").glob("study_*.csv"))
REPORTS = (
    "reports/**/*.csv",
    "reports/**/*.md",
    "reports/**/*.tex",
    "reports/**/*.json",
    "reports/**/*.pdf",
)
# All data, estimates and scores of a robot, and of what follows a table in two formats,
# and a figure.
SOME = (
    "reports/tables/table4.tex",
    "reports/tables/table4.md",
    "reports/figures/figure4.pdf",
)


@pytest.fixture(scope="module")
def serial_study(tmp_path_factory):
    """The small study on one core, as far as `SOME`, by processes of their own: each
    with another seed of its hashes."""
    study = Study.of_sources(tmp_path_factory.mktemp("serial") / "study", TINY)
    subprocess.run(
        **study.command("-j1", *SOME), check=True, capture_output=True, timeout=HUNG_S
    )
    return study


def contents(path):
    """Each column bit by bit, where not-a-number is what it is."""
    table = pq.ParquetFile(path).read()
    return {
        name: (
            str(column.type),
            column.to_pylist()
            if "string" in str(column.type)
            else column.to_numpy().tobytes(),
        )
        for name, column in zip(table.column_names, table.columns, strict=True)
    }


@pytest.mark.slow
def test_one_core_and_two_make_the_same_reports_and_data(paper, serial_study):
    names = serial_study.files(*REPORTS)
    data = serial_study.files("data/**/*.parquet", "results/**/*.parquet")
    assert {"reports/tables/table4.csv", *SOME} <= set(names) and len(data) > 8
    assert [
        name
        for name in names
        if paper.path(name).read_bytes() != serial_study.path(name).read_bytes()
    ] == []
    assert [
        name
        for name in data
        if contents(paper.path(name)) != contents(serial_study.path(name))
    ] == []


def test_every_figure_and_table_has_a_record_that_names_commit_configuration_and_seed(
    paper,
):
    records = [
        json.loads(paper.path(name).read_text("utf-8"))
        for name in paper.files("results/records/**/*.json")
    ]
    origins = {
        file: record["origin"] for record in records for file in record["outputs"]
    }
    made = paper.files(
        "reports/figures/*", "reports/tables/*", "results/[!lt]*/**/*.parquet"
    )
    assert {"reports/tables/table4.csv", "reports/figures/figure4.png"} < set(made)
    assert set(made) <= set(origins)
    (origin,) = {tuple(origin.items()) for origin in origins.values()}
    assert dict(origin)["seed"] == 1 and len(dict(origin)["configuration_sha256"]) == 64
    figures = [name for name in made if name.endswith(".png")]
    for name in figures:
        description = Image.open(paper.path(name)).text["Description"]
        assert all(str(value) in description for value in dict(origin).values()), name


@pytest.mark.slow
@pytest.mark.parametrize("kept", GOLDEN, ids=lambda path: path.stem)
def test_a_table_of_the_study_is_what_it_was(kept, small_study):
    made = small_study.path(f"reports/tables/{kept.name.removeprefix('study_')}")
    pd.testing.assert_frame_equal(
        pd.read_csv(made), pd.read_csv(kept), rtol=1e-7, atol=1e-12
    )


def test_the_tables_of_the_paper_are_among_them():
    assert {f"study_table{number}" for number in range(1, 5)} <= {
        path.stem for path in GOLDEN
    }
