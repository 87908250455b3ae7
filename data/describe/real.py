"""The same figures of real traffic, for comparison: 7 minutes of Bendplatz in Aachen, from a camera.

Source: inD recording 14 as public CommonRoad scenarios hold it (432 s of it, 5 Hz), taken through the same steps as
every recording, but for stretches with crossing pedestrians, which were kept (6.7 min; without them 2.8 are left). The
figures alone are here, nothing of the recording. 94 cars, 3 trucks and buses, 20 bicycles: read them as rough.
"""

BENDPLATZ = {
    "traffic in scenes": "0.11 h",
    "cars and trucks": "875 an hour",
    "unled yield/priority pairs": "262 an hour",
    "yielder goes first": "34 %",
    "gaps of 10 s or less": "225 an hour",
    "gaps accepted": "12 %",
    "critical gap": "6.2 s",
    "its 10-90 % width": "3.4 s",
    "side-road standing time": "mean 10.4 s, p90 28.8 s",
    "mean speed in view": "5.9 m/s",
    "slowest in junction, straight": "11.8 m/s (6.6 to 13.1, 48 vehicles)",
    "slowest in junction, left": "3.8 m/s (1.6 to 6.3, 5 vehicles)",
    "slowest in junction, right": "2.8 m/s (2.1 to 4.0, 9 vehicles)",
    "speed behind the junction": "10.0 m/s (5.8 to 13.3, 86 vehicles)",
    "acceleration 1 %, 99 %": "-2.1, +2.0 m/s²",
    "smallest bumper gap": "0.20 m",
}
"""Text by the row of `data.describe.statistics.describe`."""
