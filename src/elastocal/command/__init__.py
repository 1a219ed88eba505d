"""The command `elastocal`, thin over the library and the Snakemake targets: one module
for each subcommand, and `main`."""
