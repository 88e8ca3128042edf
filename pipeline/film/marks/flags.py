"""What is to be distrusted of a time axis, by name."""

from __future__ import annotations

MEANINGS = {
    "marks-without-minute-code": "no minute code was found: the count of marks is checked by the pendulums alone",
    "marks-direction-unknown": "the marks do not tell in which direction the film ran",
    "marks-offset-unsure": "the traces' offset along the film may be wrong by the distance of one mark",
    "marks-many-missing": "more than a tenth of the marks were not found",
    "marks-long-gap": "over more than five seconds no mark was found",
    "marks-false": "gaps were found that are neither marks nor minute codes",
    "marks-one-trace": "only one trace shows the marks",
}
