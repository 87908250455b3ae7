"""Values of a map source's file, checked by kind: objects, words, numbers, points.

What is none of its kind is a ValueError that begins with `where` it stands in the file.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from intersection_env.maps.curve import Points

LARGEST = 2000.0  # [m], ours: local metres; a farther point has another origin, and would take minutes to compile
MOST_LOCATION = 1_000_000  # ours: inD's ids are of one digit, ours of three


def each_key_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of the file; JSON's own reader would keep the last of equal keys.

    Raises:
        ValueError: a key is there twice.
    """
    content: dict[str, Any] = {}
    for key, value in pairs:
        if key in content:
            raise ValueError(f'"{key}" is there twice in one object')
        content[key] = value
    return content


def entries(content: dict[str, Any], key: str) -> dict[str, Any]:
    """What stands under a key, by name.

    Raises:
        ValueError: no object stands there.
    """
    if key not in content:
        raise ValueError(f'"{key}" is missing; wanted an object')
    value = content[key]
    if not isinstance(value, dict):
        raise ValueError(f'"{key}" must be an object, not {type(value).__name__}')
    return value


def check_object(where: str, value: Any, known: tuple[str, ...]) -> None:
    """Refuses what is no object, or has keys beside the known ones."""
    if not isinstance(value, dict):
        raise ValueError(f"{where} must be an object, not {type(value).__name__}")
    check_keys(where, value, known)


def check_keys(where: str, value: dict[str, Any], known: tuple[str, ...]) -> None:
    """Refuses an object with keys beside the known ones."""
    for key in value:
        if key not in known:
            raise ValueError(f'{where} has an unknown key "{key}"; wanted {", ".join(known)}')


def is_word(text: str) -> bool:
    """Whether the text is one word that can be printed."""
    return text.split() == [text] and text.isprintable()


def points_of(where: str, value: Any, least: int, most: int | None = None) -> Points:
    """(point, 2) [m], so many points, each apart from the one before."""
    try:
        points = np.array(value)
    except ValueError:  # rows of different lengths
        points = np.array(None)
    if points.dtype.kind not in "if":  # words, objects, whole numbers beyond 64 bits
        raise ValueError(f"{where} must be a list of [x, y]")
    points = points.astype(np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < least or (most and len(points) > most):
        raise ValueError(f"{where} must be at least {least} points [x, y], not an array of shape {points.shape}")
    if not np.isfinite(points).all() or (np.linalg.norm(np.diff(points, axis=0), axis=1) < 1e-3).any():
        raise ValueError(f"{where} must hold finite points in metres, each apart from the one before")
    far = np.flatnonzero((np.abs(points) > LARGEST).any(axis=1))
    if len(far):
        x, y = points[far[0]]
        raise ValueError(
            f"{where} holds [{x:g}, {y:g}]; wanted local metres, at most {LARGEST:g} from 0 (more is another origin)"
        )
    return points


def positive(where: str, value: Any) -> float:
    """A number above 0 and below 1000."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < 1e3:
        raise ValueError(f"{where} must be a positive number, not {value!r}")
    return float(value)


def check_locations(value: Any) -> tuple[int, ...]:
    """A map's locations.

    Raises:
        ValueError: they are no list of such numbers.
    """
    if not isinstance(value, list) or not all(type(one) is int and 0 <= one <= MOST_LOCATION for one in value):
        raise ValueError(f'"locations" must be a list of integers from 0 to {MOST_LOCATION}, not {value!r}')
    return tuple(value)
