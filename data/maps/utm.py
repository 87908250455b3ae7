"""From degrees to UTM metres.

Source: Karney, "Transverse Mercator with an accuracy of a few nanometers" (2011), Krüger's series to third order, which
is within a millimetre inside a zone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

AXIS, FLATTENING = 6378137.0, 1.0 / 298.257223563  # WGS84, [m] and 1
SCALE, FALSE_EAST, FALSE_NORTH = 0.9996, 500_000.0, 10_000_000.0  # UTM
ZONE = 6.0  # [degrees]

Floats = NDArray[np.float64]


def zone_of(longitude: float) -> int:
    """The UTM zone of a longitude [degrees]; the exceptions of Norway and Svalbard are not made."""
    return int((longitude + 180.0) // ZONE) % 60 + 1


def utm(latitude: Floats, longitude: Floats, zone: int) -> Floats:
    """East and north (point, 2) [m] of places (point,) [degrees] in one zone; north of the equator from 0."""
    third = FLATTENING / (2.0 - FLATTENING)
    radius = AXIS / (1.0 + third) * (1.0 + third**2 / 4.0 + third**4 / 64.0)
    series = (
        third / 2.0 - 2.0 * third**2 / 3.0 + 5.0 * third**3 / 16.0,
        13.0 * third**2 / 48.0 - 3.0 * third**3 / 5.0,
        61.0 * third**3 / 240.0,
    )
    eccentricity = np.sqrt(FLATTENING * (2.0 - FLATTENING))
    phi, away = np.radians(latitude), np.radians(longitude - (zone * ZONE - 183.0))
    conformal = np.sinh(np.arctanh(np.sin(phi)) - eccentricity * np.arctanh(eccentricity * np.sin(phi)))
    north = np.arctan2(conformal, np.cos(away))
    east = np.arcsinh(np.sin(away) / np.hypot(conformal, np.cos(away)))
    northing, easting = north.copy(), east.copy()
    for order, factor in enumerate(series, start=1):
        northing += factor * np.sin(2.0 * order * north) * np.cosh(2.0 * order * east)
        easting += factor * np.cos(2.0 * order * north) * np.sinh(2.0 * order * east)
    south = np.where(np.mean(latitude) < 0.0, FALSE_NORTH, 0.0)
    return np.stack([SCALE * radius * easting + FALSE_EAST, SCALE * radius * northing + south], axis=1)
