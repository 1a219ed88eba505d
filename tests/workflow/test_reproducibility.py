"""The same seeds give the same study: on one core or two, and whatever else is asked for beside them."""

import json
import subprocess

import pyarrow.parquet as pq
import pytest
from durations import HUNG_S
from PIL import Image
from study_folder import NOISE, ROBOTS, SMALL, STRATEGIES, Study

REPORTS = ("reports/**/*.csv", "reports/**/*.md", "reports/**/*.tex", "reports/**/*.json", "reports/**/*.pdf")
MEASURED = [f"data/simulated/{robot}/{noise}um/measured.parquet" for robot in ROBOTS for noise in NOISE]
KEYS = [(name, "ascending") for name in ("point", "data_set", "configuration")]


# All data, estimates and scores of a robot, and of what follows a table in two formats, a figure and a search among candidates.
SOME = ("reports/tables/table4.tex", "reports/tables/table4.md", "reports/figures/fig4.pdf", "reports/tables/designs.csv")


@pytest.fixture(scope="module")
def serial_study(tmp_path_factory):
    """The small study on one core, as far as `SOME`, by processes of their own: each with another seed of its hashes."""
    study = Study.of_sources(tmp_path_factory.mktemp("serial") / "study")
    subprocess.run(**study.command("-j1", *SOME), check=True, capture_output=True, timeout=HUNG_S)
    return study


def contents(path):
    """Each column bit by bit, where not-a-number is what it is."""
    table = pq.ParquetFile(path).read()
    return {
        name: (str(column.type), column.to_pylist() if "string" in str(column.type) else column.to_numpy().tobytes())
        for name, column in zip(table.column_names, table.columns, strict=True)
    }


def first_data_sets(path):
    """Rows of the data sets that the small study has, in an order of their own."""
    table = pq.ParquetFile(path).read()
    table = table.set_column(0, "point", table.column("point").cast("string")).sort_by(KEYS)
    return table.filter([number < SMALL["data_sets"] for number in table.column("data_set").to_pylist()])


def test_one_core_and_two_make_the_same_reports(small_study, serial_study):
    names = serial_study.files(*REPORTS)
    assert {"reports/tables/table4.csv", *SOME} <= set(names)
    differing = [name for name in names if small_study.path(name).read_bytes() != serial_study.path(name).read_bytes()]
    assert differing == []


def test_one_core_and_two_make_the_same_data(small_study, serial_study):
    names = serial_study.files("data/**/*.parquet", "results/**/*.parquet")
    assert len(names) > len(NOISE) * len(STRATEGIES) * 4
    differing = [name for name in names if contents(small_study.path(name)) != contents(serial_study.path(name))]
    assert differing == []


def test_every_figure_and_table_has_a_record_that_names_commit_configuration_and_seed(small_study):
    records = [json.loads(small_study.path(name).read_text("utf-8")) for name in small_study.files("results/records/**/*.json")]
    origins = {file: record["origin"] for record in records for file in record["outputs"]}
    made = small_study.files("reports/figures/*", "reports/tables/*", "reports/*.pdf", "results/[!lt]*/**/*.parquet")
    assert {"reports/tables/table4.csv", "reports/figures/fig4.png", "reports/study.pdf"} < set(made)
    assert set(made) <= set(origins)
    (origin,) = {tuple(origin.items()) for origin in origins.values()}
    assert dict(origin)["seed"] == 1 and len(dict(origin)["configuration_sha256"]) == 64
    figures = [name for name in made if name.endswith(".png")]
    for name in figures:
        words = Image.open(small_study.path(name)).text["Description"]
        assert all(str(value) in words for value in dict(origin).values()), name


@pytest.mark.parametrize("change", ["more data sets", "another order", "other blocks"])
def test_existing_rows_stay_with(change, unstarted, small_study):
    if change == "more data sets":
        unstarted.configure({"data_sets": SMALL["data_sets"] + 3})
    elif change == "another order":
        unstarted.configure({key: SMALL[key][::-1] for key in ("robots", "strategies", "noise_um")})
    else:
        unstarted.replace("src/elastocal/study/steps/blocks.py", "SETS_PER_BLOCK = 500", "SETS_PER_BLOCK = 5")
    unstarted.run(*MEASURED)
    experiments = "data/simulated/kuka/experiments.parquet"
    assert pq.ParquetFile(unstarted.path(experiments)).num_row_groups == (3 if change == "other blocks" else 1)
    for name in MEASURED:
        before, after = first_data_sets(small_study.path(name)), first_data_sets(unstarted.path(name))
        assert before.num_rows == 4 * SMALL["data_sets"] * SMALL["configurations"]
        assert after.equals(before), name
