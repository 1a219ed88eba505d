"""Which campaigns a configuration names and where they come from, and the user's own: checked before any job starts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from elastocal.campaigns.campaign import DOCUMENT
from elastocal.campaigns.importers import importer
from elastocal.campaigns.reading import campaign_files, read_descriptions
from elastocal.errors import InputError
from elastocal.io.documents import document_path, named_document
from elastocal.io.json_files import read_json


def campaign_sources(config: Mapping[str, Any], folder: str | Path, source: str = "config.yaml") -> dict[str, dict[str, Any]]:
    """Documents of the campaigns that a configuration names, by the names of their files in `folder`, checked.

    A simulated one has the document of its robot under ``robot_document``. `source`: file of the configuration.
    """
    found = {}
    for name in named_campaigns(config):
        document = named_document(folder, "campaigns", "campaign_source", name, source)
        path = document_path(folder, "campaigns", name)
        if document["source"] == "public":
            importer(document["importer"], folder, path)
        else:
            document["robot_document"] = named_document(folder, "robots", "robot", document["robot"], path)
            named_document(folder, "robots", "robot", document["declared_robot"], path)
        found[name] = document
    return found


def named_campaigns(config: Mapping[str, Any]) -> list[str]:
    """Campaigns that a configuration names, each once: simulated, measured, of the default run and of the league."""
    looped = (name for key in ("campaigns", "measured", "main") for name in config["loop"][key])
    return list(dict.fromkeys((*looped, *named_league(config))))


def named_league(config: Mapping[str, Any]) -> list[str]:
    """Data sets of all leagues, each once."""
    return list(
        dict.fromkeys(data for robots in config["league"]["data"].values() for names in robots.values() for data in names)
    )


def user_campaign(config: Mapping[str, Any], robots_folder: str | Path, results: str | Path) -> dict[str, str]:
    """Folder of a user's own campaign by its name, spelled in one way however it was given; empty where there is none.

    `config`: ``campaign`` is its folder. `results`: of each campaign by its name. An `InputError` refuses faults of its
    documents, and a name that a campaign of this project has, or another one whose results are there.
    """
    if not config.get("campaign"):
        return {}
    # Snakemake takes a folder that is called 2026 for a number, and another spelling of one folder for another one.
    place, here = Path(str(config["campaign"])).resolve(), Path.cwd()
    folder = (place.relative_to(here) if place.is_relative_to(here) else place).as_posix()
    for path in campaign_files(folder, robots_folder):
        if set(path) & set("{}"):
            raise InputError(path, "", "braces", "a path without braces, which Snakemake takes for wildcards")
    document, _ = read_descriptions(folder, robots_folder)
    name, source = document["campaign"], f"{folder}/{DOCUMENT}"
    if name in named_campaigns(config):
        raise InputError(source, "campaign", repr(name), "a name that no campaign of config.yaml has")
    try:
        earlier = Path(read_json(Path(results, name, "campaign.json"))["source"]).parent
    except (OSError, ValueError, KeyError, TypeError):
        # No results, or such as do not say of what they are.
        earlier = None
    if earlier is not None and earlier.is_dir() and not earlier.samefile(folder):
        found = f"{name!r}, whose results are of {earlier.as_posix()}"
        raise InputError(source, "campaign", found, f"another name, or first take away {Path(results, name).as_posix()}")
    return {name: folder}
