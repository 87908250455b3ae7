"""What is open in the viewer: places, scenes and a policy. JSON goes in, JSON comes out; no server is known here.

Everything that is shown as a number comes from here, and here from the core.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from intersection_env.constants import DT, STEPS
from intersection_env.maps.intersection import Intersection
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes
from intersection_env.viewer.asked import Asked, asked, text
from intersection_env.viewer.predicted import LEVELS, predicted
from intersection_env.viewer.ranked import ranked
from intersection_env.viewer.recorded import busiest_scene, busiest_step, scene_called, scene_of, step_of
from intersection_env.viewer.road import road_of

Answer = dict[str, Any]
EXAMPLE_DISTANCE, EXAMPLE_APART, EXAMPLE_SPEED = 14.0, 7.0, 7.0
"""[m] before its line, [m] more from arm to arm, [m/s]; ours: near enough to meet each other, but not all at once."""
EXAMPLE_LENGTH, EXAMPLE_WIDTH = 4.5, 1.8  # [m], as of `Vehicle`


@dataclass(frozen=True, eq=False)
class Place:
    """A map, and what is recorded on it, if anything is."""

    intersection: Intersection
    scenes: Scenes | None = None

    @cached_property
    def road(self) -> Answer:
        """As of `road_of`, made once."""
        return road_of(self.intersection)


class Session:
    """Answers what the page asks for. It holds nothing that an answer changes, so threads may share it."""

    def __init__(
        self,
        places: Sequence[Place],
        predictor: Predictor,
        scene: str | None = None,
        time: float | None = None,
    ) -> None:
        """A session on these places, which opens with the first one that has the scene, or the first at all.

        Args:
            places: each with a map of its own name.
            predictor: who drives.
            scene: the id of a scene; None: the one with the most vehicles at once.
            time: since that scene's begin [s]; None: the moment with the most open conflicts.

        Raises:
            ValueError: no places, two on one map, or a scene or time that is not there.
        """
        self.places = {place.intersection.name: place for place in places}
        if not places or len(self.places) < len(places):
            names = ", ".join(place.intersection.name for place in places) or "none"
            raise ValueError(f"places are {names}; wanted one or more, each on a map of its own name")
        self.predictor = predictor
        self._answers: dict[str, Callable[[Place, Mapping[str, Any]], Answer]] = {
            "road": lambda place, request: place.road,
            "scene": self._scene,
            "predicted": lambda place, request: predicted(predictor, self._asked(place, request)),
            "ranked": lambda place, request: ranked(predictor, self._asked(place, request)),
        }
        self.start = self._start(scene, time)

    def opened(self) -> Answer:
        """What there is: places with their scenes, the policy, and the numbers that all predictions share."""
        return {
            "policy": self.predictor.name,
            "forecasts": bool(self.predictor.core_policy.can_forecast),
            "step": DT,
            "steps": STEPS,
            "levels": list(LEVELS),
            "start": self.start,
            "places": [self._place(place) for place in self.places.values()],
        }

    def answer(self, kind: str, request: Mapping[str, Any]) -> Answer:
        """The answer to a request of the page: `road`, `scene`, `predicted`, `ranked`, each of a `place`.

        Raises:
            ValueError: what is asked for is not there, or cannot be; the message is a sentence for people.
        """
        if kind not in self._answers:
            raise ValueError(f'nothing answers "{kind}"; there are {", ".join(self._answers)}')
        name = text(request, "place")
        if name not in self.places:
            raise ValueError(f'place "{name}" is not open; there are {", ".join(self.places)}')
        return self._answers[kind](self.places[name], request)

    def _start(self, scene_id: str | None, time: float | None) -> Answer:
        """Where the page opens; on a map without scenes with a car from each arm."""
        having = [one for one in self.places.values() if one.scenes is not None]
        if scene_id is None and time is None and next(iter(self.places.values())).scenes is None:
            return {"place": next(iter(self.places)), "scene": None, "step": 0}
        if not having:
            raise ValueError("a scene or a moment is asked for, but nothing is recorded on these maps")
        place = next((one for one in having if _holds(one, scene_id)), having[0])
        assert place.scenes is not None
        scene = busiest_scene(place.scenes) if scene_id is None else scene_called(place.scenes, scene_id)
        step = busiest_step(place.scenes, scene) if time is None else step_of(scene, time)
        return {"place": place.intersection.name, "scene": scene.id, "step": step}

    def _scene(self, place: Place, request: Mapping[str, Any]) -> Answer:
        if place.scenes is None:
            raise ValueError(f"nothing is recorded on {place.intersection.name}")
        scene = scene_called(place.scenes, text(request, "scene"))
        return scene_of(scene) | {"busiest": busiest_step(place.scenes, scene)}

    def _asked(self, place: Place, request: Mapping[str, Any]) -> Asked:
        return asked(place.intersection, place.scenes, request)

    def _place(self, place: Place) -> Answer:
        scenes = [] if place.scenes is None else list(place.scenes)
        return {
            "name": place.intersection.name,
            "example": _example(place.intersection),
            "scenes": [
                {"id": one.id, "split": one.split, "duration": round(one.duration, 1), "vehicles": len(one.tracks)}
                for one in scenes
            ],
        }


def _holds(place: Place, scene_id: str | None) -> bool:
    return scene_id is None or any(scene.id == scene_id for scene in place.scenes or ())


def _example(intersection: Intersection) -> list[Answer]:
    """A car from each arm, on the route that meets the most others and does not lead back."""
    meets = Counter(route for one in intersection.conflicts for route in (one.yielder, one.prioritized))
    busiest = sorted(intersection.routes, key=lambda route: (route.entry != route.exit, meets[route.index]))
    routes = {route.entry: route for route in busiest}  # the last one of an arm
    return [
        {
            "id": arm,
            "route": route.id,
            "position": round(max(route.stop_line - EXAMPLE_DISTANCE - EXAMPLE_APART * number, EXAMPLE_LENGTH), 2),
            "speed": EXAMPLE_SPEED,
            "length": EXAMPLE_LENGTH,
            "width": EXAMPLE_WIDTH,
            "maxSpeed": None,
        }
        for number, (arm, route) in enumerate(sorted(routes.items()))
    ]
