"""The vehicles at one moment, and the conflicts among them."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import InitVar, dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.arguments import check_type, number
from intersection_env.maps.intersection import Intersection

FLOAT_FIELDS = ("position", "speed", "length", "width", "max_speed")
MEMORY_DTYPES = {"delta": np.bool_, "hold": np.int16, "waited": np.int32}


class Vehicle(NamedTuple):
    """One vehicle, for people who write traffic by hand."""

    id: str
    """Its name, each once in a traffic."""
    route: str
    """A route's id, as "SW-NE"."""
    position: float
    """Arc length of the vehicle's centre along its route [m]."""
    speed: float
    """[m/s]"""
    length: float = 4.5
    """[m]"""
    width: float = 1.8
    """[m]"""
    max_speed: float = float("inf")
    """A top speed of its own [m/s]; bicycles: 5."""


@dataclass(frozen=True, eq=False)
class Traffic:
    """Vehicles on the routes of an intersection, at one moment. The arrays are copied, and read-only.

    Args:
        intersection: the map.
        ids: (vehicle,) names, each once.
        route: (vehicle,) int32, indices into `intersection.routes`.
        position: (vehicle,) float32, arc length of each vehicle's centre [m].
        speed: (vehicle,) float32 [m/s], not negative.
        length, width: (vehicle,) float32 [m].
        max_speed: (vehicle,) float32, each vehicle's own top speed [m/s]; unbounded by default. Bicycles: 5.
        delta, hold: (vehicle,) bool and int16, what each vehicle remembers from a prediction: whether it enters, and
            whom it lets go while it waits itself (yielders of routes below that rank; -1: nobody). Both, or neither:
            then they follow from positions and speeds. `Prediction.traffic_at` gives them.
        waited: (vehicle,) int32, beside them where the map has stops: for how many steps it has stopped at its line or
            gone on from there; 0: not yet. Without, nobody has.
        patience: (vehicle,) float32, the logit that a gap network's must exceed before each driver accepts a gap: 0 for
            the median driver. None: what the predictor has them keep. `Predictor.patience_of` gives it.
        doubting: whether to warn of speeds that can hardly be in m/s.

    Bodies may overlap, as perception gives them at times (a bicycle beside a car, 10 cm into a lead): `overlaps` names
    the pairs. Who overlaps somebody is predicted like everybody else, and drives behind whoever's centre is ahead; the
    two of a pair do not count in distances. `UserWarning` names vehicles that are more than twice as fast as the map
    allows where they are: speeds are in m/s.

    Raises:
        TypeError: an array of another dtype, an id that is no string, or no `Intersection`.
        ValueError: shapes that differ, a value out of range, one memory without the other, or an id twice.
    """

    intersection: Intersection
    ids: tuple[str, ...]
    route: NDArray[np.int32]
    position: NDArray[np.float32]
    speed: NDArray[np.float32]
    length: NDArray[np.float32]
    width: NDArray[np.float32]
    max_speed: NDArray[np.float32] = field(default=None)  # type: ignore[arg-type]
    delta: NDArray[np.bool_] | None = None
    hold: NDArray[np.int16] | None = None
    waited: NDArray[np.int32] | None = None
    patience: NDArray[np.float32] | None = None
    doubting: InitVar[bool] = True
    core: _core.Traffic = field(init=False, repr=False, compare=False)
    conflicts: NDArray[np.int32] = field(init=False, repr=False, compare=False)
    """(pair, 2): indices of every pair still open, the one that yields by rule first."""
    overlaps: tuple[tuple[str, str], ...] = field(init=False, repr=False, compare=False)
    """Pairs of ids of vehicles whose bodies overlap."""

    def __post_init__(self, doubting: bool) -> None:
        if self.max_speed is None:
            object.__setattr__(self, "max_speed", np.full(len(self.ids), np.inf, np.float32))
        if not isinstance(self.intersection, Intersection):
            raise TypeError(f"intersection is {self.intersection!r}; wanted an Intersection (Intersection.load)")
        self._check_arrays()
        for name in self._array_names():
            own = np.array(getattr(self, name), order="C")
            own.setflags(write=False)
            object.__setattr__(self, name, own)
        core_map = self.intersection.core
        with naming(self.ids):
            core = _core.Traffic(core_map, **{name: getattr(self, name) for name in self._array_names()})
        overlaps = tuple((self.ids[a], self.ids[b]) for a, b in _core.overlaps(core_map, core))
        object.__setattr__(self, "core", core)
        object.__setattr__(self, "conflicts", _core.conflicts(core_map, core))
        object.__setattr__(self, "overlaps", overlaps)
        for vehicle in _core.doubted_speeds(core_map, core) if doubting else ():
            speed = float(self.speed[vehicle])
            warnings.warn(
                f"vehicle {self.ids[vehicle]}: a speed of {speed:g} m/s is {3.6 * speed:.0f} km/h, more than twice"
                " what the map allows there; are speeds given in km/h?",
                stacklevel=4,
            )

    def _array_names(self) -> tuple[str, ...]:
        optional = (name for name in (*MEMORY_DTYPES, "patience") if getattr(self, name) is not None)
        return ("route", *FLOAT_FIELDS, *optional)

    def _check_arrays(self) -> None:
        if (self.delta is None) != (self.hold is None):
            raise ValueError("memories need both delta and hold, or neither")
        if self.waited is not None and self.hold is None:
            raise ValueError("waited needs the other memories, delta and hold")
        dtypes = {"route": np.int32, **dict.fromkeys((*FLOAT_FIELDS, "patience"), np.float32), **MEMORY_DTYPES}
        for name in self._array_names():
            array, wanted = getattr(self, name), dtypes[name]
            if not isinstance(array, np.ndarray) or array.dtype != wanted:
                came = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
                raise TypeError(f"{name} must be an array of {wanted.__name__}, not {came}")
            if array.shape != (len(self.ids),):
                raise ValueError(f"{name} must have shape ({len(self.ids)},), one entry an id, not {array.shape}")
        for one in self.ids:
            if not isinstance(one, str):
                raise TypeError(f"ids must be strings, not {one!r}")
        twice = [one for one in self.ids if self.ids.count(one) > 1]
        if twice:
            raise ValueError(f'the id "{twice[0]}" names two vehicles')

    @classmethod
    def of(cls, intersection: Intersection, vehicles: Iterable[Vehicle]) -> Traffic:
        """The traffic of vehicles written by hand.

        Raises:
            TypeError: no loaded intersection, what is no vehicle, or a text instead of a number.
            ValueError: no such route, or a value out of range.
        """
        if not isinstance(intersection, Intersection):
            raise TypeError(f"intersection is {intersection!r}; wanted an Intersection (Intersection.load)")
        rows = list(vehicles)
        for row in rows:
            check_type("vehicles holds an entry that", row, Vehicle)
        columns: dict[str, Any] = {
            name: np.array([number(f"{name} of vehicle {row.id}", getattr(row, name)) for row in rows], np.float32)
            for name in FLOAT_FIELDS
        }
        route = np.array([intersection.route_index(row.route) for row in rows], dtype=np.int32)
        return cls(intersection, tuple(row.id for row in rows), route, **columns)

    def index(self, vehicle_id: str) -> int:
        """The index of a vehicle, by its id.

        Raises:
            ValueError: no vehicle has that id.
        """
        if vehicle_id not in self.ids:
            raise ValueError(f'no vehicle "{vehicle_id}" in this traffic; there are {", ".join(self.ids)}')
        return self.ids.index(vehicle_id)

    def assign(self, priorities: Sequence[tuple[str, str]]) -> NDArray[np.int8]:
        """The assignment (pair,) in which, for each (first, second) of vehicle ids, first goes before second.

        Raises:
            ValueError: an unknown vehicle, or two vehicles that do not conflict.
        """
        assignment = np.zeros(len(self.conflicts), np.int8)
        for pair in priorities:
            if not isinstance(pair, tuple) or len(pair) != 2:
                raise ValueError(f"priorities must be pairs (first, second) of vehicle ids, not {pair!r}")
            first_id, second_id = pair
            first, second = self.index(first_id), self.index(second_id)
            yields = (self.conflicts == (first, second)).all(axis=1)
            has_priority = (self.conflicts == (second, first)).all(axis=1)
            if not (yields | has_priority).any():
                raise ValueError(f'vehicles "{first_id}" and "{second_id}" do not conflict: no priority to assign')
            wanted = yields.astype(np.int8) - has_priority
            if (assignment * wanted < 0).any():
                raise ValueError(f'"{first_id}" and "{second_id}" are each told to go before the other')
            assignment[wanted != 0] = wanted[wanted != 0]
        return assignment

    def words(self, assignment: NDArray[np.int8]) -> tuple[tuple[str, str], ...]:
        """An assignment (pair,) as (first, second) vehicle ids; the inverse of `assign`."""
        pairs = zip(self.conflicts, assignment, strict=True)
        ordered = ((pair if way > 0 else pair[::-1]) for pair, way in pairs if way)
        return tuple((self.ids[first], self.ids[second]) for first, second in ordered)

    def __len__(self) -> int:
        return len(self.ids)

    def __reduce__(self) -> tuple[type[Traffic], tuple[object, ...]]:
        arrays = (getattr(self, name) for name in ("route", *FLOAT_FIELDS, *MEMORY_DTYPES, "patience"))
        return Traffic, (self.intersection, self.ids, *arrays)


class naming:  # noqa: N801, a context manager reads as a verb
    """Puts vehicle ids in place of indices ("vehicle 3") in the core's errors."""

    def __init__(self, ids: Sequence[str]) -> None:
        self._ids = ids

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, ValueError):
            message = re.sub(r"\bvehicle (\d+)", lambda found: f"vehicle {self._ids[int(found[1])]}", str(error))
            raise ValueError(message) from None
