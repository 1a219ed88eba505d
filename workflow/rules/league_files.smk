"""Which data sets of the league are at hand, and the names of its files: functions for league.smk."""

from elastocal.campaigns.importers import find_missing

LEAGUE = config["league"]


def missing_data(names):
    """A file that is missing of each data set of which one is."""
    sources = {name: SOURCES[name] for name in names if SOURCES[name]["source"] == "public"}
    files = {
        name: find_missing(
            source["files"], find_importer(source["importer"], CONFIG, name).files, "data/public", BOX
        )
        for name, source in sources.items()
    }
    return {name: file for name, file in files.items() if file}


MISSING_DATA = missing_data(list_league_data(config))
# Robots of each league with the data sets that are at hand.
LEAGUES = {
    league: {
        robot: there
        for robot, names in robots.items()
        if (there := [name for name in names if name not in MISSING_DATA])
    }
    for league, robots in LEAGUE["data"].items()
}


def missing_of(league):
    """Data sets of a league that are left out, with the file that each lacks."""
    named = {name for names in LEAGUE["data"][league].values() for name in names}
    return {name: file for name, file in MISSING_DATA.items() if name in named}


def sessions_of(data):
    """Other data sets of the same robot, in any league."""
    robots = [names for league in LEAGUES.values() for names in league.values() if data in names]
    return list(dict.fromkeys(name for names in robots for name in names if name != data))


def rounds_of(league):
    """Pairs of data set and split; sessions only where a robot has several data sets."""
    names = [name for names in LEAGUES[league].values() for name in names]
    return [
        (name, split)
        for name in names
        for split in ("random", "blocks", *(["session"] if sessions_of(name) else []))
    ]


def league_files(kind):
    """Tables of a data set, and of those that test it where the split is by session."""

    def files(wildcards):
        others = sessions_of(wildcards.data) if wildcards.split == "session" else []
        return expand(getattr(rules.deal_league_folds.output, kind), data=[wildcards.data, *others])

    return files


def diagnosed_facts(wildcards):
    """Diagnoses of the folds, for a method that needs them."""
    needed = LEAGUE["methods"][wildcards.method]["physics"] == "diagnosis"
    return rules.diagnose_league_folds.output.facts if needed else []


def entry_keys(league):
    return [
        (data, split, method) for data, split in rounds_of(league) for method in LEAGUE["methods"]
    ]


def of_rounds(pattern, keys):
    """A file for each data set, split and, where there is one, method."""
    names = ("data", "split", "method")
    return [pattern.format(**dict(zip(names, key))) for key in keys]
