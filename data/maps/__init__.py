"""Maps of lanes, as Lanelet2 and CommonRoad hold them, to map sources."""
