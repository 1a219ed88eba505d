"""Read the configuration files before Snakemake does, so that a fault in them is one line that names it."""

import logging
import sys
from pathlib import Path

from elastocal.errors import InputError
from elastocal.io.documents import read_document

ROOT = Path(workflow.basedir)
sys.path.insert(0, str(ROOT / "workflow" / "rules"))

import snakemake_internals

# On a full disk the log of the run cannot be written; its traceback would hide the line that says so.
logging.raiseExceptions = False

CONFIG_FILE = ROOT / "config.yaml"
if CONFIG_FILE.is_relative_to(Path.cwd()):
    CONFIG_FILE = CONFIG_FILE.relative_to(Path.cwd())

try:
    # Files of --configfile are checked too: Snakemake reads them without bounds and accepts a key that is given twice.
    for file in (CONFIG_FILE, *snakemake_internals.config_files(workflow)):
        if not isinstance(read_document(file), dict):
            raise InputError(file, "", "no keys", "the keys of src/elastocal/schemas/config.yaml")
except InputError as error:
    sys.exit(str(error))
