"""Every flag of a result: what it says, and what to do; `flags` raises them, results and the command line tell them."""

from __future__ import annotations

from typing import NamedTuple


class Words(NamedTuple):
    """What a flag says, and what to do."""

    meaning: str
    remedy: str
    blocks: bool = False  # whether records that bear it are reduced only where it is accepted


OF_GRAVITY = {
    "beats-through-zero": Words("the difference's amplitude passes near zero, where its phase means nothing",
        "trust joint, complex, projection and shooting; release the pendulums with unequal arcs"),
    "short-record": Words("shorter than 300 s: beat and damping are hardly told from the frequency",
        "record half an hour"),
    "frequency-difference-unresolved": Words("the stated uncertainty of the periods costs more than the reading noise",
        "measure the pendulums' periods better at the base; sigma holds it"),
    "noise-above-stated": Words("the residual is noisier than record/elongation_uncertainty says",
        "state the noise as it is, or leave it out"),
    "noise-below-stated": Words("the residual is quieter than record/elongation_uncertainty says",
        "state the noise as it is, or leave it out"),
    "residual-not-white": Words("the residual has structure near the pendulum's frequency; sigma is widened by it",
        "compare with joint"),
    "gravity-implausible": Words("gravity outside 9.75 to 9.85 m/s2",
        "check instrument/period, instrument/reference_gravity and the time axis"),
    "acceleration-not-reduced": Words(
        "the support's acceleration changes the period of real pendulums, and the method does not reduce it",
        "use joint, shooting or general"),
    "correction-without-uncertainty": Words(
        "a correction is made from inputs that state no uncertainty; sigma holds 1 % of it",
        "state X_uncertainty beside each input X; the ledger names them"),
    "damping-difference-assumed": Words(
        "no damping is stated and the pendulums decay; sigma holds what an unequal damping would do",
        "state instrument/damping_rate"),
    "random-kicks": Words(
        "the pendulums' phases walk at random, as turbulent air or a knife edge makes them; sigma holds it",
        "look at vacuum and knife edges"),
    "gravity-changes": Words("gravity changes over the record; its mean is stated",
        "read gravity along the track in group course"),
    "friction-not-viscous": Words("friction that is not viscous was found and reduced", "look at the knife edges"),
    "apparatus-fault": Words(
        "a wrong zero, drift, gain, delay, period or a step was found and reduced; the reason names it",
        "state the constant with its uncertainty, or mend the apparatus"),
    "rewritten": Words("the record was written again by other software; whether it was changed is not known",
        "process the original, or write it with data_schemas.write if the change was meant"),
    "errors-not-white": Words("the prediction errors exceed every explanation that was tried; sigma is widened by it",
        "look at the residual and its spectrum (isochrony plot)"),
}  # fmt: skip
"""In the order in which they are listed."""
OF_FILM = {
    "marks-without-minute-code": Words("no minute code was found: the count of marks is checked by the pendulums alone",
        "compare with the log"),
    "marks-direction-unknown": Words("the marks do not tell in which direction the film ran",
        "say how time runs with --orientation"),
    "marks-codes-disagree": Words("a minute code is out of step with the count of marks: the film may have stood still",
        "look at the film there, and read the parts one by one", blocks=True),
    "film-stood-still": Words("the paper stood still; for how long is told by codes, pendulums and the bar's light",
        "none is needed"),
    "paper-wandered": Words(
        "the paper moved sideways or has creases, as all traces show at once; that is taken off, creases are left out",
        "none is needed"),
    "film-cut": Words("how many marks passed somewhere is not known: the longest part is read, the others have no time",
        "read the other parts one by one"),
    "dpi-disagrees": Words(
        "marks and dpi give another speed than the nominal one, by more than 3 %: all angles may be wrong by as much",
        "check --dpi, --mark-interval and --speed", blocks=True),
    "marks-offset-unsure": Words("the traces' offset along the film may be wrong by the distance of one mark",
        "measure the optics' offset"),
    "marks-beside-traces": Words(
        "the marks lie beside the traces: the times of each trace may be wrong by what it lies off them along the film",
        "measure the optics' offset"),
    "marks-many-missing": Words("more than a tenth of the marks were not found", "scan with more contrast"),
    "marks-long-gap": Words("over more than five seconds no mark was found", "look at the film there"),
    "marks-false": Words("gaps were found that are neither marks nor minute codes", "clean the film"),
    "marks-one-trace": Words("only one trace shows the marks", "scan with more contrast"),
    "readings-disagree": Words("the reading of the lines and that at the marks contradict each other",
        "look at both with isochrony plot, or read it at the marks (--reading strobe); sigma holds the difference"),
}  # fmt: skip
OF_OTHERS = {
    "single-trace": Words("one trace gives a period; gravity at sea needs two pendulums",
        "record a difference, or state length on land"),
    "amplitude-scale": Words("the period's trend with its arc asks for another scale of the angles, which is applied",
        "calibrate the angles"),
    "period-trend": Words("the period reduced to infinitesimal arc drifts over the record",
        "look for drifting temperature or knife edges"),
    "unsure-verdict": Words("the verdict of synchrony is little more likely than others", "record for longer"),
}  # fmt: skip
"""Of a single trace and of synchrony."""
FLAGS = OF_GRAVITY | OF_FILM | OF_OTHERS
BLOCKING = tuple(name for name, words in FLAGS.items() if words.blocks)  # Those that make time or scale doubtful


def told(flag: str) -> str:
    """Meaning and remedy in one line."""
    words = FLAGS[flag]
    return f"{words.meaning}; {words.remedy}"
