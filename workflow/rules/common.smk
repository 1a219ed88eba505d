"""What all rules share: the checked configuration, the names that paths are made of, and the sources behind each script."""

import gc
import hashlib
import os
import re
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import elastocal
from snakemake.io import _IOFile
from snakemake.iocontainers import Wildcards

from elastocal.campaigns.importers import (
    find_importer,
    find_user_campaign,
    list_league_data,
    read_campaign_sources,
)
from elastocal.errors import InputError
from elastocal.io.origin import SOURCES_DIGEST, Origin, configuration_sha256, environment
from elastocal.io.records import compute_sha256
from elastocal.report.outcome import outcome
from elastocal.study.configuration import check_study, count_components, override_entries

ROOT = Path(workflow.basedir)
sys.path.insert(0, str(ROOT / "workflow" / "rules"))

from commit import commit_of
from import_closure import closure
from one_run import begin
from warm_start import start_warm

# In a checkout the package stands beside the rules; a wheel puts them apart.
PACKAGES = ROOT / "src" if (ROOT / "src").is_dir() else Path(elastocal.__file__).parents[1]


@cache
def placed(file):
    """A file of the workflow or the package by the name that rules have for it: in a checkout, which may move, without the folders above."""
    return (file.relative_to(Path.cwd()) if file.is_relative_to(Path.cwd()) else file).as_posix()


CONFIG = placed(ROOT / "config")
# Measured data that come with the project.
BOX = placed(ROOT / "data" / "measured")


def shown(file, caption, category, **labels):
    """An output that `snakemake --report` shows; its caption is a page of workflow/report."""
    return report(
        file,
        caption=str(ROOT / "workflow" / "report" / f"{caption}.rst"),
        category=category,
        labels=labels,
    )


# Categories of the report.
PAPER, ABOUT = "Tables and figures of the paper", "Questions beyond the paper"


def table_of(name, category, caption=None, shows=None):
    """A table for people, shown where it has a caption."""
    file = f"reports/tables/{name}.csv"
    return shown(file, caption, category, shows=shows, kind="table") if caption else file


# Tables of the study: of each rule the module of its step, inputs, outputs and parameters; tables.smk makes the rules.
STUDY_TABLES = {}
REFERENCE = {"reference": f"{CONFIG}/paper/reference.csv"}

# What Snakemake and we have imported by now stays to the end; to look through it for garbage, again and again while the jobs are
# laid out, took a fifth of a rerun with nothing to do.
gc.freeze()

# What --config says; Snakemake takes numbers inside of a mapping for texts.
CHANGES = [
    entry
    for entry in workflow.config_settings.config_args or ()
    if not entry.startswith("campaign=")
]

try:
    config.update(override_entries(config, CHANGES))
    STUDY = check_study(
        config,
        CONFIG,
        " with --config ".join(["config.yaml", *(entry.partition("=")[0] for entry in CHANGES)]),
    )
    SOURCES = read_campaign_sources(config, CONFIG)
    # The user's own campaign by its name, if there is one.
    OWN = find_user_campaign(config, f"{CONFIG}/robots", "results/loop")
    # Not of the jobs of this run, and not where nothing is written.
    if workflow.is_main_process and not workflow.dryrun:
        RUN = begin(Path(".snakemake"), ["data", "results", "reports"])
except InputError as error:
    sys.exit(str(error))

# All that decides what the results hold, but for code and measured data; which campaign of a user is asked for decides nothing.
RESOLVED = {
    "config": {key: value for key, value in config.items() if key not in ("campaign", "origin")},
    "robots": STUDY.robots,
    "strategies": STUDY.strategies,
    "campaigns": SOURCES,
}
# Scripts find it in the configuration, an edit of which reruns nothing by itself: a new commit makes no figure anew.
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
    configuration_sha256(RESOLVED),
    config["seed"],
)
config["origin"] = vars(ORIGIN)

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
# Keys of config.yaml that the files of study, loop and league depend on, and so their audit.
AUDITED = [
    *(
        "seed",
        "robots",
        "strategies",
        "noise_um",
        "data_sets",
        "configurations",
        "test_configurations",
        "loading",
    ),
    *("interpretations", "evaluation", "tables", "questions", "loop", "league"),
]
# Files that jobs make.
MADE = re.compile("(data|results|reports)/")
NAMES = {name: document["name"] for name, document in STUDY.strategies.items()}
EXTENDED = [name for name in config["robots"] if "links" in STUDY.robots[name]]
REDUCED = [name for name in config["robots"] if name not in EXTENDED]


wildcard_constraints:
    robot="[^/]+",
    strategy="[^/]+",
    noise=r"[\d.e-]+",
    campaign="[^/]+",
    block="[^/]+",
    test="(/test)?",


def draw_panel(panels, function, caption, words, limit):
    def settings(wildcards):
        robot = panels[wildcards.panel]
        return {"title": TITLES[robot], "robot": robot, "order": list(NAMES.values())} | limit

    tables = {
        "metrics": lambda wildcards: cells("metrics", panels[wildcards.panel], TABLE_NOISE),
        "printed": f"{CONFIG}/paper/reference.csv",
    }
    return (
        (function, "figure5{panel}", caption, PAPER, f"Figure 5{{panel}}: {words}"),
        tables,
        settings,
    )


