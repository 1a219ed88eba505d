"""A finished run as a Workflow Run RO-Crate, profile Provenance Run Crate: who reads it needs no code of ours.

The folder with the results is the crate: nothing is copied, and each file has its size and SHA-256. Every job is an action with
script, inputs, outputs, start and end; each rule a step of the workflow. Names of users and machines and absolute paths are not
in it.

[1] Soiland-Reyes et al., Packaging research artefacts with RO-Crate, Data Science 5, 2022.
[2] Leo et al., Recording provenance of workflow runs with RO-Crate, PLOS ONE 19, 2024.
"""

from __future__ import annotations

import mimetypes
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from rocrate.model.contextentity import ContextEntity
from rocrate.rocrate import ROCrate

from elastocal.counting import counted
from elastocal.errors import InputError
from elastocal.io.records import checksum, files_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rocrate.model.entity import Entity

    from elastocal.crate.software import Package
    from elastocal.io.origin import Origin
    from elastocal.io.records import JobRecord

_VERSION = "1.1"
_PROFILES = {key: f"{key.title()} Run Crate" for key in ("process", "workflow", "provenance")}
_PROFILE_VERSION = "0.5"
_CODE = {"@type": ["File", "SoftwareSourceCode"]}
_COMPLETED = "http://schema.org/CompletedActionStatus"
# What the context of RO-Crate 1.1 does not have.
_TERMS = {"sha256": "http://schema.org/sha256"}
_MEDIA_TYPES = {".parquet": "application/vnd.apache.parquet", ".typ": "text/plain", ".smk": "text/plain", ".yaml": "text/yaml"}


@dataclass(frozen=True)
class FinishedRun:
    """What is known of a run.

    `jobs`: in the order in which they began. `origin`: of the sources as they are now; each job has its own. `workflow`: the
    Snakefile. `rules`: files that the workflow includes. `configuration`: file with the resolved configuration, whose SHA-256
    is the configuration's. `software_list`: file with the packages. `python`: version. `others`: further files that describe
    the run.
    """

    jobs: Sequence[JobRecord]
    origin: Origin
    workflow: str
    rules: Sequence[str]
    configuration: str
    software_list: str
    packages: Sequence[Package]
    python: str
    others: Sequence[str] = ()

    @property
    def snakemake(self) -> str | None:
        """Its version."""
        return next((package.version for package in self.packages if package.name == "snakemake"), None)


def run_crate(run: FinishedRun, words: Mapping[str, str]) -> dict[str, Any]:
    """The contents of ro-crate-metadata.json.

    `run`: files by their names in the working directory, which is the crate. `words`: ``name``, ``description``, ``author``,
    ``licence`` (SPDX) of the crate. Returns JSON-LD. Raises `InputError`: no job at all, or a file outside of the crate.
    """
    if not run.jobs:
        raise InputError(run.workflow, "", "no record of any job", "a finished run")
    crate = ROCrate(version=_VERSION)
    crate.metadata.extra_terms.update(_TERMS)
    _describe(crate, run, words)
    scripts = {job.rule: _script(job) for job in run.jobs}
    inputs = _outside_inputs(run.jobs)
    folders = [file for job in run.jobs for file in job.outputs if Path(file).is_dir()]
    made = [file for job in run.jobs for each in job.outputs for file in files_of(each)]
    modules = {file for job in run.jobs for file in _sources(job)} - set(scripts.values())
    for file in sorted({*made, *inputs, *modules, run.configuration, run.software_list, *run.others}):
        crate.add_file(_inside(file), file, properties=_facts(file))
    for folder in sorted(folders):
        # A crate's writer would look for what it holds once more.
        files = [_file(file) for file in files_of(folder)]
        crate.add_directory(dest_path=_inside(folder), properties={"name": Path(folder).name, "hasPart": files})
    for file in run.rules:
        crate.add_file(_inside(file), file, properties=_facts(file) | _CODE)
    for rule, file in sorted(scripts.items()):
        required = sorted({source for job in run.jobs if job.rule == rule for source in _sources(job)} - {file})
        crate.add_file(_inside(file), file, properties=_facts(file) | _tool(rule, run.origin, required))
    workflow = _workflow(crate, run, scripts)
    actions = [_job_action(crate, job, number) for number, job in enumerate(run.jobs, 1)]
    run_action = _run_action(crate, run, workflow, [run.configuration, *inputs], _final(run.jobs))
    _orchestration(crate, run, actions, run_action)
    crate.root_dataset["mentions"] = [run_action, *actions]
    document: dict[str, Any] = crate.metadata.generate()
    return document


