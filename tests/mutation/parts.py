"""The parts that are tested by mutation: their files, and the tests that belong to each, the fastest first."""

from __future__ import annotations

from typing import NamedTuple


class Part(NamedTuple):
    """Patterns below the root of the repository."""

    files: tuple[str, ...]
    tests: tuple[str, ...]


PARTS = {
    "ledger": Part(
        ("pipeline/ledger/*.py", "pipeline/batch/ledger.py", "pipeline/batch/campaign.py"),
        (
            "tests/pipeline/ledger/test_*.py",
            "tests/pipeline/test_gravity_and_ledger.py",
            "tests/batch/test_batch_ledger.py",
            "tests/batch/test_batch_resume.py",
        ),
    ),
    "writer": Part(
        tuple(f"data_schemas/{name}.py" for name in ["writing", "checksum", "encoding", "appending", "shield"]),
        tuple(
            f"tests/data_schemas/test_{name}.py"
            for name in ["encoding", "checksum", "sink", "shield", "round_trip", "atomic", "write_faults", "appending"]
        ),
    ),
    "guard": Part(
        tuple(f"data_schemas/{name}.py" for name in ["guard", "heaps", "text_files", "reading"]),
        tuple(
            f"tests/data_schemas/test_{name}.py"
            for name in [
                "checksum",
                "heaps",
                "hostile_scenes",
                "hostile_values",
                "bounds",
                "round_trip",
                "hostile_text",
                "hostile",
                "foreign",
                "other_software",
                "damage",
            ]
        ),
    ),
    "formulas": Part(
        (
            "pipeline/phase_speed.py",
            "pipeline/harmonics/*.py",
            "pipeline/quantities.py",
            "pipeline/correction.py",
            "pipeline/ledger/earth.py",
            "pipeline/methods/*.py",
            "synth/systems/driven_pendulums.py",
            "synth/systems/resistance.py",
            "synth/systems/terms.py",
        ),
        (
            "tests/pipeline/test_anomaly.py",
            "tests/pipeline/test_phase_speed.py",
            "tests/pipeline/harmonics/test_*.py",
            "tests/pipeline/identity/test_projection_laws.py",
            "tests/synth/systems/test_*.py",
            "tests/reference/test_errata_panteleev.py",
            "tests/pipeline/test_methods_alone.py",
            "tests/pipeline/test_quantities*.py",
            "tests/pipeline/test_gravity_and_ledger.py",
            "tests/pipeline/identity/test_shooting.py",
            "tests/pipeline/test_methods.py",
        ),
    ),
}
