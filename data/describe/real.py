"""The same figures of real traffic, for comparison: 7 minutes of Bendplatz in Aachen, from a camera.

Source: inD recording 14 as public CommonRoad scenarios hold it (432 s of it, 5 Hz), taken through the same steps as
every recording, but for stretches with crossing pedestrians, which were kept (6.9 min; without them 2.8 are left). The
figures alone are here, nothing of the recording. 95 cars, 3 trucks and buses, 20 bicycles: read them as rough.
"""

BENDPLATZ = {
    "traffic in scenes": "0.12 h",
    "cars and trucks": "849 an hour",
    "unled yield/priority pairs": "260 an hour",
    "yielder goes first": "33 %",
    "gaps of 10 s or less": "234 an hour",
    "gaps accepted": "15 %",
    "critical gap": "6.2 s",
    "its 10-90 % width": "3.3 s",
    "side-road standing time": "mean 11.0 s, p90 30.7 s",
    "mean speed in view": "5.8 m/s",
    "slowest in junction, straight": "11.7 m/s (6.4 to 13.1, 50 vehicles)",
    "slowest in junction, left": "4.3 m/s (1.8 to 6.1, 6 vehicles)",
    "slowest in junction, right": "2.9 m/s (2.3 to 4.2, 11 vehicles)",
    "speed behind the junction": "9.6 m/s (5.9 to 13.2, 91 vehicles)",
    "acceleration 1 %, 99 %": "-2.1, +2.1 m/s²",
    "smallest bumper gap": "0.17 m",
}
"""Text by the row of `data.describe.statistics.describe`."""
