"""Files of a wheel have the same modes whatever umask they were checked out under, so that it is the same bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel


class Wheel(bdist_wheel):
    """As setuptools builds one."""

    def write_wheelfile(self, *given: Any, **named: Any) -> None:
        """Write the last file of a wheel before it is packed."""
        super().write_wheelfile(*given, **named)
        for path in Path(self.bdist_dir).rglob("*"):
            path.chmod(0o755 if path.is_dir() else 0o644)


setup(cmdclass={"bdist_wheel": Wheel})
