"""Functions for league.smk: available data sets of the benchmark of methods, and the names of its files."""

from elastocal.campaigns.importers import find_importer, find_missing

LEAGUE = config["league"]


def missing_data(names):
    """Return a missing file for each data set that is incomplete."""
    sources = {name: SOURCES[name] for name in names if SOURCES[name]["source"] == "public"}
    files = {
        name: find_missing(
            source["files"],
            find_importer(source["importer"], CONFIG, name).files,
            "data/public",
            INCLUDED_DATA,
        )
        for name, source in sources.items()
    }
    return {name: file for name, file in files.items() if file}


MISSING_DATA = missing_data(list_league_data(config))


def available_data(robots):
    """Return the robots of a benchmark with their available data sets; a robot without any is left out."""
    available = {
        robot: [name for name in names if name not in MISSING_DATA]
        for robot, names in robots.items()
    }
    return {robot: names for robot, names in available.items() if names}


LEAGUES = {league: available_data(robots) for league, robots in LEAGUE["data"].items()}


def missing_of(league):
    """Return the data sets that a benchmark leaves out, with a missing file of each."""
    named = {name for names in LEAGUE["data"][league].values() for name in names}
    return {name: file for name, file in MISSING_DATA.items() if name in named}


def sessions_of(data):
    """Return the other data sets of the same robot, in any benchmark."""
    robots = [names for league in LEAGUES.values() for names in league.values() if data in names]
    return list(dict.fromkeys(name for names in robots for name in names if name != data))


def rounds_of(league):
    """Return pairs of data set and split; the split by session needs a robot with several data sets."""
    rounds = []
    for name in [name for names in LEAGUES[league].values() for name in names]:
        splits = ["random", "blocks"]
        if sessions_of(name):
            splits.append("session")
        rounds += [(name, split) for split in splits]
    return rounds


def league_files(kind):
    """Return tables of a data set and, if the split is by session, of the data sets that test it."""

    def files(wildcards):
        others = sessions_of(wildcards.data) if wildcards.split == "session" else []
        return expand(getattr(rules.deal_league_folds.output, kind), data=[wildcards.data, *others])

    return files


def diagnosed_facts(wildcards):
    """Return the diagnoses of the folds for a method that needs them."""
    needed = LEAGUE["methods"][wildcards.method]["physics"] == "diagnosis"
    return rules.diagnose_league_folds.output.facts if needed else []


def entry_keys(league):
    return [
        (data, split, method) for data, split in rounds_of(league) for method in LEAGUE["methods"]
    ]


def of_rounds(pattern, keys):
    """Return a file for each data set, split and, if the pattern has one, method."""
    names = ("data", "split", "method")
    return [pattern.format(**dict(zip(names, key))) for key in keys]
