"""A finished run on an object store: `snakemake -j2 store --config store=s3://BUCKET/FOLDER`.

Makes what is not made yet, then uploads the crate, every file that it describes and a job made, and as one archive the other
files that it describes: sources, configuration, and what lies in folders of cases. What is on the store and has not changed here
since stays as it is. Of which targets, says `crate_of` (crate.smk).
"""


rule pack_sources:
    input:
        crate=rules.write_crate.output.crate,
        check=placed(ROOT / "workflow" / "check_crate.py"),
        sources=sources("pack_sources.py"),
    output:
        archive="reports/sources.zip",
    log:
        "results/logs/pack_sources.log",
    benchmark:
        "results/timings/pack_sources.tsv"
    script:
        "../scripts/pack_sources.py"


# Only with a store, whose plugin is not among what a run on one machine installs.
if "store" in config:

    localrules:
        upload,

    # A file that is no longer what its job wrote does not replace the one on the store.
    rule upload:
        input:
            file="{stored}",
        output:
            file=in_store("{stored}"),
        log:
            "results/logs/upload/{stored}.log",
        benchmark:
            "results/timings/upload/{stored}.tsv"
        wildcard_constraints:
            stored="((data|results|reports)/.+)|ro-crate-metadata.json",
        shell:
            "{sys.executable:q} -m elastocal.io.records {input.file:q} 2> {log:q} | sha256sum --check --quiet &>> {log:q} &&"
            " cp {input.file:q} {output.file:q} &>> {log:q}"


rule store:
    input:
        lambda wildcards: [
            in_store(output)
            for output in outputs_behind([*described(), *rules.pack_sources.output])
            if not output.is_directory
        ],
