"""Before all else: the configuration is a document that can be read, which Snakemake's own reader would not say in one line."""

import logging
import sys
from pathlib import Path

from elastocal.errors import InputError
from elastocal.io.documents import read_document

# On a full disk the log of the run cannot be written: its traceback would stand before the line that says so.
logging.raiseExceptions = False

# In a checkout by its name alone, in an installed package with its folder.
FILE = Path(workflow.basedir, "config.yaml")

try:
    # Of what the file holds no key counts here; Snakemake reads it again, with the changes of the command line.
    FILE = FILE.relative_to(Path.cwd()) if FILE.is_relative_to(Path.cwd()) else FILE
    # Those of --configfile as well, which Snakemake has read by now without bounds and without a word on a key that stands twice.
    for each in (FILE, *(workflow.config_settings.configfiles or ())):
        if not isinstance(read_document(each), dict):
            raise InputError(each, "", "no keys", "the keys of src/elastocal/schemas/config.yaml")
except InputError as error:
    sys.exit(str(error))
