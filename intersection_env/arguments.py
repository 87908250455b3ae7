"""Arguments that come from outside, checked before anything is done with them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

MOST_SEED = 2**63 - 1
MOST_COUNT = 2**31 - 1  # the core's integers have 32 bits


def whole_number(name: str, value: object) -> int:
    """The value of an argument that counts something; what range it may have is for its owner to check.

    Raises:
        TypeError: no whole number; True and False are none either.
        ValueError: one that no count reaches.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool):
        raise TypeError(f"{name} is {value!r}; wanted a whole number")
    if abs(int(value)) > MOST_COUNT:
        raise ValueError(f"{name} is {value}; wanted at most {MOST_COUNT}")
    return int(value)


def number(name: str, value: object) -> float:
    """The value of an argument that measures something; what range it may have is for its owner to check.

    Raises:
        TypeError: no number; True and False are none either.
    """
    if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
        raise TypeError(f"{name} is {value!r}; wanted a number")
    return float(value)


def word(name: str, value: object, known: Sequence[str]) -> str:
    """The value of an argument that is one of some words; which of them there are is for its owner to check.

    Raises:
        TypeError: no string.
    """
    if not isinstance(value, str):
        raise TypeError(f"{name} is {value!r}; wanted {' or '.join(known)}")
    return value


def check_type(name: str, value: object, wanted: type) -> None:
    """Refuses what is of another type, such as arguments in the wrong order.

    Raises:
        TypeError: it is.
    """
    if not isinstance(value, wanted):
        raise TypeError(f"{name} is of type {type(value).__name__}; wanted a {wanted.__name__}")


def name_or_file(name: str, value: object, ships: Sequence[str]) -> Path:
    """The value of an argument that says what ships, by its name, or a file.

    Raises:
        TypeError: neither a string nor a path.
    """
    if not isinstance(value, str | os.PathLike):
        raise TypeError(f"{name} is {value!r}; wanted a name ({', '.join(ships)}), or the path of a file")
    return Path(value)


def file_there(name: str, path: Path, ships: Sequence[str]) -> Path:
    """The path of a file that is there.

    Raises:
        FileNotFoundError: it is not; the message says what ships in its place.
    """
    if not path.exists():
        raise FileNotFoundError(f'{name} "{path}": no such file; by name there are {", ".join(ships)}')
    return path


def check_seed(seed: object) -> int:
    """The seed.

    Raises:
        TypeError, ValueError: a seed that is no whole number from 0 to 2^63 - 1.
    """
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool):
        raise TypeError(f"seed is {seed!r}; wanted a whole number")
    if not 0 <= seed <= MOST_SEED:
        raise ValueError(f"seed is {seed}; wanted 0 to 2^63 - 1")
    return int(seed)
