"""Entry of the command line: pick the verb, run it, and turn every fault into one line and an exit status.

0 all good; 1 some inputs failed or were refused, some good; 2 usage, configuration or scene;
3 no input usable; 70 internal error; 130 interrupted.
"""

import argparse
import contextlib
import errno
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from importlib import import_module
from types import FrameType

from data_schemas.errors import IsochronyError, UsageError
from data_schemas.shield import bounded
from pipeline.cli.parser import Parser, did_you_mean, page, parser_of
from pipeline.cli.tables import Printable, complain
from synth.kernels import cache

_VERBS = {
    "demo": "demo.run", "simulate": "simulate.run", "process": "process.run", "expose": "simulate.expose",
    "digitise": "digitise.run", "batch": "batch.run", "benchmark": "benchmark.run", "plot": "plot.run",
    "import": "small.import_table", "join": "small.join", "validate": "small.validate", "schema": "small.schema",
    "explain": "small.explain", "warm": "small.warm",
}  # fmt: skip
"""Module and function of each."""
_READERS = ("process", "plot", "validate", "digitise", "import", "join")
_MOST_HELD, _PER_BYTE = 4 << 30, 50  # bytes; of the inputs
"""What reads files of anybody's making in this process, and what that may hold; batch has processes for them."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line on the words after `isochrony`, by default the process's own; return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    _use_streams()
    _calm_blas()
    if arguments is None and words[:1] and words[0] in _READERS:
        # xarray would import it, .3 s, and these have no use for it
        sys.modules.setdefault("dask", None)  # type: ignore[arg-type]
    struck: list[int] = []
    try:
        with contextlib.redirect_stdout(Printable(sys.stdout)), _noting_interrupts(struck):
            status = _dispatch(words)
        sys.stdout.flush()  # a reader that went away shows here and not at the interpreter's end
        return status
    except SystemExit as leaving:  # argparse, after --help or --version
        return leaving.code if isinstance(leaving.code, int) else 0
    except IsochronyError as fault:
        return _say(str(fault), fault.exit_status, fault)
    except KeyboardInterrupt as fault:
        return _say("interrupted", 130, fault)
    except MemoryError as fault:
        return _say("inputs of this size may not hold so much memory: one is damaged or too large; split it", 3, fault)
    except BrokenPipeError:
        # The reader of our output (head, less) left: what it did not read is lost, so not 0; nothing is said.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as fault:
        if isinstance(fault, OSError) and fault.errno == errno.ENOSPC:  # files of ours tell of themselves
            return _say(f"stdout cannot be written, {fault.strerror}; free space, or send it elsewhere", 3, fault)
        if struck:  # some libraries make an error of their own of it, and what was interrupted may fail to clean up
            return _say("interrupted", 130, fault)
        hint = "please report; run with ISOCHRONY_TRACEBACK=1 for the traceback"
        return _say(f"internal error: {type(fault).__name__}: {fault} ({hint})", 70, fault)


@contextlib.contextmanager
def _noting_interrupts(struck: list[int]) -> Iterator[None]:
    """Note each Ctrl-C, which is an exception as ever."""

    def note(number: int, frame: FrameType | None) -> None:
        struck.append(number)
        signal.default_int_handler(number, frame)

    main_one = threading.current_thread() is threading.main_thread()
    if ours := main_one and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _dispatch(words: list[str]) -> int:
    if words and words[0] in _VERBS:
        return _run(*words)
    if words and not words[0].startswith("-"):
        raise UsageError(f"unknown verb '{words[0]}'{did_you_mean(words[0], _VERBS)}")
    own = page("isochrony")
    top = Parser(prog="isochrony", description=own["description"], epilog=own["examples"])
    top.add_argument("-V", "--version", action="store_true", help="print the version and leave")
    verbs = top.add_subparsers(title="verbs", metavar="VERB", dest="verb")
    for name in _VERBS:
        verbs.add_parser(name, help=page(name)["help"])
    options, left = top.parse_known_args(words)
    top.refuse(left)
    if options.version:
        from importlib.metadata import PackageNotFoundError, version

        try:
            print(f"isochrony {version('isochrony')}")
        except PackageNotFoundError:
            print("isochrony (not installed: run from its sources)")
        return 0
    top.error(f"a verb is missing; known: {', '.join(_VERBS)}")


def _run(verb: str, *words: str) -> int:
    place, _, name = _VERBS[verb].partition(".")
    module = import_module(f"pipeline.cli.{place}")
    options = parser_of(verb, getattr(module, "LISTED", "")).parse_strictly(list(words))
    cache.WATCHERS[:] = [_say_compiling]
    with bounded(_allowed(options) if verb in _READERS else None):
        status: int = getattr(module, name)(options)
    return status


def _say_compiling(_kernel: str) -> None:
    """Say once why a first command takes long."""
    cache.WATCHERS.clear()
    complain("compiling kernels, once after installation or an upgrade (`isochrony warm` compiles all ahead)")


def _allowed(options: argparse.Namespace) -> int:
    """Bytes that a verb may hold: so much, and for each byte of its inputs."""
    given = [word for value in vars(options).values() for word in (value if isinstance(value, list) else [value])]
    sizes = (os.path.getsize(word) for word in given if isinstance(word, str) and os.path.isfile(word))
    return _MOST_HELD + _PER_BYTE * sum(sizes)


def _say(message: str, status: int, fault: BaseException) -> int:
    """Print one line on stderr (and the traceback if it was asked for); return the status."""
    complain(message)
    if os.environ.get("ISOCHRONY_TRACEBACK"):
        import traceback

        traceback.print_exception(fault)
    return status


def _calm_blas() -> None:
    """Let BLAS work in one thread, unless the user says how many: on small matrices others wait, at twice the time."""
    if "OMP_NUM_THREADS" not in os.environ:
        for library in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
            os.environ.setdefault(library, "1")


def _use_streams() -> None:
    """UTF-8 on both streams, whatever the locale; one that is closed goes nowhere, or a file would take its number."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115  # as long as the process
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")
