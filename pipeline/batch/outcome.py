"""What became of one input."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

Status = Literal["ok", "refused", "failed"]


@dataclass(frozen=True)
class Outcome:
    """What became of one input; a line of the ledger. "ok": at least one method gave a value."""

    key: str
    """Of the job, see `Config`."""
    status: Status
    error_class: str | None = None
    error: str | None = None
    """Why there is no value, in one line. Beside the names of exceptions: "Crashed", "TimedOut", "WorkerLost"."""
    input_sha256: str | None = None
    output_sha256: str | None = None
    """Of the files' bytes, where they were read and written."""
    rows: tuple[dict[str, Any], ...] = ()
    """What the summary says of each method."""
    seconds: float = 0.0

    def took(self, seconds: float) -> Outcome:
        """The same with its time."""
        return replace(self, seconds=round(seconds, 6))


def failure(key: str, error_class: str, error: str, input_sha256: str | None = None) -> Outcome:
    """Outcome of an input that gave nothing; the reason on one line of bounded length."""
    line = " ".join(error.split())
    return Outcome(key, "failed", error_class, line if len(line) <= 500 else line[:497] + "...", input_sha256)
