"""Parts of Snakemake that are not its interface behave as the workflow assumes."""

import asyncio
import inspect
import subprocess
from types import SimpleNamespace

import pytest
import snakemake_internals
from snakemake.api import (
    ConfigSettings,
    DAGSettings,
    OutputSettings,
    ResourceSettings,
    SnakemakeApi,
)
from snakemake.benchmark import BenchmarkRecord
from snakemake.dag import ScriptProcessor
from snakemake.executors.dryrun import Executor as DryRunExecutor
from snakemake.io import _IOFile
from snakemake.script import PythonScript
from snakemake.settings.types import MaxJobsPerTimespan, SchedulingSettings
from snakemake_interface_executor_plugins.executors.base import AbstractExecutor
from warm_start import StartedScript

SNAKEFILE = """
rule make_table:
    output: "made/{name}.csv"
    script: "scripts/make_table.py"

rule draw_table:
    input: "made/{name}.csv"
    output: "drawn/{name}.pdf"
    log: "logs/{name}.log"
    shell: "touch {output}"

rule all_tables:
    input: "drawn/first.pdf"
"""


@pytest.fixture
def workflow(tmp_path):
    """The workflow of a small Snakefile, read and not run."""
    snakefile = tmp_path / "Snakefile"
    snakefile.write_text(SNAKEFILE)
    settings = ConfigSettings(config={"seed": 2}, config_args=["seed=2"])
    with SnakemakeApi(OutputSettings(quiet={"all"})) as api:
        read = api.workflow(
            resource_settings=ResourceSettings(cores=1),
            config_settings=settings,
            snakefile=snakefile,
            workdir=tmp_path,
        )
        read.dag(dag_settings=DAGSettings())
        yield read._workflow


def named(workflow, name):
    return next(rule for rule in workflow.rules if rule.name == name)


def test_a_script_is_started_by_our_function_and_its_process_is_measured(monkeypatch):
    monkeypatch.setattr(PythonScript, "execute_script", PythonScript.execute_script)
    process = subprocess.Popen(["sleep", "0.2"])
    snakemake_internals.replace_script_runner(
        lambda name: StartedScript(process.pid, process.wait)
    )
    script = SimpleNamespace(bench_record=BenchmarkRecord())
    PythonScript.execute_script(script, "script.py")
    assert script.bench_record.running_time > 0.1


def test_a_script_that_fails_fails_its_job(monkeypatch):
    monkeypatch.setattr(PythonScript, "execute_script", PythonScript.execute_script)
    snakemake_internals.replace_script_runner(lambda name: StartedScript(0, lambda: -9))
    script = SimpleNamespace(bench_record=BenchmarkRecord())
    with pytest.raises(subprocess.CalledProcessError) as failure:
        PythonScript.execute_script(script, "script.py")
    assert failure.value.returncode == -9


def test_snakemake_starts_a_script_that_we_cannot_start(monkeypatch):
    started = []

    def start_interpreter(script, name, edit):
        started.append((name, edit))

    def refuse(name):
        raise ChildProcessError

    monkeypatch.setattr(PythonScript, "execute_script", start_interpreter)
    snakemake_internals.replace_script_runner(refuse)
    PythonScript.execute_script(SimpleNamespace(), "script.py")
    assert started == [("script.py", False)]


def test_snakemake_calls_a_script_runner_with_the_arguments_of_ours(monkeypatch):
    expected = inspect.signature(PythonScript.execute_script)
    monkeypatch.setattr(PythonScript, "execute_script", PythonScript.execute_script)
    snakemake_internals.replace_script_runner(lambda name: None)
    replacement = inspect.signature(PythonScript.execute_script)
    assert len(replacement.parameters) == len(expected.parameters)
    assert replacement.parameters["edit"].default is expected.parameters["edit"].default


def test_a_checksum_is_computed_once_while_the_file_stays_as_it_is(
    monkeypatch, tmp_path
):
    computed = []

    async def checksum(file, threshold, *, force=False):
        computed.append(str(file))
        return file.read_text()

    assert inspect.iscoroutinefunction(_IOFile.checksum)
    monkeypatch.setattr(_IOFile, "checksum", checksum)
    snakemake_internals.remember_checksums()
    file = tmp_path / "file"
    file.write_text("old")
    assert asyncio.run(_IOFile.checksum(file, 10, force=True)) == "old"
    assert asyncio.run(_IOFile.checksum(file, 10, force=True)) == "old"
    assert len(computed) == 1
    file.write_text("longer")
    assert asyncio.run(_IOFile.checksum(file, 10, force=True)) == "longer"