def _describe(crate: ROCrate, run: FinishedRun, words: Mapping[str, str]) -> None:
    root = crate.root_dataset
    commits = sorted({job.origin.commit for job in run.jobs})
    root["name"], root["description"] = words["name"], f"{words['description']} Jobs ran at: {', '.join(commits)}."
    root["datePublished"] = max(job.ended for job in run.jobs)
    identifier = f"https://spdx.org/licenses/{words['licence']}"
    root["license"] = _add(crate, identifier, "CreativeWork", name=words["licence"], identifier=identifier)
    root["author"] = _add(crate, "#authors", "Organization", name=words["author"])
    profiles = [
        _add(crate, f"https://w3id.org/ro/wfrun/{key}/{_PROFILE_VERSION}", "CreativeWork", name=name, version=_PROFILE_VERSION)
        for key, name in _PROFILES.items()
    ]
    workflow_profile = "https://w3id.org/workflowhub/workflow-ro-crate/1.0"
    root["conformsTo"] = [*profiles, _add(crate, workflow_profile, "CreativeWork", name="Workflow RO-Crate", version="1.0")]
    # Names of users are not recorded, so that a crate can be given away.
    _add(crate, "#operator", "Person", name="the person who ran the workflow (not recorded)")


def _workflow(crate: ROCrate, run: FinishedRun, scripts: Mapping[str, str]) -> Entity:
    home = "https://www.python.org/"
    python = _add(crate, home, "SoftwareApplication", name="Python", version=run.python, url=home)
    packages = [_add(crate, package.url, "SoftwareApplication", **_package_facts(package)) for package in run.packages]
    steps = [
        _add(crate, f"{run.workflow}#{rule}", "HowToStep", name=rule, position=str(number), workExample=_file(script))
        for number, (rule, script) in enumerate(scripts.items(), 1)
    ]
    parameters = {
        "input": ("#parameter-configuration", "configuration", run.configuration),
        "output": ("#parameter-result", "result", _final(run.jobs)[0]),
    }
    for identifier, name, file in parameters.values():
        _add(crate, identifier, "FormalParameter", additionalType="File", name=name, workExample=_file(file))
        crate.get(quote(file))["exampleOfWork"] = _reference(identifier)
    facts = _facts(run.workflow) | {"@type": ["File", "SoftwareSourceCode", "ComputationalWorkflow", "HowTo"]}
    place, language = _inside(run.workflow), {"lang": "snakemake", "lang_version": run.snakemake}
    workflow = crate.add_workflow(place, run.workflow, main=True, properties=facts, **language)
    workflow["version"] = run.origin.commit
    workflow["step"] = steps
    workflow["hasPart"] = [_file(file) for file in sorted(scripts.values())]
    workflow["softwareRequirements"] = [python, *packages]
    for key, (identifier, _, _) in parameters.items():
        workflow[key] = _reference(identifier)
    return workflow


def _job_action(crate: ROCrate, job: JobRecord, number: int) -> Entity:
    facts = {"name": job.name, "description": f"{job.rule}; {job.origin.words}", "startTime": job.started, "endTime": job.ended}
    data = [file for file in job.inputs if not file.endswith(".py")]
    return _action(crate, f"#job-{number}", facts, _file(_script(job)), data, job.outputs)


def _run_action(crate: ROCrate, run: FinishedRun, workflow: Entity, read: Sequence[str], written: Sequence[str]) -> Entity:
    facts = {
        "name": "run of the workflow",
        "description": f"{counted(len(run.jobs), 'job')}; {run.origin.words}",
        "startTime": min(job.started for job in run.jobs),
        "endTime": max(job.ended for job in run.jobs),
    }
    return _action(crate, "#run", facts, workflow, read, written)


