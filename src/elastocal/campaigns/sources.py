"""Which campaigns a configuration names and where they come from, and the user's own: checked before any job starts."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from elastocal.campaigns.campaign import DOCUMENT
from elastocal.campaigns.importers.catalogue import check_importer
from elastocal.campaigns.reading import read_descriptions
from elastocal.errors import InputError
from elastocal.io.documents import document_path, named_document

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any


def campaign_sources(config: Mapping[str, Any], folder: str | Path, source: str = "config.yaml") -> dict[str, dict[str, Any]]:
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
    for name in named_campaigns(config):
        document = named_document(folder, "campaigns", "campaign_source", name, source)
        path = document_path(folder, "campaigns", name)
        if document["source"] == "public":
            check_importer(document["importer"], path)
        else:
            document["robot_document"] = named_document(folder, "robots", "robot", document["robot"], path)
            named_document(folder, "robots", "robot", document["declared_robot"], path)
        found[name] = document
    return found


def named_campaigns(config: Mapping[str, Any]) -> list[str]:
    """Campaigns that a configuration names, each once: simulated, measured and of the league."""
    return list(dict.fromkeys((*config["loop"]["campaigns"], *config["loop"]["measured"], *named_league(config))))


def named_league(config: Mapping[str, Any]) -> list[str]:
    """Data sets of all leagues, each once."""
    return list(
        dict.fromkeys(data for robots in config["league"]["data"].values() for names in robots.values() for data in names)
    )


def user_campaign(config: Mapping[str, Any], robots_folder: str | Path) -> dict[str, str]:
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
    if name in named_campaigns(config):
        raise InputError(source, "campaign", repr(name), "a name that no campaign of config.yaml has")
    return {name: str(folder).rstrip("/")}
