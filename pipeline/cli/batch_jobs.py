"""From the words of the command line to the jobs of a batch."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from data_schemas.errors import UsageError
from pipeline.batch.campaign import Job
from pipeline.batch.config import Config
from pipeline.batch.inputs import Input, find_inputs
from pipeline.batch.sweep import MOST, Variant, grid, parse_sweep
from pipeline.cli.batch_kinds import KINDS, member_of

_MIB = 1 << 20


def jobs_of(options: argparse.Namespace, folder: Path) -> list[Job]:
    """Every input with its settings, in order.

    Raises
    ------
    UsageError
        Words that mean no file, options that contradict each other, an unknown method.
    SceneError
        A key of a sweep that its scene does not have.
    """
    from pipeline.cli.process import requested_methods
    from pipeline.provenance import command_line

    methods = requested_methods("batch", options.method)
    inputs = find_inputs([_shipped(word) for word in options.inputs], KINDS)
    points = _points(options, inputs)
    command = command_line()
    made = []
    for one in inputs:
        for member, variant in points if one.kind.name == "scene" and points else [(0, ())]:
            key = f"{one.name}-{member:0{len(str(len(points)))}d}.result.nc" if member else f"{one.name}.result.nc"
            config = Config(
                key=key,
                output=folder / key,
                kind=one.kind,
                method=methods,
                pair=options.pair,
                gain_uncertainty=options.gain_uncertainty,
                member=member,
                variant=variant,
                memory=None if options.trusted else options.memory * _MIB,
                command=command,
            )
            made.append((one.path, config))
    return made


def _points(options: argparse.Namespace, inputs: list[Input]) -> list[tuple[int, Variant]]:
    """Members of every scene, by number; none where scenes are to be taken as they are."""
    if not options.sweep and options.repeat is None:
        return []
    scenes = [one for one in inputs if one.kind.name == "scene"]
    if not scenes:
        raise UsageError("--sweep and --repeat are about scenes (.toml); name one, or leave them out")
    variants = grid([parse_sweep(word) for word in options.sweep or []])
    repeat = options.repeat or 1
    if len(variants) * repeat > MOST:
        raise UsageError(f"--sweep with --repeat makes more than {MOST} members; make the grid smaller")
    for one in scenes:
        _check(one.path, variants[0])
    return list(enumerate((variant for variant in variants for _ in range(repeat)), start=1))


def _check(path: Path, variant: Variant) -> None:
    """Raise `SceneError` now for a sweep that no member of the scene could be made by."""
    import data_schemas

    member_of(data_schemas.load_scene(path), 1, variant)


def _shipped(word: str) -> str:
    """Path of a shipped scene that is named without one."""
    path = Path(word)
    if os.path.exists(path) or path.suffix or path.parent != Path(".") or any(mark in word for mark in "*?["):
        return word
    import synth

    return str(synth.scene_path(word))
