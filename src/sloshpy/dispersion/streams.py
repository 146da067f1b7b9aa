"""Streams of numbers in (0, 1), one for each name: a case's number depends on seed, name and case number alone.

Philox is a function of key and counter, not a sequence: the key is the hash of seed and name, the counter is the number
of the case. So neither order, block, number of workers nor another parameter changes a draw.

Salmon, Moraes, Dror and Shaw, Parallel random numbers: as easy as 1, 2, 3 (SC11); Burley, Practical hash-based Owen
scrambling (JCGT 9(4), 2020).
"""

import hashlib

import numpy as np
from numpy.typing import NDArray

from sloshpy.units import Array

MOST_CASES = 2**32  # of a Sobol' point's 32 digits
_Words = NDArray[np.uint64]


def random_stream(seed: int, name: str, first: int, count: int) -> Array:
    """Return independent numbers in (0, 1) for the cases first, first + 1, ...; (count,)."""
    return np.asarray(((_words(seed, name, first, count) >> np.uint64(11)) + 0.5) * 2.0**-53)


def sobol_stream(seed: int, name: str, first: int, count: int) -> Array:
    """Return numbers in (0, 1) evenly spread for each name by itself: Owen-scrambled one-dimensional Sobol' points.

    The first 2^k cases have one number in each of 2^k equal parts. Each name shuffles the case numbers by itself
    (within aligned blocks of every power of two), so that two names are independent of each other: the joint net of a
    Sobol' sequence of many dimensions is given up, since in it a point depends on how many there are.
    """
    place = np.arange(first, first + count, dtype=np.uint64)
    place = _scrambled(place, _key(seed, f"{name}\norder"))
    point = _scrambled(_reversed(place), _key(seed, f"{name}\npoint"))
    below = _words(seed, f"{name}\nbelow", first, count) >> np.uint64(43)  # 21 digits more
    return np.asarray(((point << np.uint64(21)) + below + 0.5) * 2.0**-53)


def _key(seed: int, name: str) -> int:
    return int.from_bytes(hashlib.sha256(f"sloshpy stream 1\n{seed}\n{name}".encode()).digest()[:16], "little")


def _words(seed: int, name: str, first: int, count: int) -> _Words:
    """Return the first of four words of Philox4x64-10 at the counters first + 1, ... (NumPy counts before it draws)."""
    generator = np.random.Philox(key=_key(seed, name), counter=first)
    return np.asarray(generator.random_raw(4 * count)[::4], dtype=np.uint64)


def _reversed(x: _Words) -> _Words:
    """Return 32 binary digits in reverse."""
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF)):
        s, m = np.uint64(shift), np.uint64(mask)
        x = ((x >> s) & m) | ((x & m) << s)
    return x


def _scrambled(x: _Words, key: int) -> _Words:
    """Return 32 binary digits, each flipped or not by a hash of those above it: Owen's nested uniform scrambling."""
    result = np.zeros_like(x)
    for digit in range(32):
        above = x >> np.uint64(32 - digit)
        salt = np.uint64((key + 0x9E3779B97F4A7C15 * (digit + 1)) & 0xFFFFFFFFFFFFFFFF)
        flip = _hashed(above ^ salt) >> np.uint64(63)
        bit = (x >> np.uint64(31 - digit)) & np.uint64(1)
        result |= (bit ^ flip) << np.uint64(31 - digit)
    return result


def _hashed(x: _Words) -> _Words:
    """Return the finaliser of splitmix64."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
