"""Speed limits as maps write them."""

from __future__ import annotations

from data.formats.xml_tree import number

UNITS = {"mph": 0.44704, "km/h": 1.0 / 3.6, "kmh": 1.0 / 3.6, "kph": 1.0 / 3.6, "m/s": 1.0}
"""[m/s], by a unit's name."""
MOST = 60.0  # [m/s], ours: nobody may drive so fast; more is another unit


def speed_limit(where: str, text: str | None, unit: str) -> float:
    """A limit [m/s]: a number of `unit`, or one with its own unit, as "40mph".

    Raises:
        ValueError: it is no number, not above 0 or more than roads have; the message begins with `where`.
    """
    plain = (text or "").replace(" ", "")
    for name in UNITS:
        if plain.endswith(name):
            plain, unit = plain.removesuffix(name), name
            break
    value = UNITS[unit] * number(f"{where}, speed limit", plain or None)
    if not 0.0 < value <= MOST:
        raise ValueError(f'{where}, speed limit: "{text}" is {value:g} m/s; wanted more than 0 and at most {MOST:g}')
    return value
