"""A map with other speed limits than its own."""

from __future__ import annotations

import zlib

from intersection_env.maps.intersection import Intersection, Sample


def with_limits(intersection: Intersection, times: float) -> Intersection:
    """The same map, all of its speed limits `times` as high; it is called as before, and has another checksum.

    Raises:
        ValueError: `times` is not above 0, or makes a limit that a map may not have.
    """
    if times == 1.0:
        return intersection
    if not times > 0.0:
        raise ValueError(f"times is {times}; wanted a number above 0")
    lines, rows = [], 0
    for line in intersection.text.splitlines()[:-1]:
        if rows:
            columns = line.split(" ")
            columns[Sample.V_MAX] = f"{times * float(columns[Sample.V_MAX]):.9g}"
            lines.append(" ".join(columns))
            rows -= 1
        else:
            lines.append(line)
            keyword, _, count = line.partition(" ")
            rows = int(count) if keyword == "samples" else 0
    body = "\n".join(lines) + "\n"
    text = f"{body}checksum {zlib.crc32(body.encode()):08x}\n"
    return Intersection(text, f"{intersection.name}, limits times {times:g}")
