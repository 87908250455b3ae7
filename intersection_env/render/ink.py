"""Colours, letters and smooth shapes for pictures of traffic. Needs pygame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pygame
from numpy.typing import NDArray

Colour = tuple[int, int, int]
Paint = tuple[int, int, int, int]
"""Red, green, blue and opacity, each up to 255; 0 cuts out what was painted of the item before."""
Shape = tuple[int, int, Paint]
"""First corner, end of the corners, paint."""

INK: Colour = (43, 43, 43)
DIM: Colour = (92, 92, 90)
HELD: Colour = (205, 38, 38)
LETTER_SIZE = 15.0  # [nominal pixel]
MARGIN = 14.0  # [nominal pixel] between letters and the border of the picture
FINER = 3  # shapes are drawn this many times larger, then averaged
SHRINK = 0.5 / FINER  # [pixel], by which pygame draws a shape too large on each side
DASH, GAP = 6.0, 4.0  # [nominal pixel]
HEAD_LENGTH, HEAD_HALF = 6.5, 2.3  # [nominal pixel], of an arrow

ANCHORS = ((244, 196, 78), (190, 200, 122), (110, 176, 160), (58, 132, 176), (34, 84, 150))
"""From standing to v_max, ours: amber to blue, told apart without seeing red or green, darker step by step;
red stays free for who is held."""


def _speeds(count: int) -> list[Colour]:
    at = np.linspace(0.0, len(ANCHORS) - 1.0, count)
    bands = [np.interp(at, range(len(ANCHORS)), band) for band in zip(*ANCHORS, strict=True)]
    return [(round(red), round(green), round(blue)) for red, green, blue in zip(*bands, strict=True)]


SPEEDS = _speeds(256)


@dataclass(frozen=True)
class ArrowStyle:
    """How an arrow is drawn; `line` is its width [nominal pixel]."""

    colour: Colour
    line: float
    dashed: bool

    def width(self, unit: float) -> int:
        """[pixel]"""
        return max(1, round(self.line * unit))


WAITING = ArrowStyle((190, 64, 60), 1.0, dashed=False)
SECOND = ArrowStyle((94, 48, 150), 2.0, dashed=True)


class Lettering:
    """Writes text onto surfaces."""

    def __init__(self, unit: float) -> None:
        """Letters of the nominal size times `unit`."""
        self._size = round(LETTER_SIZE * unit)
        self._load()

    def _load(self) -> None:
        pygame.font.init()
        self._font = pygame.font.Font(None, self._size)

    def draw(
        self, surface: pygame.Surface, text: str, place: tuple[float, float], colour: Colour, align: float = 0.0
    ) -> int:
        """Writes a line with its lower end at `place` [pixel], `align` of its width left of it; says where it is."""
        try:
            letters = self._font.render(text, True, colour)
        except pygame.error:  # another environment has quit pygame meanwhile
            self._load()
            letters = self._font.render(text, True, colour)
        x, y = place
        left = round(x - align * letters.get_width())
        surface.blit(letters, (left, round(y - letters.get_height())))
        return left


def paint(
    surface: pygame.Surface, corners: NDArray[np.float64], shapes: Sequence[Sequence[Shape]], border: Colour = INK
) -> None:
    """Paints items with smooth borders; of one item, each shape replaces those before where they meet.

    corners: (item, corner, 2) [pixel]; shapes: (item, shape), each a stretch of the item's corners, and a paint;
    border: the colour of the items' outermost shapes, which fade into what lies beneath.
    """
    low = np.clip(np.floor(corners.min(axis=1)), 0.0, surface.get_size())
    high = np.clip(np.ceil(corners.max(axis=1)), 0.0, surface.get_size())
    places = np.rint(FINER * (corners - low[:, None]) - 0.5).tolist()
    corner, size = low.astype(int).tolist(), (high - low).astype(int).tolist()
    for i in np.flatnonzero((high > low).all(axis=1)).tolist():
        width, height = size[i]
        large = pygame.Surface((FINER * width, FINER * height), pygame.SRCALPHA)
        large.fill((*border, 0))
        for begin, end, colour in shapes[i]:
            pygame.draw.polygon(large, colour, places[i][begin:end])
        surface.blit(pygame.transform.smoothscale(large, size[i]), corner[i])


def draw_arrows(
    surface: pygame.Surface, tails: NDArray[np.float64], tips: NDArray[np.float64], style: ArrowStyle, unit: float
) -> None:
    """Draws arrows from tails to tips, (arrow, 2) [pixel]; none where they are nearer than a head is long."""
    way = tips - tails
    length = np.hypot(*way.T)
    kept = length > HEAD_LENGTH * unit
    tails, tips, way, length = tails[kept], tips[kept], way[kept], length[kept, None]
    if not len(tails):
        return
    along = way / length
    right, down = along.T
    across = HEAD_HALF * unit * np.stack([-down, right], axis=1)
    necks = tips - HEAD_LENGTH * unit * along
    for tail, neck, step, shaft in zip(tails - 0.5, necks - 0.5, along, length[:, 0].tolist(), strict=True):
        if not style.dashed:
            pygame.draw.aaline(surface, style.colour, tail.tolist(), neck.tolist(), style.width(unit))
            continue
        for start in np.arange(0.0, shaft - HEAD_LENGTH * unit, (DASH + GAP) * unit).tolist():
            stop = min(start + DASH * unit, shaft - HEAD_LENGTH * unit)
            ends = (tail + start * step).tolist(), (tail + stop * step).tolist()
            pygame.draw.aaline(surface, style.colour, *ends, style.width(unit))
    heads = np.stack([tips, necks + across, necks - across], axis=1)
    paint(surface, heads, [[(0, 3, (*style.colour, 255))]] * len(heads), style.colour)
