"""The study's configuration: checked as a whole before anything runs, with the robots
and strategies that it names."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elastocal.errors import InputError
from elastocal.io.documents import (
    Document,
    check_document,
    locate_document,
    parse_yaml,
    read_named_document,
)
from elastocal.mechanics.chain import Chain
from elastocal.mechanics.robot_file import parse_robot
from elastocal.study.equation_11 import find_first_solvable_length
from elastocal.study.strategies import (
    Strategy,
    check_strategy,
    strategy_from_document,
)

# A measuring point in chain notation.
_POINT = re.compile(r"\[(\w*[A-Za-z]\w*)\]")
# Optional keys of a robot file that a simulation of the robot needs.
_SIMULATION_KEYS = ("joint_limits_deg", "compliance_urad_per_Nm")


@dataclass(frozen=True)
class Study:
    """A configuration that passed all checks.

    Attributes
    ----------
    robots, strategies
        Documents by the names of their files.
    points
        Measuring points that each strategy uses.
    end_effectors
        Last measuring point of each robot.
    """

    robots: dict[str, dict[str, Any]]
    strategies: dict[str, dict[str, Any]]
    points: dict[str, tuple[str, ...]]
    end_effectors: dict[str, str]


def check_study(
    config: Document, folder: str | Path, source: str = "config.yaml"
) -> Study:
    """Read the robots and strategies that a configuration names and check all of them
    together.

    Parameters
    ----------
    config
    folder
        Holds ``robots/`` and ``strategies/``.
    source
        File of the configuration, named in errors.

    Raises
    ------
    InputError
        The first fault that is found.
    """
    check_document(config, "config", source)
    robots = {
        name: read_named_document(folder, "robots", "robot", name, source)
        for name in config["robots"]
    }
    for name, robot in robots.items():
        _check_simulation_keys(robot, locate_document(folder, "robots", name))
    documents = {
        name: read_named_document(folder, "strategies", "strategy", name, source)
        for name in config["strategies"]
    }
    _check_distinct_names(documents, folder)
    chains = {
        name: parse_robot(robot, locate_document(folder, "robots", name)).chain
        for name, robot in robots.items()
    }
    strategies = {
        name: strategy_from_document(document) for name, document in documents.items()
    }
    for name, strategy in strategies.items():
        for chain in chains.values():
            check_strategy(strategy, chain, locate_document(folder, "strategies", name))
        _check_length(strategy, config, source)
    if all("links" in robot for robot in robots.values()):
        raise InputError(
            source,
            "robots",
            f"{config['robots']}, all with links",
            "at least one robot without links for Tables 3 and 4",
        )
    _check_point_sets(config, chains, folder, source)
    _check_noise_levels(config["noise_um"], source)
    _check_tables(config, source)
    return Study(
        robots,
        documents,
        {name: strategy.points for name, strategy in strategies.items()},
        {name: chain.end_effector.name for name, chain in chains.items()},
    )


def _check_simulation_keys(robot: Document, source: str) -> None:
    """Refuse a robot file without the values that a simulation needs."""
    for key in _SIMULATION_KEYS:
        if key not in robot:
            raise InputError(
                source,
                key,
                "nothing",
                "values to simulate with, in a robot of the study",
            )


def _check_distinct_names(
    documents: Mapping[str, Document], folder: str | Path
) -> None:
    """Refuse two strategies with the same name."""
    files: dict[str, str] = {}
    for file, document in documents.items():
        first = files.setdefault(document["name"], file)
        if first != file:
            raise InputError(
                locate_document(folder, "strategies", file),
                "name",
                f"{document['name']!r}, as of {first}",
                "a name of its own: tables go by it",
            )


def _check_length(strategy: Strategy, config: Document, source: str) -> None:
    """Refuse data sets that are too short for a strategy."""
    components = count_components(config["interpretations"]["measured"])
    needed = find_first_solvable_length(strategy, components)
    if config["configurations"] < needed:
        raise InputError(
            source,
            "configurations",
            str(config["configurations"]),
            f"{needed} or more: {strategy.name} is short",
        )


def _check_point_sets(
    config: Document,
    chains: Mapping[str, Chain],
    folder: str | Path,
    source: str,
) -> None:
    """Refuse a set with a measuring point that no robot file has.

    A set may belong to robots that this study leaves out.
    """
    studied = {point.name for chain in chains.values() for point in chain.points}
    for label, names in config["questions"]["point_sets"].items():
        for name in names:
            if name in studied:
                continue
            texts = [
                file.read_text("utf-8")
                for file in Path(folder, "robots").glob("*.yaml")
            ]
            allowed = sorted(set(_POINT.findall("\n".join(texts))))
            if name not in allowed:
                key = f"questions.point_sets.{label}"
                raise InputError(source, key, repr(name), ", ".join(allowed))


def override_entries(config: Document, entries: Iterable[str]) -> dict[str, Any]:
    """Change keys of a configuration on the command line; values are read as in the
    file.

    Parameters
    ----------
    config
    entries
        ``key=value``; a value that is a mapping changes some keys of a mapping.

    Raises
    ------
    InputError
        A value is no YAML.
    """
    changed = dict(config)
    for entry in entries:
        key, _, text = entry.partition("=")
        changed[key] = _merge(changed.get(key), parse_yaml(text, f"--config {key}"))
    return changed


def _merge(old: Any, new: Any) -> Any:
    if isinstance(old, dict) and isinstance(new, dict):
        return old | {key: _merge(old.get(key), value) for key, value in new.items()}
    return new


def count_components(measured: str) -> int:
    """Number of components measured at one point in one configuration: 6 of a pose, 3
    of a position."""
    return {"pose": 6, "position": 3}[measured]


def _check_noise_levels(levels: Iterable[float], source: str) -> None:
    """Refuse noise levels that agree to 6 digits, because files are named by these."""
    levels_by_name: dict[str, float] = {}
    for level in levels:
        first = levels_by_name.setdefault(f"{level:g}", level)
        if first != level:
            raise InputError(
                source,
                "noise_um",
                f"{first} and {level}",
                "levels that differ in 6 digits",
            )


def _check_tables(config: Document, source: str) -> None:
    """Refuse tables of strategies, noise levels or lengths that are not simulated."""
    tables = config["tables"]
    for key, name in (("classical_strategy", "strategies"), ("noise_um", "noise_um")):
        if tables[key] not in config[name]:
            allowed = f"one of {name} {config[name]}"
            raise InputError(source, f"tables.{key}", repr(tables[key]), allowed)
    longest = config["configurations"]
    if tables["length"] > longest:
        raise InputError(
            source,
            "tables.length",
            str(tables["length"]),
            f"up to configurations = {longest}",
        )
