"""The scenes of an ensemble: one scene, and what varies from member to member.

A member depends on the ensemble's seed and its own number only: not on how many members there are, in which order or by
how many processes they are made. Each varied key draws from a generator of its own, so that a further one changes no
other.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import ValidationError

from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from data_schemas.scene_fields import one_line
from synth.seeds import generator

Range = tuple[float, float]
Vary = Mapping[str, Range | Callable[[np.random.Generator], Any]]
"""What varies: keys of a scene by dotted path, such as ``pendulums.0.start.phase``, lists counted from 0. A pair is
drawn from evenly (ends included for whole numbers); a callable is given a generator of random numbers."""

_OWN = ("seed", "record_id")  # every member has its own anyway


def members(scene: Scene, count: int, *, seed: int | None = None, vary: Vary | None = None) -> Iterator[Scene]:
    """Scenes of the members 1 to `count`.

    `SceneError` if a key or range cannot be meant, at once; if a member's values are not allowed, when it is reached.

    Parameters
    ----------
    scene
        What they share.
    count
        How many.
    seed
        Of the ensemble; the scene's own if left out.
    vary
        See `Vary`.

    Returns
    -------
    iterator of Scene
        Their `record_id` ends with the member's number, such as ``-0001``.

    Examples
    --------
    >>> from data_schemas.scene import load_scene
    >>> from synth import scene_path
    >>> linear = load_scene(scene_path("linear"))
    >>> [one.record_id for one in members(linear, 2)]
    ['linear-0001', 'linear-0002']
    >>> one, two = members(linear, 2, vary={"pendulums.0.start.phase": (0.0, 6.28)})
    >>> one.pendulums[0].start.phase != two.pendulums[0].start.phase
    True
    """
    if count < 1:
        raise SceneError(f"an ensemble of {count} members; ask for 1 or more")
    given = scene.model_dump()
    for key, how in (vary or {}).items():
        _checked(key, how, _place(given, key))
    return (member(scene, number, seed=seed, vary=vary) for number in range(1, count + 1))


def member(scene: Scene, number: int, *, seed: int | None = None, vary: Vary | None = None) -> Scene:
    """Scene of one member, counted from 1; see `members`."""
    whole = np.random.SeedSequence(scene.seed if seed is None else seed, spawn_key=(number,))
    own = int(whole.generate_state(1, np.uint64)[0] >> np.uint64(1))
    values = scene.model_dump() | {"seed": own, "record_id": f"{scene.record_id}-{number:04d}"}
    for key, how in (vary or {}).items():
        section, last = _place(values, key)
        chance = generator(own, f"vary {key}")
        section[last] = how(chance) if callable(how) else _drawn(chance, how, section[last])
    try:
        return Scene.model_validate(values)
    except ValidationError as error:
        raise SceneError(f"member {number}: {one_line(error, Scene)}") from None


def value(scene: Scene, key: str) -> Any:
    """Value of a scene's key by dotted path."""
    section, last = _place(scene.model_dump(), key)
    return section[last]


def _place(values: dict[str, Any], key: str) -> tuple[Any, Any]:
    """The section or list that holds a key, and its place there; lists are made changeable on the way.

    `SceneError` if there is no such key.
    """
    section: Any = None
    within: Any = values
    place: Any = None
    for word in key.split("."):
        if isinstance(within, tuple):
            within = section[place] = list(within)
        section = within
        if isinstance(section, dict) and word in section:
            place = word
        elif isinstance(section, list) and word.isascii() and word.isdigit() and int(word) < len(section):
            place = int(word)
        else:
            raise SceneError(f"vary {key}: {_absent(word, section)}")
        within = section[place]
    return section, place


def _absent(word: str, section: Any) -> str:
    if isinstance(section, dict) and section:
        near = difflib.get_close_matches(word, list(section), n=1, cutoff=0.0)
        return f"there is no {word!r} in this scene; did you mean {near[0]!r}?"
    if isinstance(section, list) and section:
        return f"{word!r} is none of its parts, which are counted from 0 to {len(section) - 1}"
    return f"there is nothing below it; leave {word!r} out, or give the scene what is to vary"


def _checked(key: str, how: Range | Callable[..., Any], place: tuple[Any, Any]) -> None:
    section, last = place
    now = section[last]
    if key in _OWN:
        raise SceneError(f"vary {key}: every member has its own anyway; leave it out")
    if callable(how):
        return
    if isinstance(now, bool | dict | list | tuple) or (isinstance(now, str) and _ratio(now) is None):
        raise SceneError(f"vary {key}: is no number; name a key that holds one")
    low, high = how
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise SceneError(f"vary {key}: the range {low:g} to {high:g} is empty; give the lower end first")
    if isinstance(now, int) and not (float(low).is_integer() and float(high).is_integer()):
        raise SceneError(f"vary {key}: takes whole numbers; give whole ends, not {low:g} and {high:g}")


def _drawn(chance: np.random.Generator, how: Range, now: Any) -> float | int | Fraction:
    low, high = how
    if isinstance(now, int):
        return int(chance.integers(int(low), int(high), endpoint=True))
    drawn = float(chance.uniform(low, high))
    # rates are ratios of whole numbers, and a double is one with too long a denominator
    return Fraction(drawn).limit_denominator(10**9) if isinstance(now, str) else drawn


def _ratio(text: str) -> Fraction | None:
    """What a scene writes for a rate, such as 25 or 25/3."""
    try:
        return Fraction(text)
    except (ValueError, ZeroDivisionError):
        return None
