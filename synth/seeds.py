"""Chance, by name: each use has a generator of its own, so that a further use changes no other."""

import hashlib

import numpy as np


def generator(seed: int, name: str) -> np.random.Generator:
    """Random numbers for one use, from the scene's seed; the same name gives the same numbers."""
    words = np.frombuffer(hashlib.sha256(name.encode()).digest(), dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(int(word) for word in words)))
