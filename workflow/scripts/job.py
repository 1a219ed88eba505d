"""What every script does around its one call: a log, and one line where the input is at fault."""

import sys
import traceback

from elastocal.errors import InputError


def run(step, snakemake):
    """Call ``step(snakemake)``; an `InputError` ends the job with its one line, on the terminal and in the log."""
    with open(snakemake.log[0], "w", encoding="utf-8") as log:
        try:
            step(snakemake)
        except InputError as error:
            print(error, file=log)
            sys.exit(str(error))
        except Exception:
            traceback.print_exc(file=log)
            raise
        print("done", file=log)
