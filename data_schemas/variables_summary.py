"""Rows of the table for the summary of a batch: one row an input and method, at the root of its file."""

from __future__ import annotations

from .variable import Variable

_ROW = ("row",)


def _text(long_name: str) -> Variable:
    return Variable(_ROW, "str", "1", long_name)


def _code(long_name: str) -> Variable:
    return Variable(_ROW, "u1", "1", long_name, required=True)


def _number(units: str, long_name: str) -> Variable:
    return Variable(_ROW, "f8", units, long_name, required=True, missing=True)


SUMMARY: dict[str, Variable] = {
    "record_id": _text("identity of the record"),
    "input": _text("input file"),
    "output": _text("result file, below the folder of the batch"),
    "error": _text("why there is no value"),
    "flags": _text("flags of the method, separated by blanks"),
    "status": _code("what became of the input by this method"),
    "error_class": _code("kind of the fault"),
    "requested_method": _code("method that was asked for"),
    "method": _code("method that was used"),
    "gravity_m_s2": _number("m s-2", "gravity"),
    "gravity_sigma_mgal": _number("mGal", "standard deviation of gravity"),
    "uncorrected_m_s2": _number("m s-2", "gravity without any correction"),
    "noise_sigma_mgal": _number("mGal", "standard deviation of gravity by reading noise alone"),
    "correction_mgal": _number("mGal", "sum of all corrections"),
    "difference_frequency_rad_s": _number("rad s-1", "mean phase speed of the difference, uncorrected"),
    "period_s": _number("s", "full period at infinitesimal arc"),
    "period_sigma_s": _number("s", "standard deviation of the period"),
    "samples_used": _number("1", "samples that were used"),
}
