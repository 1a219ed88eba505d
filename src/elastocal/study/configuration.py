"""The study's configuration: checked as a whole before anything runs, with the robots
and strategies that it names."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elastocal.errors import InputError
from elastocal.io.documents import (
    check_document,
    document_path,
    parse_yaml,
    read_named_document,
)
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.equation_11 import find_first_solvable_length
from elastocal.study.strategies import check_strategy, strategy_from_document

# A measuring point in chain notation.
_POINT = re.compile(r"\[(\w*[A-Za-z]\w*)\]")
# What a robot file may leave out and a simulation of the robot needs.
_SIMULATED = ("joint_limits_deg", "compliance_urad_per_Nm")


@dataclass(frozen=True)
class Study:
    """A configuration that holds together.

    `robots`, `strategies`: documents by the names of their files. `points`: measuring
    points that each strategy reads. `end_effectors`: last measuring point of each
    robot.
    """

    robots: dict[str, dict[str, Any]]
    strategies: dict[str, dict[str, Any]]
    points: dict[str, tuple[str, ...]]
    end_effectors: dict[str, str]


def check_study(
    config: Mapping[str, Any], folder: str | Path, source: str = "config.yaml"
) -> Study:
    """Read the robots and strategies that a configuration names and check everything
    against everything.

    `folder`: holds ``robots/`` and ``strategies/``. `source`: file of the
    configuration, named in errors. Raises `InputError`: the first fault found.
    """
    check_document(config, "config", source)
    robots = {
        name: read_named_document(folder, "robots", "robot", name, source)
        for name in config["robots"]
    }
    for name, document in robots.items():
        for key in (key for key in _SIMULATED if key not in document):
            raise InputError(
                document_path(folder, "robots", name),
                key,
                "nothing",
                "values to simulate with, in a robot of the study",
            )
    strategies = {
        name: read_named_document(folder, "strategies", "strategy", name, source)
        for name in config["strategies"]
    }
    named: dict[str, str] = {}
    for name, document in strategies.items():
        if (first := named.setdefault(document["name"], name)) != name:
            place = document_path(folder, "strategies", name)
            raise InputError(
                place,
                "name",
                f"{document['name']!r}, as of {first}",
                "a name of its own: tables go by it",
            )
    chains = {
        name: robot_from_document(document, document_path(folder, "robots", name)).chain
        for name, document in robots.items()
    }
    points = {}
    for name, document in strategies.items():
        strategy = strategy_from_document(document)
        points[name] = strategy.points
        for chain in chains.values():
            check_strategy(strategy, chain, document_path(folder, "strategies", name))
        needed = find_first_solvable_length(
            strategy, count_components(config["interpretations"]["measured"])
        )
        if config["configurations"] < needed:
            raise InputError(
                source,
                "configurations",
                str(config["configurations"]),
                f"{needed} or more: {strategy.name} is short",
            )
    if all("links" in document for document in robots.values()):
        raise InputError(
            source,
            "robots",
            f"{config['robots']}, all with links",
            "at least one robot without links for Tables 3 and 4",
        )
    own = {point.name for chain in chains.values() for point in chain.points}
    for label, names in config["questions"]["point_sets"].items():
        for name in (name for name in names if name not in own):
            # A set may be there for robots that this study leaves out.
            files = Path(folder, "robots").glob("*.yaml")
            known = sorted(
                {
                    point
                    for file in files
                    for point in _POINT.findall(file.read_text("utf-8"))
                }
            )
            if name not in known:
                raise InputError(
                    source,
                    f"questions.point_sets.{label}",
                    repr(name),
                    ", ".join(known),
                )
    _check_cells(config, source)
    return Study(
        robots,
        strategies,
        points,
        {name: chain.end_effector.name for name, chain in chains.items()},
    )


def override_entries(
    config: Mapping[str, Any], entries: Iterable[str]
) -> dict[str, Any]:
    """A configuration with keys changed on the command line, numbers read as in the
    file.

    `entries`: ``key=value``; a value that is a mapping changes some keys of a mapping.
    Raises `InputError`: a value that is no YAML.
    """
    changed = dict(config)
    for key, _, text in (entry.partition("=") for entry in entries):
        changed[key] = _merge(changed.get(key), parse_yaml(text, f"--config {key}"))
    return changed


def _merge(old: Any, new: Any) -> Any:
    if isinstance(old, dict) and isinstance(new, dict):
        return old | {key: _merge(old.get(key), value) for key, value in new.items()}
    return new


def count_components(measured: str) -> int:
    """Measurements of one point in one configuration: 6 where poses are measured, 3
    where positions are."""
    return {"pose": 6, "position": 3}[measured]


def _check_cells(config: Mapping[str, Any], source: str) -> None:
    tables = config["tables"]
    longest = config["configurations"]
    levels: dict[str, float] = {}
    for level in config["noise_um"]:
        if levels.setdefault(f"{level:g}", level) != level:
            raise InputError(
                source,
                "noise_um",
                f"{levels[f'{level:g}']} and {level}",
                "levels that differ in 6 digits",
            )
    for key, name, allowed in (
        ("classical_strategy", "strategies", config["strategies"]),
        ("noise_um", "noise_um", config["noise_um"]),
    ):
        if tables[key] not in allowed:
            raise InputError(
                source, f"tables.{key}", repr(tables[key]), f"one of {name} {allowed}"
            )
    if tables["length"] > longest:
        raise InputError(
            source,
            "tables.length",
            str(tables["length"]),
            f"up to configurations = {longest}",
        )
