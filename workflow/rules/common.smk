"""What all rules share: the checked configuration, the names in paths, and the sources of each script."""

import gc
import hashlib
import re
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import elastocal
from elastocal.campaigns.campaign_folder import check_workflow_path
from elastocal.campaigns.importers import (
    read_campaign_sources,
    find_importer,
    find_user_campaign,
    list_league_data,
)
from elastocal.errors import InputError
from elastocal.io.origin import (
    SOURCE_FILES,
    SOURCES_DIGEST,
    Origin,
    digest_configuration,
    list_versions,
)
from elastocal.io.records import compute_sha256
from elastocal.report.outcome import describe_outcome
from elastocal.study.configuration import check_study, count_components, override_entries

from commit import commit_of
from import_closure import closure
from one_run import begin
from warm_start import start_server

# In a checkout the package stands beside the rules; a wheel puts them apart.
PACKAGES = ROOT / "src" if (ROOT / "src").is_dir() else Path(elastocal.__file__).parents[1]


@cache
def placed(file):
    """Return the name that rules use for a file of the workflow or the package.

    Inside the working directory it is relative, so that a checkout may move.
    """
    if file.is_relative_to(Path.cwd()):
        file = file.relative_to(Path.cwd())
    return file.as_posix()


CONFIG = placed(ROOT / "config")
# Measured data that come with the project.
INCLUDED_DATA = placed(ROOT / "data" / "measured")


def shown(file, caption, category, **labels):
    """Mark an output for `snakemake --report`, with a caption from workflow/report."""
    return report(
        file,
        caption=str(ROOT / "workflow" / "report" / f"{caption}.rst"),
        category=category,
        labels=labels,
    )


# Categories of the report.
PAPER = "Tables and figures of the paper"
QUESTIONS_BEYOND = "Questions beyond the paper"


def shown_table(file, caption, category, shows):
    return shown(file, caption, category, shows=shows, kind="table")


def shown_figure(file, caption, category, shows):
    return shown(file, caption, category, shows=shows, kind="figure")


# The modules imported so far stay until the end. Without this line, garbage collection searches them again and again while Snakemake
# plans the jobs, which took a fifth of a rerun that had nothing to do.
gc.freeze()

# Work that Snakemake would do for each job again, or for nothing.
snakemake_internals.check_scripts_once()
snakemake_internals.skip_unprinted_messages(workflow, "elastocal")

# Entries of --config. They are read again here, because Snakemake reads numbers inside a mapping as text.
ENTRIES = [entry.partition("=") for entry in snakemake_internals.config_arguments(workflow)]
CHANGES = ["".join(entry) for entry in ENTRIES if entry[0] != "campaign"]

# The audit makes files again as of the commit that their records state.
GIVEN_ORIGIN = config.pop("origin", None)

try:
    # Snakemake removes quotes and blanks at the ends of a value, so that a neighbouring folder would be diagnosed.
    for name, _, value in ENTRIES:
        if name == "campaign":
            check_workflow_path(value)
    config.update(override_entries(config, CHANGES))
    STUDY = check_study(
        config,
        CONFIG,
        " with --config ".join(["config.yaml", *(entry.partition("=")[0] for entry in CHANGES)]),
    )
    SOURCES = read_campaign_sources(config, CONFIG)
    # The user's own campaign by its name, if one is given.
    OWN = find_user_campaign(config, f"{CONFIG}/robots", "results/loop")
    if snakemake_internals.is_starting_run(workflow):
        RUN = begin(Path(".snakemake"), ["data", "results", "reports"])
except InputError as error:
    sys.exit(str(error))

