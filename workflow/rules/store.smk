"""A finished run on an object store: `snakemake -j2 store --config store=s3://BUCKET/FOLDER`.

Makes what is not made yet, then uploads every file that a job behind it made, and as one archive what these read: sources,
configuration, and what lies in folders of cases, with the SHA-256 of all. What is on the store and has not changed here since
stays as it is. `--config store_of='[study, loop, blind]'` names the targets; study and loop are without.
"""


rule pack_sources:
    input:
        files=lambda wildcards: files_behind(stored_targets()),
        workflow=[placed(path) for path in (ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk")))],
    output:
        archive="reports/sources.zip",
    params:
        configuration=RESOLVED,
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
        wildcard_constraints:
            stored="(data|results|reports)/.+",
        shell:
            "{sys.executable:q} -m elastocal.io.records {input.file:q} 2> {log:q} | sha256sum --check --quiet &>> {log:q} &&"
            " cp {input.file:q} {output.file:q} &>> {log:q}"


rule store:
    input:
        lambda wildcards: [
            in_store(output)
            for output in outputs_behind([*stored_targets(), *rules.pack_sources.output])
            if not output.is_directory
        ],
