"""Write an error during the imports of a script to its log.

Scripts import this module first. Once `job.run` has started it writes the log itself.
"""

import sys
import traceback
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from elastocal.errors import InputError, describe_system_fault
from elastocal.io.atomic_writes import write_text


def write_log(log: str | Path, text: str) -> None:
    """Write a log if possible; the terminal shows the text in any case."""
    with suppress(OSError, InputError):
        write_text(log, text)


def log_uncaught_error(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    # Snakemake defines this object in the script itself.
    job = getattr(sys.modules["__main__"], "snakemake", None)
    if job is not None:
        text = "".join(traceback.format_exception(kind, error, trace))
        if isinstance(error, MemoryError | ImportError):
            fault = describe_system_fault(error)
            if fault is not None and fault.source == "memory":
                text += f"{fault}\n"
        write_log(job.log[0], text)
    sys.__excepthook__(kind, error, trace)


sys.excepthook = log_uncaught_error