# Everything that the results depend on, except code and measured data. The choice of a user's campaign is left out: it changes no result.
RESOLVED = {
    "config": {key: value for key, value in config.items() if key not in ("campaign", "origin")},
    "robots": STUDY.robots,
    "strategies": STUDY.strategies,
    "campaigns": SOURCES,
}
# Scripts find the origin in the configuration, whose changes alone rerun nothing: a new commit does not draw a figure again.
ORIGIN = Origin(
    commit_of(
        ROOT,
        [
            "Snakefile",
            "config.yaml",
            "config",
            "profiles",
            "src",
            "workflow",
            "requirements/run.lock",
        ],
    ),
    digest_configuration(RESOLVED),
    config["seed"],
)
config["origin"] = GIVEN_ORIGIN or vars(ORIGIN)

NOISE = [f"{level:g}" for level in config["noise_um"]]
TABLE_NOISE = f"{config['tables']['noise_um']:g}"
CLASSICAL = config["tables"]["classical_strategy"]
INTERPRETATIONS = config["interpretations"]
LOADING = config["loading"] | {key: INTERPRETATIONS[key] for key in ("offset_frame", "joint_range")}
STUDY_SIZE = {
    "data_sets": config["data_sets"],
    "configurations": config["configurations"],
    "tests": config["test_configurations"],
    "noise": 1e-6 * config["tables"]["noise_um"],
}
# Keys of config.yaml on which the files of study, loop and league depend, and so their audit.
AUDITED_KEYS = [
    "seed",
    "robots",
    "strategies",
    "noise_um",
    "data_sets",
    "configurations",
    "test_configurations",
    "loading",
    "interpretations",
    "evaluation",
    "tables",
    "questions",
    "loop",
    "league",
]
# Names of files that jobs make.
MADE_FILE = re.compile("(data|results|reports)/")
NAMES = {name: document["name"] for name, document in STUDY.strategies.items()}
# Robots with and without elastic links.
EXTENDED = [name for name in config["robots"] if "links" in STUDY.robots[name]]
REDUCED = [name for name in config["robots"] if name not in EXTENDED]


wildcard_constraints:
    robot="[^/]+",
    strategy="[^/]+",
    noise=r"[\d.e-]+",
    campaign="[^/]+",
    block="[^/]+",
    test="(/test)?",


def panel_settings(robot, **limit):
    """Settings of one panel of Figure 5: its robot, the order of the strategies, and the limit that it shows."""
    return {"title": TITLES[robot], "robot": robot, "order": list(NAMES.values())} | limit


def sources(step):
    """Return the script that runs a step, and the package modules that it imports.

    `step` is a script, or a function of the packages that `run_step.py` calls.
    """
    if step.endswith(".py"):
        script, modules = step, []
    else:
        script, modules = "run_step.py", [step.rpartition(".")[0]]
    path = ROOT / "workflow" / "scripts" / script
    try:
        files = [path, *closure(path, PACKAGES, *modules)]
    except InputError as error:
        sys.exit(str(error))
    return tuple(map(placed, files))


checksum_once = cache(compute_sha256)


def digest_of(files):
    """Return one digest of the contents of several files."""
    return hashlib.sha256(" ".join(map(checksum_once, files)).encode()).hexdigest()[:16]


def complete_rules():
    """Give each rule a log and a benchmark named after it and its wildcards, and each script its sources.

    The sources are a parameter, which all jobs of a rule share. Snakemake looks up each input of each job anew, so as inputs they took
    half of the time and of the memory in which it lays out the jobs.
    """
    for definition in workflow.rules:
        if snakemake_internals.runs_no_job(definition):
            continue
        wildcards = [f"{{{name}}}" for name in re.findall(r"{(\w+)", definition.output[0])]
        name = Path(definition.name, *wildcards).as_posix()
        snakemake_internals.set_log_and_benchmark(
            definition, f"results/logs/{name}.log", f"results/timings/{name}.tsv"
        )
        if definition.is_script:
            step = definition.params.get("step") or snakemake_internals.name_of_script(definition)
            definition.set_params(**{SOURCE_FILES: sources(step)})


