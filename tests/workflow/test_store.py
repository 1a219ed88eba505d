"""A finished run on an object store, for which moto stands in: what is fetched is whole; only what changed goes up again."""

import subprocess
import sys

import boto3
import pytest
from durations import HUNG_S
from moto.server import ThreadedMotoServer

pytestmark = pytest.mark.slow
BUCKET, FOLDER, BLIND = "results", "of/study/", "of/blind/"
STORE = ("store", "--config", f"store=s3://{BUCKET}/{FOLDER.rstrip('/')}")


@pytest.fixture(scope="module")
def bucket():
    """A bucket that Snakemake finds by variables of its environment, and that keeps each version of an object."""
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    endpoint = "http://{}:{}".format(*server.get_host_and_port())
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("ENDPOINT_URL", endpoint), ("ACCESS_KEY", "any"), ("SECRET_KEY", "any")):
            patch.setenv(f"SNAKEMAKE_STORAGE_S3_{name}", value)
        keys = {"aws_access_key_id": "any", "aws_secret_access_key": "any"}
        bucket = boto3.resource("s3", endpoint_url=endpoint, region_name="us-east-1", **keys).Bucket(BUCKET)
        bucket.create()
        bucket.Versioning().enable()
        yield bucket
    server.stop()


@pytest.fixture(scope="module")
def study(small_study, bucket, tmp_path_factory):
    study = small_study.copied_to(tmp_path_factory.mktemp("store") / "study")
    study.run(*STORE)
    return study


def uploaded(bucket, folder=FOLDER):
    """Version of each object, by the name that its file has here: every upload makes another, however soon."""
    versions = [version for version in bucket.object_versions.filter(Prefix=folder) if version.is_latest]
    # A mark that an object was deleted has no size.
    return {version.key.removeprefix(folder): version.id for version in versions if version.size is not None}


def written(study, names):
    """When each file was written here."""
    return {name: study.path(name).stat().st_mtime_ns for name in names}


def fetched(bucket, folder, place):
    """What the list of a run describes that was fetched from the store and unpacked, each file as it says."""
    for name in uploaded(bucket, folder):
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        bucket.download_file(folder + name, str(place / name))
    for command in ([sys.executable, "-m", "zipfile", "-e", "reports/sources.zip", "."], ["sha256sum", "-c", "SHA256SUMS"]):
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=HUNG_S)
        assert done.returncode == 0, done.stdout
    return {line.split("  ", 1)[1] for line in (place / "SHA256SUMS").read_text(encoding="utf-8").splitlines()}


def test_what_is_fetched_from_the_store_is_the_whole_run(study, bucket, tmp_path):
    described = fetched(bucket, FOLDER, tmp_path)
    made = study.files("data/**/*.parquet", "results/**/*.parquet", "reports/tables/*", "reports/figures/*", "reports/*.pdf")
    assert len(made) > 60 and set(made) <= described
    assert {"src/elastocal/errors.py", "workflow/scripts/job.py", "workflow/rules/store.smk"} <= described
    assert (tmp_path / "configuration.json").is_file()
    # The store keeps no second copy here.
    assert study.files(".snakemake/storage/s3/**/*.parquet") == []


def test_the_targets_that_are_named_are_described_and_uploaded_and_no_others(small_proof, bucket, tmp_path):
    """The smallest blind proof, two of whose jobs write folders of cases."""
    proof = small_proof.copied_to(tmp_path / "proof")
    proof.run("store", "--config", f"store=s3://{BUCKET}/{BLIND.rstrip('/')}", "store_of=[blind]", "blind=smoke")
    described = fetched(bucket, BLIND, tmp_path / "fetched")
    cases = proof.files("data/blind/smoke_1/*/*", "data/sealed/smoke_1/*.json")
    assert len(cases) > 10 and set(cases) <= described
    assert not set(cases) & set(uploaded(bucket, BLIND))
    assert {"reports/blind/targets.md", "results/blind/smoke_1.json"} <= described & set(uploaded(bucket, BLIND))
    assert proof.files("data/simulated/*") == []


def test_nothing_is_uploaded_twice(study):
    assert study.planned(*STORE) == set()


def test_only_what_is_made_again_here_or_missing_there_is_uploaded_again(study, bucket):
    missing, before = "results/initial/kuka.parquet", uploaded(bucket)
    earlier = written(study, before)
    bucket.Object(FOLDER + missing).delete()
    study.edit("workflow/scripts/typeset_table.py")
    study.run(*STORE)
    after = uploaded(bucket)
    assert set(after) == set(before)
    made_again = {name for name, when in written(study, after).items() if when != earlier[name]}
    assert {"reports/tables/table1.tex", "reports/sources.zip"} <= made_again
    assert len(made_again) < 20
    assert {name for name in after if after[name] != before[name]} == {missing} | made_again


def test_a_file_that_is_not_as_its_job_wrote_it_is_not_uploaded(study, bucket):
    name = "reports/tables/table1.tex"
    whole = study.path(name).read_bytes()
    study.path(name).write_bytes(whole + b"% A line of mine.\n")
    done = study.snakemake("-j1", "--config", STORE[-1], "--allowed-rules", "upload", "store", "--", "store")
    study.path(name).write_bytes(whole)
    assert done.returncode != 0
    assert study.path(f"results/logs/upload/{name}.log").read_text(encoding="utf-8").startswith(f"{name}: FAILED")
    assert name not in uploaded(bucket)
