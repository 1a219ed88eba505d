"""The command `elastocal`, and `python -m elastocal`: prepare the process, then run the
application.

Only small modules of the standard library are imported here, those that Python itself has
imported by then. So the threads of numerical libraries are limited before they start, and
an interrupt during the imports ends without a traceback. Nothing can be done about one
before Python begins with this module.
"""

import os
import signal
import sys
from contextlib import suppress
from types import FrameType

# A subcommand works on small matrices, which more threads do not make faster: they only
# wait for each other. Who wants more sets these variables.
_THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
# Parameters of glibc's mallopt, see malloc.h: with these thresholds the memory of a
# large array is kept for the next one. Fresh pages would cost a third of the time of a
# correction. The largest threshold that glibc accepts is half of a heap.
_M_TRIM_THRESHOLD = -1
_M_MMAP_THRESHOLD = -3
_KEPT_BYTES = 2**25
_TRIMMED_BYTES = 2**30
# The exit code of shells for a process that was interrupted.
_INTERRUPTED = 130


def main() -> None:
    """Run the application. An interrupt ends it with the exit code 130, also where a
    library that is being imported has turned it into an error of its own."""
    interrupts = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        interrupts.append(number)
        raise KeyboardInterrupt

    # Who starts a process in the background may have it ignore interrupts.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        prepare_process()
        from elastocal.command.main import main as run_application

        run_application()
    except (KeyboardInterrupt, SystemExit):
        if interrupts:
            sys.exit(_INTERRUPTED)
        raise


def prepare_process() -> None:
    """Limit threads to one, keep memory for the next array, and print on terminals that
    lack a character a question mark instead of failing."""
    # Import it only here, because its import takes long enough to be interrupted.
    import ctypes

    for variable in _THREAD_VARIABLES:
        os.environ.setdefault(variable, "1")
    # Other systems than Linux have no mallopt, and no need of it.
    with suppress(OSError, AttributeError):
        allocator = ctypes.CDLL(None)
        allocator.mallopt(_M_MMAP_THRESHOLD, _KEPT_BYTES)
        allocator.mallopt(_M_TRIM_THRESHOLD, _TRIMMED_BYTES)
    for stream in (sys.stdout, sys.stderr):
        # A stream that a program has put in place of standard output may lack this.
        with suppress(AttributeError):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]


if __name__ == "__main__":
    main()