def watch_sources():
    """Let an edit of a source rerun the jobs that depend on it, and no others, whatever the date of the file.

    A change of the installed libraries or of the list of pins reruns every job that has a script.
    """
    environment_sha256 = digest_configuration(list_versions(ROOT))
    for definition in workflow.rules:
        if not definition.is_script:
            continue
        files = [
            file
            for file in definition.input
            if isinstance(file, str) and not MADE_FILE.match(file) and Path(file).is_file()
        ]
        digest = digest_of([*files, *definition.params.get(SOURCE_FILES)])
        definition.set_params(**{SOURCES_DIGEST: f"{digest} {environment_sha256}"})


def files_behind(targets):
    """Return all files that the jobs behind some targets make.

    As targets of their own they are made again if somebody deletes one, although later files exist.
    """
    files = set()
    pending = [target for target in targets if isinstance(target, str)]
    while pending:
        path = pending.pop()
        if path in files or not MADE_FILE.match(path):
            continue
        producer = snakemake_internals.find_producer(workflow.rules, path)
        if producer is None:
            # The file is a user's own, kept in a folder of the pipeline.
            continue
        inputs, outputs = snakemake_internals.expand_files(producer, path)
        files.update(outputs)
        pending += inputs
    return sorted(files)


def robot_document(wildcards):
    return STUDY.robots[wildcards.robot]


def strategy_document(wildcards):
    return STUDY.strategies[wildcards.strategy]


def study_in_memory(interpretations=INTERPRETATIONS, robot=robot_document, **size):
    """Return what a step draws the data sets of a robot from: robot, seed, interpretation of the paper, and size of the study."""
    interpretation = {
        "wrench_at": interpretations["wrench_at"],
        "average": interpretations["average"],
        "rows": count_components(interpretations["measured"]),
    }
    loading = config["loading"] | {
        key: interpretations[key] for key in ("offset_frame", "joint_range")
    }
    return lambda wildcards: {
        "robot": robot(wildcards),
        "seed": config["seed"],
        "tool_offset_m": interpretations["tool_offset_m"],
        "loading": loading,
        "interpretation": interpretation,
        "size": STUDY_SIZE | size,
    }


ALTERNATIVES = config["evaluation"]["alternatives"]
# Robots that the alternative to an interpretation changes.
ALTERNATIVE_ROBOTS = {number: REDUCED for number in ALTERNATIVES["interpretations"]}
ALTERNATIVE_ROBOTS |= {
    number: [robot for robot in REDUCED if robot in robots]
    for number, robots in ALTERNATIVES["lengths_m"].items()
    if {*robots} & {*REDUCED}
}


def robot_of_alternative(wildcards):
    """Return the document of a robot with the lengths of the alternative to an interpretation."""
    document = robot_document(wildcards)
    lengths_m = ALTERNATIVES["lengths_m"].get(wildcards.number, {}).get(wildcards.robot)
    # A chain may state its lengths itself.
    if lengths_m is None:
        return document
    return document | {"lengths_m": document["lengths_m"] | lengths_m}


def alternative_study(wildcards):
    """Return the study of a robot under the alternative to an interpretation."""
    changes = ALTERNATIVES["interpretations"].get(wildcards.number, {})
    return study_in_memory(INTERPRETATIONS | changes, robot_of_alternative)(wildcards)


def alternative_files(kind):
    return [
        f"results/alternatives/{number}/{kind}/{robot}.parquet"
        for number, robots in ALTERNATIVE_ROBOTS.items()
        for robot in robots
    ]


def cells(kind, robots, noise, strategies=config["strategies"]):
    """Return the results of one kind for robots, noise levels and strategies."""
    return expand(
        f"results/{kind}/{{robot}}/{{noise}}um/{{strategy}}.parquet",
        robot=robots,
        noise=noise,
        strategy=strategies,
    )


def all_cells(robots):
    return {kind: cells(kind, robots, TABLE_NOISE) for kind in ("metrics", "replicates")}


def folder_of(campaign):
    return OWN[campaign].path.as_posix() if campaign in OWN else f"data/campaigns/{campaign}"


