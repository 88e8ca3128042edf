"""`isochrony warm`: compiles ahead what the other verbs need, so that the first of them does not wait."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import data_schemas
import synth
from pipeline.methods import METHODS
from synth.kernels.cache import WATCHERS, cache_folder, stamp

if TYPE_CHECKING:
    from data_schemas.scene import Scene

HELP = "compile ahead what the other verbs need"
DESCRIPTION = """\
Compile every kernel that the methods, the shipped scenes and films need, and keep the machine code in the user's cache
($XDG_CACHE_HOME or ~/.cache). Without it, the first command that needs a kernel compiles it, and says so.

Small records, scenes and a film are worked on in a temporary folder; nothing else is written. What is there is
not compiled again: after an edit of the sources, or an upgrade, only what depends on it. Takes a minute or two after
an installation, and a second where all is ready."""

EXAMPLES = """\
examples:
  isochrony warm                                 once after installation, or in an image before it is shipped"""

_DURATION, _OF_FILM = 120.0, 150.0  # s


def add_options(parser: argparse.ArgumentParser) -> None:
    """None."""


def run(options: argparse.Namespace) -> int:
    """Do a little of everything."""
    begun, compiled = time.perf_counter(), list[str]()
    made_from = stamp(__file__)
    ready = cache_folder() / f"ready-{made_from}"
    if made_from is not None and ready.exists():
        print("all kernels are ready")
        return 0
    WATCHERS[:] = [compiled.append]
    with tempfile.TemporaryDirectory(prefix="isochrony-") as folder:
        every = list(_steps(Path(folder)))
        for number, (what, do) in enumerate(every, 1):
            before, count = time.perf_counter(), len(compiled)
            do()
            told = f"{len(compiled) - count} kernels compiled, {time.perf_counter() - before:.0f} s"
            print(f"{number} of {len(every)}: {what}: {told}", file=sys.stderr, flush=True)
    for other in ready.parent.glob("ready-*"):
        other.unlink(missing_ok=True)
    if made_from is not None:
        ready.touch()
    print(f"all kernels are ready: {len(compiled)} compiled in {time.perf_counter() - begun:.0f} s")
    return 0


def _steps(folder: Path) -> Iterator[tuple[str, Callable[[], object]]]:
    """What is done, and how it is called."""
    from pipeline.batch.executors import warm
    from pipeline.film.digitise import digitise

    def scene(name: str, longest: float) -> Scene:
        shipped = data_schemas.load_scene(synth.scene_path(name))
        return shipped.model_copy(update={"duration": min(shipped.duration, longest)})

    film = folder / "warm.film.tif"
    yield "process", partial(warm, [name for name in METHODS if name != "auto"])
    for name in sorted(synth.scenes()):
        yield f"simulate {name}", partial(lambda each: synth.simulate(scene(each, _DURATION)), name)
    yield "expose", lambda: synth.expose_to(scene("film", _OF_FILM), synth.load_film("typical"), film)
    yield "digitise", partial(digitise, film)