def test_a_script_is_checked_for_the_first_job_of_a_rule(monkeypatch):
    checked = []
    monkeypatch.setattr(
        ScriptProcessor, "process_job", lambda processor, job: checked.append(job)
    )
    snakemake_internals.check_scripts_once()
    fixed = SimpleNamespace(name="fixed", script="make_table.py")
    named = SimpleNamespace(name="named", script="make_{name}.py")
    jobs = [SimpleNamespace(rule=rule) for rule in (fixed, fixed, named, named)]
    processor = ScriptProcessor.__new__(ScriptProcessor)
    for job in jobs:
        processor.process_job(job)
    assert checked == [jobs[0], jobs[2], jobs[3]]


@pytest.mark.parametrize(
    ("settings", "is_printed"),
    [
        ({"log_handler_settings": {"ours": None}}, False),
        ({"log_handler_settings": {"ours": None}, "printshellcmds": True}, True),
        ({"log_handler_settings": {"ours": None}, "verbose": True}, True),
        ({"log_handler_settings": {}}, True),
    ],
)
def test_a_dry_run_formats_the_messages_that_its_logger_prints(
    monkeypatch, settings, is_printed
):
    monkeypatch.setattr(DryRunExecutor, "printjob", print_job := lambda *_: None)
    workflow = SimpleNamespace(output_settings=OutputSettings(**settings))
    snakemake_internals.skip_unprinted_messages(workflow, "ours")
    assert (DryRunExecutor.printjob is print_job) == is_printed


def test_scripts_and_messages_are_handled_where_we_replace_them():
    assert "script_type" in inspect.getsource(ScriptProcessor.process_job)
    assert "log_info" in inspect.getsource(AbstractExecutor.printjob)


@pytest.mark.parametrize(
    ("limit", "limiter"), [("100/1s", None), ("99/1s", "limiter"), (None, "limiter")]
)
def test_only_an_unreachable_limit_of_job_starts_is_lifted(limit, limiter):
    parsed = limit and MaxJobsPerTimespan.parse_choice(limit)
    settings = SchedulingSettings(max_jobs_per_timespan=parsed)
    workflow = SimpleNamespace(
        scheduling_settings=settings,
        scheduler=SimpleNamespace(job_rate_limiter="limiter"),
    )
    snakemake_internals.lift_rate_limit(workflow)
    assert workflow.scheduler.job_rate_limiter == limiter


def test_the_scheduler_has_the_rate_limiter_that_we_remove():
    from snakemake.scheduling.job_scheduler import JobScheduler

    assert "job_rate_limiter" in inspect.getsource(JobScheduler)


def test_a_rule_that_only_collects_files_runs_no_job(workflow):
    runs_none = {
        rule.name for rule in workflow.rules if snakemake_internals.runs_no_job(rule)
    }
    assert runs_none == {"all_tables"}


def test_a_rule_without_log_and_benchmark_gets_ours_and_keeps_its_own(workflow):
    for name in ("make_table", "draw_table"):
        rule = named(workflow, name)
        snakemake_internals.set_log_and_benchmark(rule, "{name}.log", "{name}.tsv")
        rule.set_params(sources=("a.py",))
    assert list(named(workflow, "make_table").log) == ["{name}.log"]
    assert list(named(workflow, "draw_table").log) == ["logs/{name}.log"]
    assert str(named(workflow, "make_table").benchmark) == "{name}.tsv"


def test_the_rule_that_makes_a_file_is_found_with_its_inputs_and_outputs(workflow):
    rule = snakemake_internals.find_producer(workflow.rules, "drawn/first.pdf")
    assert rule.name == "draw_table"
    files = snakemake_internals.expand_files(rule, "drawn/first.pdf")
    assert files == (["made/first.csv"], ["drawn/first.pdf"])
    assert snakemake_internals.find_producer(workflow.rules, "other/file") is None


def test_the_script_of_a_rule_is_known_by_its_file_name(workflow):
    rule = named(workflow, "make_table")
    assert rule.is_script
    assert snakemake_internals.name_of_script(rule) == "make_table.py"


def test_the_command_line_of_a_run_is_known(workflow):
    assert snakemake_internals.config_arguments(workflow) == ["seed=2"]
    assert snakemake_internals.config_files(workflow) == []
