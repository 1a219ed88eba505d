"""The study's configuration: checked as a whole before anything runs, with the robots and strategies that it names."""

import difflib
import re
from dataclasses import dataclass
from pathlib import Path

from elastocal.campaign import DOCUMENT, read_descriptions
from elastocal.documents import check_document, read_document
from elastocal.errors import InputError
from elastocal.identification import first_solvable_length
from elastocal.robot import robot_from_document
from elastocal.strategies import check_strategy, strategy_from_document


@dataclass(frozen=True)
class Study:
    """A configuration that holds together.

    Attributes
    ----------
    robots, strategies : dict of str to dict
        Documents by the names of their files.
    points : dict of str to tuple of str
        Measuring points that each strategy reads.
    end_effectors : dict of str to str
        Last measuring point of each robot.
    """

    robots: dict
    strategies: dict
    points: dict
    end_effectors: dict


def check_study(config, folder, source="config.yaml"):
    """Read the robots and strategies that a configuration names and check everything against everything.

    Parameters
    ----------
    config : dict
    folder : str or Path
        Holds ``robots/`` and ``strategies/``.
    source : str
        File of the configuration, named in errors.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        The first fault found.
    """
    check_document(config, "config", source)
    robots = {name: _named_document(folder, "robots", "robot", name, source) for name in config["robots"]}
    strategies = {name: _named_document(folder, "strategies", "strategy", name, source) for name in config["strategies"]}
    chains = {name: robot_from_document(document, _path(folder, "robots", name)).chain for name, document in robots.items()}
    points = {}
    for name, document in strategies.items():
        strategy = strategy_from_document(document)
        points[name] = strategy.points
        for chain in chains.values():
            check_strategy(strategy, chain, _path(folder, "strategies", name))
        needed = first_solvable_length(strategy, rows_read(config["readings"]["measured"]))
        if config["configurations"] < needed:
            raise InputError(
                source, "configurations", str(config["configurations"]), f"{needed} or more: {strategy.name} is short"
            )
    if all("links" in document for document in robots.values()):
        raise InputError(
            source, "robots", f"{config['robots']}, all with links", "at least one robot without links for Tables 3 and 4"
        )
    _check_cells(config, source)
    return Study(robots, strategies, points, {name: chain.end_effector.name for name, chain in chains.items()})


def campaign_sources(config, folder, source="config.yaml"):
    """Where the campaigns that a configuration names come from.

    Parameters
    ----------
    config : dict
        Checked.
    folder : str or Path
        Holds ``campaigns/`` and ``robots/``.
    source : str
        File of the configuration, named in errors.

    Returns
    -------
    dict of str to dict
        Documents by the names of their files; a simulated one has the document of its robot under ``robot_document``.

    Raises
    ------
    InputError
        The first fault found.
    """
    found = {}
    for name in (*config["loop"]["campaigns"], *config["loop"]["measured"]):
        document = _named_document(folder, "campaigns", "campaign_source", name, source)
        if document["source"] == "simulated":
            path = _path(folder, "campaigns", name)
            document["robot_document"] = _named_document(folder, "robots", "robot", document["robot"], path)
            _named_document(folder, "robots", "robot", document["declared_robot"], path)
        found[name] = document
    return found


def user_campaign(config, robots_folder):
    """A user's own campaign, checked as a whole before any job starts.

    Parameters
    ----------
    config : dict
        ``campaign`` is its folder.
    robots_folder : str or Path

    Returns
    -------
    dict of str to str
        Its folder by its name; empty where there is none.

    Raises
    ------
    InputError
        A name that no file can have or that a campaign of this project has.
    """
    folder = config.get("campaign")
    if not folder:
        return {}
    document, _ = read_descriptions(folder, robots_folder)
    name, source = document["campaign"], f"{folder}/{DOCUMENT}"
    if not re.fullmatch(r"[\w.-]+", name):
        raise InputError(source, "campaign", repr(name), "letters, digits, _, - and . for the name of its folder of results")
    if name in (*config["loop"]["campaigns"], *config["loop"]["measured"]):
        raise InputError(source, "campaign", repr(name), "a name that no campaign of config.yaml has")
    return {name: str(folder).rstrip("/")}


def rows_read(measured):
    """Readings of one point in one configuration: 6 where poses are measured, 3 where positions are."""
    return {"pose": 6, "position": 3}[measured]


def _check_cells(config, source):
    tables, longest = config["tables"], config["configurations"]
    if tables["classical_strategy"] not in config["strategies"]:
        raise InputError(
            source, "tables.classical_strategy", repr(tables["classical_strategy"]), f"one of strategies {config['strategies']}"
        )
    if tables["noise_um"] not in config["noise_um"]:
        raise InputError(source, "tables.noise_um", str(tables["noise_um"]), f"one of noise_um {config['noise_um']}")
    for index, length in enumerate(config["evaluation"]["lengths"]):
        if length > longest:
            raise InputError(source, f"evaluation.lengths[{index}]", str(length), f"up to configurations = {longest}")
    if tables["length"] not in config["evaluation"]["lengths"]:
        raise InputError(
            source, "tables.length", str(tables["length"]), f"one of evaluation.lengths {config['evaluation']['lengths']}"
        )


def _path(folder, kind, name):
    return (Path(folder) / kind / f"{name}.yaml").as_posix()


def _named_document(folder, kind, schema, name, source):
    path = Path(_path(folder, kind, name))
    if not path.is_file():
        known = sorted(file.stem for file in path.parent.glob("*.yaml"))
        close = difflib.get_close_matches(name, known, n=1)
        hint = f"{close[0]!r}? ({', '.join(known)})" if close else ", ".join(known)
        raise InputError(source, kind, repr(name), f"a file of {path.parent.as_posix()}: {hint}")
    document = read_document(path)
    check_document(document, schema, path.as_posix())
    return document
