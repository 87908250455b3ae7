"""The classes of road users that files name, those that the model knows, and the sizes that it takes."""

from __future__ import annotations

from data.recording import PEDESTRIAN
from intersection_env import _core

LEAST_SIZE = round(_core.LEAST_SIZE, 6)  # [m]; the core's is a float32
MOST = {"length": _core.MOST_LENGTH, "width": _core.MOST_WIDTH}  # [m]

CLASSES = {
    "car": "car",
    "van": "car",
    "motorcycle": "car",
    "taxi": "car",
    "truck_bus": "truck_bus",
    "truck": "truck_bus",
    "bus": "truck_bus",
    "trailer": "truck_bus",
    "tram": "truck_bus",
    "bicycle": "bicycle",
    "pedestrian": PEDESTRIAN,
}
"""By a file's word, ours. A motorcycle drives where cars do, with its own narrow body; a trailer is a body of its own
where the file holds it as one; a tram fits a route only where its rails lie in a lane."""


def class_of(where: str, word: str) -> str:
    """Our class of a road user.

    Raises:
        ValueError: the word is unknown; the message begins with `where`.
    """
    if word not in CLASSES:
        raise ValueError(f'{where} is "{word}"; wanted one of {", ".join(CLASSES)}')
    return CLASSES[word]


def check_size(where: str, road_user: str, length: float, width: float) -> None:
    """Refuses a size [m] that the core refuses; people and bicycles may have none.

    Raises:
        ValueError: the message begins with `where`, as "07_tracksMeta.csv, line 3", and goes on with " of track 7".
    """
    least = 0.0 if road_user in (PEDESTRIAN, "bicycle") else LEAST_SIZE
    for name, size in (("length", length), ("width", width)):
        if not least <= size <= MOST[name]:
            place, _, track = where.partition(": ")
            raise ValueError(
                f"{place}: {name} of {track} ({road_user}) is {size:g} m; wanted {least:g} to {MOST[name]:g}"
            )
