"""Check a finished run by independent calculations: a table of checks, and a page."""

from pathlib import Path

from job import Job, origin_of, run

from elastocal import __version__
from elastocal.io.atomic_writes import write_text
from elastocal.io.data_frames import write_csv
from elastocal_proof.audit.audit_run import audit_run, render_page, tabulate_findings
from elastocal_proof.audit.finished_run import FinishedRun


def audit_files(job: Job) -> None:
    settings = job.params
    finished = FinishedRun(
        Path(),
        settings.configuration,
        settings.robots,
        settings.strategies,
        settings.rows,
    )
    table = tabulate_findings(audit_run(finished))
    finished_targets = [target for target, digest in settings.others.items() if digest]
    absent_targets = [
        target for target in settings.others if target not in finished_targets
    ]
    facts = {
        "Seed of the random numbers": str(finished.seed),
        "Rows sampled of a large file": str(settings.rows),
        "Other targets audited": ", ".join(finished_targets) or "none has finished",
        "Absent, so not audited": ", ".join(absent_targets) or "none",
        "Version of elastocal": __version__,
        "Origin": origin_of(job).words,
    }
    write_text(job.output.page, render_page(table, facts))
    write_csv(job.output.table, table)


# The audit reports altered files; a job that checks its inputs would refuse them.
run(audit_files, snakemake, check_inputs=False)
