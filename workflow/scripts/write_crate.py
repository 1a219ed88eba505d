"""A finished run as a Workflow Run RO-Crate, with its configuration, its software and a data package of its tables."""

import platform
from dataclasses import asdict
from importlib.metadata import metadata

from job import Job, origin_of, run

import pandas as pd

from elastocal.crate.data_package import data_package
from elastocal.crate.run_crate import FinishedRun, run_crate
from elastocal.crate.software import installed_packages
from elastocal.io.atomic_writes import write_text
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import write_json
from elastocal.io.origin import canonical_json
from elastocal.io.records import jobs_behind


def write_crate(job: Job) -> None:
    jobs, packages = jobs_behind(job.input.files), installed_packages()
    about = metadata("elastocal")
    write_text(job.output.configuration, canonical_json(job.params.configuration))
    write_csv(job.output.software, pd.DataFrame([asdict(package) | {"url": package.url} for package in packages]))
    write_json(job.output.tables, data_package(jobs, "reports", about["License-Expression"]))
    finished = FinishedRun(
        jobs=jobs,
        origin=origin_of(job),
        workflow=job.input.workflow,
        rules=job.input.rules,
        configuration=job.output.configuration,
        software_list=job.output.software,
        packages=packages,
        python=platform.python_version(),
        others=[job.output.tables],
    )
    words = {
        "name": "A run of elastocal",
        "description": f"{about['Summary']}. {origin_of(job).words}.",
        "author": about["Author"],
        "licence": about["License-Expression"],
    }
    write_json(job.output.crate, run_crate(finished, words))


run(write_crate, snakemake)
