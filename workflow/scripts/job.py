"""What every script does around its one call: a log, and one line where the input is at fault."""

import sys
import traceback
from collections.abc import Callable
from typing import Any, Protocol

from elastocal.errors import InputError


class Job(Protocol):
    """What Snakemake hands to a script; the names in each part are the rule's."""

    input: Any
    output: Any
    params: Any
    wildcards: Any
    log: Any


def run(step: Callable[[Job], None], snakemake: Job) -> None:
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
