"""The benchmark of methods: every method predicts the same held-out poses of every public data set.

`snakemake -j2 league`; `league_small` uses only the two smallest data sets. Needs data/campaigns/{data}/, which are imported. If
ELASTOCAL_DATA names a folder, data sets that lack a file there are left out, and the page names them. Writes results/league/{data}/
and reports/league/{league}/.
"""


wildcard_constraints:
    data="|".join(list_league_data(config)) or "none",
    split="random|blocks|session",
    method="|".join(LEAGUE["methods"]),
    league="|".join(LEAGUE["data"]),


rule deal_league_folds:
    input:
        files=lambda wildcards: files_of_campaign(wildcards.data),
    output:
        descriptions="results/league/{data}/campaign.json",
        measurements="results/league/{data}/measurements.parquet",
        folds="results/league/{data}/folds.parquet",
    params:
        step="elastocal_proof.league.methods.deal_league_folds",
        folder="data/campaigns/{data}",
        robots=f"{CONFIG}/robots",
        folds=LEAGUE["folds"],
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule diagnose_league_folds:
    input:
        descriptions=rules.deal_league_folds.output.descriptions,
        measurements=rules.deal_league_folds.output.measurements,
        folds=rules.deal_league_folds.output.folds,
    output:
        facts="results/league/{data}/{split}/diagnoses.json",
        mechanisms="results/league/{data}/{split}/mechanisms.parquet",
    params:
        step="elastocal_proof.league.methods.diagnose_league_folds",
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule enter_league:
    input:
        descriptions=league_files("descriptions"),
        measurements=league_files("measurements"),
        folds=league_files("folds"),
        facts=diagnosed_facts,
    output:
        entries="results/league/{data}/{split}/{method}.parquet",
    params:
        step="elastocal_proof.league.methods.enter_league",
        method=lambda wildcards: LEAGUE["methods"][wildcards.method],
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule tabulate_league:
    input:
        entries=lambda wildcards: of_rounds(
            rules.enter_league.output.entries, entry_keys(wildcards.league)
        ),
        mechanisms=lambda wildcards: of_rounds(
            rules.diagnose_league_folds.output.mechanisms,
            [key for key in rounds_of(wildcards.league) if key[1] == "random"],
        ),
    output:
        league=shown(
            "reports/league/{league}/league.csv",
            "league",
            "League",
            shows="Errors of all methods",
            kind="table",
        ),
        mechanisms="reports/league/{league}/mechanisms.csv",
        page="reports/league/{league}/league.md",
        picture_pdf="reports/league/{league}/league.pdf",
        picture_png=shown(
            "reports/league/{league}/league.png",
            "league",
            "League",
            shows="Methods against one another",
            kind="figure",
        ),
        mechanisms_pdf="reports/league/{league}/mechanisms.pdf",
        mechanisms_png=shown(
            "reports/league/{league}/mechanisms.png",
            "league_mechanisms",
            "League",
            shows="Mechanisms found",
            kind="figure",
        ),
    params:
        step="elastocal_proof.figures.league.tabulate_league",
        entered=lambda wildcards: entry_keys(wildcards.league),
        rounds=lambda wildcards: rounds_of(wildcards.league),
        missing=lambda wildcards: missing_of(wildcards.league),
        robots=lambda wildcards: LEAGUES[wildcards.league],
        reference=LEAGUE["reference"],
        methods=LEAGUE["methods"],
        folds=LEAGUE["folds"],
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule league_small:
    input:
        "reports/league/small/league.csv",


rule league:
    input:
        "reports/league/all/league.csv",


rule league_pictures:
    """Pictures and tables of docs/, from a finished benchmark of methods."""
    input:
        league="reports/league/all/league.png",
        mechanisms="reports/league/all/mechanisms.png",
        page="reports/league/all/league.md",
    output:
        league="docs/league.png",
        mechanisms="docs/mechanisms.png",
        page="docs/league_tables.md",
    params:
        head="# Tables of the benchmark of methods\n\nWritten by `snakemake -j2 league`; [what they mean](league.md).\n\n"
        "![RMS errors of all methods over that of geometry](league.png)\n\n",
    shell:
        "(cp {input.league} {output.league}; cp {input.mechanisms} {output.mechanisms};"
        " printf '%b' {params.head:q} | cat - {input.page} > {output.page}) 2> {log}"
