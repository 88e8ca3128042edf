"""What an observer knows of a film, in TOML: read back as written, faults named."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data_schemas import validate
from data_schemas.errors import FileError, RecordError
from data_schemas.film_description import FilmDescription, load_description
from data_schemas.scene_recording import Film
from data_schemas.text_files import toml_text

KNOWN = {
    "record_id": "night",
    "speed": 5.0,
    "traces": [
        {"name": "1", "combination": {"1": 1.0}, "lever": 2000.0},
        {"name": "1-2", "combination": {"1": 1.0, "2": -1.0}},
    ],
    "pendulums": [{"label": "1", "period": 1.01, "damping_rate": 1e-4}, {"label": "2", "period": 1.0101}],
    "instrument": {"reference_gravity": 9.81, "latitude": 12.0},
}

BASE = {"label": "a", "time": -60.0, "gravity": 9.81, "period": {"1": 1.01, "2": 1.0101}}
WARM = {"time": 0.0, "temperature": 290.0}


def test_reading_back(tmp_path):
    known = FilmDescription.model_validate(KNOWN)
    path = tmp_path / "a.film.toml"
    path.write_text(toml_text(known.model_dump()))
    assert load_description(path) == known
    assert validate(path) == []
    assert known.instrument.reference_gravity == 9.81
    assert known.pendulums[1].damping_rate is None


def test_bases_and_readings_are_read_back(tmp_path):
    known = FilmDescription.model_validate(KNOWN | {"bases": [BASE], "readings": [WARM]})
    path = tmp_path / "a.film.toml"
    path.write_text(toml_text(known.model_dump()))
    assert load_description(path) == known
    assert known.bases[0].period == BASE["period"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"sped": 5.0}, "sped = 5.0 is not a known key; did you mean 'speed'?"),
        ({"speed": -5.0}, "speed = -5.0: should be greater than 0"),
        ({"traces": [{"name": "a", "combination": {"3": 1.0}}]}, "trace 'a' names the pendulum '3'; there are 1, 2"),
        ({"pendulums": KNOWN["pendulums"][:1] * 2}, "traces and pendulums must have different names"),
        (
            {"pendulums": [{"label": "1", "perid": 1.0}]},
            "pendulums[0].perid = 1.0 is not a known key; did you mean 'period'?",
        ),
        ({"traces": []}, "traces = []: "),
        ({"bases": [BASE, BASE]}, "bases must have different labels"),
        (
            {"bases": [BASE, BASE | {"label": "b", "gravity_uncertainty": 1e-6}]},
            "gravity_uncertainty is stated of 1 of 2",
        ),
        ({"bases": [BASE | {"period": {"1": 1.0}}]}, "base 'a' states period of 1; the pendulums are 1, 2"),
        ({"readings": [WARM, WARM]}, "readings must be in order of time"),
        ({"readings": [{"time": 1.0}]}, "a reading must hold temperature"),
        (
            {"instrument": {"temperature": 280.0}, "readings": [WARM]},
            "temperature is stated in instrument and in readings; leave one of them out",
        ),
        (
            {"instrument": {"reference_gravity": "9.81"}},
            "instrument.reference_gravity = '9.81': should be a valid number",
        ),
    ],
)
def test_faults_are_named(tmp_path, change, told):
    path = tmp_path / "a.film.toml"
    path.write_text(toml_text({"kind": "film-description"} | KNOWN | change))
    with pytest.raises(RecordError) as fault:
        load_description(path)
    assert told in str(fault.value)
    assert "\n" not in str(fault.value)
    assert validate(path) == [str(fault.value)]


def test_what_is_no_description(tmp_path):
    path = tmp_path / "a.film.toml"
    with pytest.raises(FileError, match="cannot be read"):
        load_description(path)
    path.write_text("speed = = 2")
    with pytest.raises(FileError, match="is not TOML"):
        load_description(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(FileError, match="not text in UTF-8"):
        load_description(path)


SCALARS = st.one_of(st.floats(allow_nan=False), st.integers(-(2**63), 2**63 - 1), st.booleans(), st.text())
NAMES = st.text(min_size=1)
TABLES = st.dictionaries(NAMES, st.one_of(SCALARS, st.lists(SCALARS), st.dictionaries(NAMES, SCALARS)))


@settings(max_examples=60)
@given(st.dictionaries(NAMES, st.one_of(SCALARS, st.lists(SCALARS), TABLES, st.lists(TABLES, min_size=1))))
def test_toml_is_read_back_as_it_was(content):
    assert tomllib.loads(toml_text(content)) == content


@pytest.mark.parametrize(
    ("film", "told"),
    [
        ({"gap": 0.3}, "gap must be at most half of mark_interval"),
        ({"minute_code": 0.49}, "minute_code must be longer than the gap"),
        ({"wow": 0.5, "drift": -0.5}, "would stop the film"),
        ({"fog": 1.4, "fog_gradient": 0.2}, "density_max must be above the fog"),
        ({"traces": [{"name": "1"}, {"name": "1"}]}, "traces must have different names"),
        ({"blackouts": [[3, 2]]}, "stop must be after start"),
        ({"dimmings": [[3, 4]]}, "factor"),
        ({"bits": 12}, "8 or 16"),
    ],
)
def test_films_that_cannot_be(film, told):
    with pytest.raises(ValueError, match=told):
        Film.model_validate(film)


def test_stretches_are_pairs_and_triples():
    film = Film.model_validate({"blackouts": [[1, 2]], "dimmings": [[3, 4, 0.15]]})
    assert (film.blackouts[0].start, film.dimmings[0].factor) == (1.0, 0.15)


def test_every_key_of_a_film_is_explained():
    text = (Path(__file__).parents[2] / "docs" / "film.md").read_text(encoding="utf-8")
    for name, field in Film.model_fields.items():
        assert f"| `{name}` | {field.json_schema_extra['unit']} |" in text
        assert field.description in text