def sources(step):
    """A script, or the one that calls a function of the packages, and the package modules that it runs.

    Their dates count for nothing: `watch_sources` has their digests. The parameter `step` of a rule names the same function.
    """
    script, modules = (
        (step, ()) if step.endswith(".py") else ("run_step.py", [step.rpartition(".")[0]])
    )
    path = ROOT / "workflow" / "scripts" / script
    try:
        files = [path, *closure(path, PACKAGES, *modules)]
    except InputError as error:
        sys.exit(str(error))
    return [ancient(placed(file)) for file in files]


def digest_of(files):
    """One digest of all that some files hold."""
    return hashlib.sha256(" ".join(map(checksum_once, files)).encode()).hexdigest()[:16]


checksum_once = cache(compute_sha256)


def remember_checksums():
    """Snakemake digests all inputs of a job that has ended once for each of its outputs: of a file that stays, once is enough."""
    digest, known = _IOFile.checksum, {}

    async def checksum(file, *asked, **settings):
        status = os.stat(file) if os.path.exists(file) else None
        key = (
            str(file),
            status and (status.st_ino, status.st_mtime_ns, status.st_size),
            asked,
            *settings.items(),
        )
        if key not in known:
            known[key] = await digest(file, *asked, **settings)
        return known[key]

    _IOFile.checksum = checksum


def complete_rules():
    """What rules have alike: a log and a time by their names and wildcards; of those with a script its sources among the inputs."""
    for each in workflow.rules:
        if each.norun:
            continue
        each.log_modifier = each.benchmark_modifier = each.input_modifier = each.output_modifier
        place = Path(
            each.name, *(f"{{{name}}}" for name in re.findall(r"{(\w+)", each.output[0]))
        ).as_posix()
        if not each.log:
            each.set_log(f"results/logs/{place}.log")
        if not each.benchmark:
            each.benchmark = f"results/timings/{place}.tsv"
        if each.is_script and "sources" not in each.input.keys():
            each.set_input(sources=sources(each.params.get("step") or Path(each.script).name))


def watch_sources():
    """An edit of a source reruns the jobs that depend on it, and no others, whatever the date of the file.

    Another environment, be it one of the libraries or the list of pins, reruns every job with a script.
    """
    environment_sha256 = configuration_sha256(environment(ROOT))
    watched = {
        each: [
            file
            for file in each.input
            if isinstance(file, str) and not MADE.match(file) and Path(file).is_file()
        ]
        for each in workflow.rules
        if "sources" in each.input.keys()
    }
    for each, files in watched.items():
        each.set_params(**{SOURCES_DIGEST: f"{digest_of(files)} {environment_sha256}"})


def files_behind(targets):
    """All that the jobs behind some targets write, by names: one that was deleted is made again although later ones are there."""
    found, left = set(), [target for target in targets if isinstance(target, str)]
    while left:
        path = left.pop()
        if path in found or not MADE.match(path):
            continue
        maker = next((each for each in workflow.rules if each.is_producer(path)), None)
        if maker is None:
            # Of the user, who keeps it in a folder of the pipeline.
            continue
        wildcards = Wildcards(fromdict=maker.get_wildcards(path))
        found.update(maker.expand_output(wildcards)[0])
        left += map(str, maker.expand_input(wildcards)[0])
    return sorted(map(str, found))


def robot_document(wildcards):
    return STUDY.robots[wildcards.robot]


def strategy_document(wildcards):
    return STUDY.strategies[wildcards.strategy]


def study_in_memory(**size):
    """What a script draws the study of a robot from: the robot, the seed, how the paper is read, the study's size."""
    read = {key: INTERPRETATIONS[key] for key in ("wrench_at", "average")} | {
        "rows": count_components(INTERPRETATIONS["measured"])
    }
    return lambda wildcards: {
        "robot": robot_document(wildcards),
        "seed": config["seed"],
        "tool_offset_m": INTERPRETATIONS["tool_offset_m"],
        "loading": LOADING,
        "interpretation": read,
        "size": STUDY_SIZE | size,
    }


def cells(kind, robots, noise, strategies=config["strategies"]):
    """Results of one kind for robots, noise levels and strategies."""
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
    """Files that a campaign is read from, those of the campaign that holds its test included."""
    if campaign in OWN:
        return OWN[campaign].files()
    source = SOURCES[campaign]
    # Who reads the test looks whether the campaign is there that tests this one in turn; two may test each other.
    names = [campaign]
    while (other := SOURCES[names[-1]].get("holdout", {}).get("campaign")) and Path(
        other
    ).name not in names:
        names.append(Path(other).name)
    files = expand(
        "data/campaigns/{name}/{file}", name=names, file=["campaign.yaml", "measurements.parquet"]
    )
    # An import has its robots among its inputs; a simulation does not have the robot that it declares.
    declared = [source["declared_robot"]] if source["source"] == "simulated" else []
    return files + expand(f"{CONFIG}/robots/{{robot}}.yaml", robot=declared)


def robots_of_import(wildcards):
    """Files of the robots that an importer reads or names."""
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
    """Campaigns that hold out the folds of the same measurements, by the importer of these."""
    folds = {}
    for name in campaigns:
        if "fold" in SOURCES[name]:
            folds.setdefault(SOURCES[name]["importer"], []).append(name)
    return folds


def audited(wildcards):
    """What is audited; asked for before any job of the run begins, so that nobody waits for results that cannot be audited."""
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