def files_of(wildcards):
    return files_of_campaign(wildcards.campaign)


def files_of_campaign(campaign):
    """Return the files that a campaign is read from, including those of the campaign that tests it."""
    if campaign in OWN:
        return OWN[campaign].files()
    source = SOURCES[campaign]
    # The campaign that tests this one is read too, and the one that tests it in turn. Two campaigns may test each other.
    names = []
    name = campaign
    while name and name not in names:
        names.append(name)
        test = SOURCES[name].get("holdout", {}).get("campaign")
        name = Path(test).name if test else None
    files = expand(
        "data/campaigns/{name}/{file}", name=names, file=["campaign.yaml", "measurements.parquet"]
    )
    # The robots of an import are among its inputs. A simulation does not read the robot that its campaign declares.
    declared = [source["declared_robot"]] if source["source"] == "simulated" else []
    return files + expand(f"{CONFIG}/robots/{{robot}}.yaml", robot=declared)


def included_folder(wildcards):
    """Return the folder of a campaign that comes with the project."""
    return f"{INCLUDED_DATA}/{SOURCES[wildcards.campaign]['folder']}"


def robots_of_import(wildcards):
    """Return the files of the robots that an importer reads or names."""
    source = find_importer(
        SOURCES[wildcards.campaign]["importer"], CONFIG, f"campaign {wildcards.campaign}"
    )
    return expand(f"{CONFIG}/robots/{{robot}}.yaml", robot=source.robots)


def loop_reports(campaigns):
    return expand("reports/loop/{campaign}/{file}", campaign=campaigns, file=LOOP_REPORTS)


def reports_of_own(wildcards):
    if not OWN:
        sys.exit(
            "diagnose: found no campaign; allowed: snakemake -j2 diagnose --config campaign=FOLDER"
        )
    return files_behind(loop_reports(OWN))


def folds_of_one(campaigns):
    """Group the campaigns that hold out the folds of the same measurements by their importer."""
    folds = {}
    for name in campaigns:
        if "fold" in SOURCES[name]:
            folds.setdefault(SOURCES[name]["importer"], []).append(name)
    return folds


def audited(wildcards):
    """Return the files to audit.

    Snakemake asks for them before the first job, so a missing library is reported before anybody has waited for results.
    """
    if find_spec("pinocchio") is None:
        sys.exit(
            str(
                InputError(
                    "audit",
                    "pinocchio",
                    "no such package",
                    "the extra audit: make audit, or pip install pin",
                )
            )
        )
    return files_behind(rules.all.input)


# Targets that are audited too if they have finished, with the last file of each.
AUDITED_TOO = {
    "study": "reports/study.pdf",
    "loop": "reports/loop/campaigns.csv",
    "measured": "reports/loop/measured.csv",
    "cameras": "reports/loop/cameras.csv",
    "league": "reports/league/all/league.csv",
    "league_small": "reports/league/small/league.csv",
    "blind": "reports/blind/summary.csv",
    "closed_loop": "reports/closed_loop/goals.csv",
}


def digest_others(wildcards):
    """Return a digest of each target, so that the audit runs again after another one has finished; it does not start one."""
    return {
        target: compute_sha256(file) if Path(file).is_file() else ""
        for target, file in AUDITED_TOO.items()
    }


# Campaigns that are diagnosed in seconds. Those of `measured` take minutes.
AUDITED_CAMPAIGNS = list(dict.fromkeys([*config["loop"]["main"], *config["loop"]["campaigns"]]))


def evidence_of_finished(wildcards):
    """Return the evidence of each campaign that is finished: the audit diagnoses it once more, but begins no other."""
    return [
        f"results/evidence/{campaign}.json"
        for campaign in AUDITED_CAMPAIGNS
        if campaign in config["loop"]["main"]
        or Path(f"reports/loop/{campaign}/verdict.json").is_file()
    ]
