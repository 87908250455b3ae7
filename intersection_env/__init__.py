"""Traffic at unsignalized intersections: maps, recorded scenes, prediction, maneuvers."""

from intersection_env.intersection import Intersection
from intersection_env.maneuvers import crossing_orders, rank_maneuvers
from intersection_env.predictor import Observation, Prediction, Predictor, Summary
from intersection_env.scenes import Scene, Scenes
from intersection_env.traffic import Traffic, Vehicle

__all__ = [
    "Intersection",
    "Observation",
    "Prediction",
    "Predictor",
    "Scene",
    "Scenes",
    "Summary",
    "Traffic",
    "Vehicle",
    "crossing_orders",
    "rank_maneuvers",
]
