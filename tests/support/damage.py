"""Damages maps and policy files in many places; and short ones, so that damage hits each of their parts often."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np

SAMPLE_EVERY = 40
NUMBERS = ("0", "-1", "1", "2", "256", "1e-30", "1e30", "-1e30", "3e38", "-3e38", "1e39", "nan", "inf", "", "x")


def with_checksum(body: str) -> str:
    """The body with the line that ends a file of ours."""
    return f"{body}checksum {zlib.crc32(body.encode()):08x}\n"


def thinned(text: str) -> str:
    """The compiled map with one sample in so many, at so much more spacing."""
    lines = text.splitlines()[:-1]
    thin: list[str] = []
    while lines:
        line = lines.pop(0)
        key, _, rest = line.partition(" ")
        if key == "spacing":
            line = f"spacing {SAMPLE_EVERY * int(rest)}"
        if key == "samples":
            samples, lines = lines[: int(rest)], lines[int(rest) :]
            kept = [*samples[:-1:SAMPLE_EVERY], samples[-1]]
            line = "\n".join([f"samples {len(kept)}", *kept])
        thin.append(line)
    return with_checksum("\n".join(thin) + "\n")


def damages(body: str, count: int, generator: np.random.Generator) -> Iterator[str]:
    """Copies of a text, each damaged at one place."""
    lines = body.splitlines()
    for kind in generator.integers(0, 5, count):
        at, line = int(generator.integers(len(body))), int(generator.integers(len(lines)))
        if kind == 0:  # another byte
            yield body[:at] + chr(int(generator.integers(1, 127))) + body[at + 1 :]
        elif kind == 1:  # the end lost
            yield body[:at] + "\n"
        elif kind == 2:  # a line lost, or there twice
            yield "\n".join([*lines[:line], *[lines[line]] * int(generator.choice([0, 2])), *lines[line + 1 :]]) + "\n"
        elif kind == 3:  # a line cut
            cut = int(generator.integers(len(lines[line]) + 1))
            yield "\n".join([*lines[:line], lines[line][:cut], *lines[line + 1 :]]) + "\n"
        else:  # a number that is none, or none that is wanted
            tokens = lines[line].split(" ")
            tokens[int(generator.integers(len(tokens)))] = str(generator.choice(NUMBERS))
            yield "\n".join([*lines[:line], " ".join(tokens), *lines[line + 1 :]]) + "\n"
