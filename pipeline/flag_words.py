"""Every flag of a result, as `flags.json` has it: what it says, and what to do about it."""

import json
from pathlib import Path
from typing import NamedTuple


class Words(NamedTuple):
    """What a flag says, and what to do."""

    meaning: str
    remedy: str
    blocks: bool = False  # whether records that bear it are reduced only where it is accepted


OF_GRAVITY, OF_FILM, OF_OTHERS = (
    {name: Words(**words) for name, words in group.items()}
    for group in json.loads(Path(__file__).with_name("flags.json").read_text(encoding="utf-8")).values()
)
"""Of gravity in the order in which they are listed; of the reading of a film; of a single trace and of synchrony."""
FLAGS = OF_GRAVITY | OF_FILM | OF_OTHERS
BLOCKING = tuple(name for name, words in FLAGS.items() if words.blocks)  # Those that make time or scale doubtful


def told(flag: str) -> str:
    """Meaning and remedy in one line."""
    words = FLAGS[flag]
    return f"{words.meaning}; {words.remedy}"