def _action(
    crate: ROCrate, identifier: str, facts: Mapping[str, str], tool: Any, read: Iterable[str], written: Iterable[str]
) -> Entity:
    how = {"agent": _reference("#operator"), "actionStatus": _COMPLETED, "instrument": tool}
    files = {"object": [_file(file) for file in read], "result": [_file(file) for file in written]}
    return _add(crate, identifier, "CreateAction", **facts, **how, **files)


def _orchestration(crate: ROCrate, run: FinishedRun, actions: Sequence[Entity], run_action: Entity) -> None:
    """Each rule's step and its jobs, and the engine that called them."""
    home, version = "https://snakemake.github.io/", run.snakemake or "unknown"
    engine = _add(crate, f"{home}#engine", "SoftwareApplication", name="Snakemake", version=version, url=home)
    by_rule: dict[str, list[Entity]] = {}
    for job, action in zip(run.jobs, actions, strict=True):
        by_rule.setdefault(job.rule, []).append(action)
    controls = []
    for rule, of_rule in by_rule.items():
        step = _reference(f"{run.workflow}#{rule}")
        name = f"orchestration of {rule}"
        controls.append(_add(crate, f"#control-{rule}", "ControlAction", name=name, instrument=step, object=of_rule))
    facts = {"name": "run of Snakemake", "startTime": run_action["startTime"], "endTime": run_action["endTime"]}
    how = {"agent": _reference("#operator"), "instrument": engine, "object": controls, "result": run_action}
    _add(crate, "#orchestration", "OrganizeAction", **facts, **how)


def _final(jobs: Sequence[JobRecord]) -> list[str]:
    """Files that no job reads."""
    read = {file for job in jobs for file in job.inputs}
    return [file for job in jobs for file in job.outputs if file not in read]


def _outside_inputs(jobs: Sequence[JobRecord]) -> list[str]:
    """Files that jobs read and none made, but for code."""
    made = {file for job in jobs for file in job.outputs}
    return sorted({file for job in jobs for file in job.inputs if not file.endswith(".py")} - made)


def _sources(job: JobRecord) -> list[str]:
    return [file for file in job.inputs if file.endswith(".py")]


def _script(job: JobRecord) -> str:
    """Rules name their script first of all sources."""
    return _sources(job)[0]


def _tool(rule: str, origin: Origin, required: Sequence[str]) -> dict[str, Any]:
    return {**_CODE, "name": rule, "version": origin.commit, "softwareRequirements": [_file(file) for file in required]}


def _facts(file: str) -> dict[str, Any]:
    path = Path(file)
    kind = _MEDIA_TYPES.get(path.suffix) or mimetypes.guess_type(file)[0] or "text/plain"
    return {"name": path.name, "sha256": checksum(file), "contentSize": str(path.stat().st_size), "encodingFormat": kind}


def _inside(file: str) -> str:
    if Path(file).is_absolute() or ".." in Path(file).parts:
        raise InputError(file, "", "a file outside of the folder of the results", "a file in it, to which a crate can refer")
    return file


def _package_facts(package: Package) -> dict[str, str]:
    facts = {"name": package.name, "version": package.version, "identifier": package.url, "url": package.url}
    return facts | ({"license": package.licence} if package.licence else {})


def _add(crate: ROCrate, id_: str, kind: str, /, **properties: Any) -> Entity:
    entity = crate.add(ContextEntity(crate, id_, properties={"@type": kind}))
    for key, value in properties.items():
        # Which makes references of entities.
        entity[key] = value
    return entity


def _reference(identifier: str) -> dict[str, str]:
    return {"@id": identifier}


def _file(name: str) -> dict[str, str]:
    """A reference to a file or folder; a crate has their names as URIs have them, a folder's with a stroke behind it."""
    return _reference(quote(name) + ("/" if Path(name).is_dir() else ""))
