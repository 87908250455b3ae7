"""Which recording serves for what: training, all choices (development), or the report (validation)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from intersection_env.scenes.scene import SPLITS

SETTINGS = "settings.json"
VALIDATION_SHARE = 0.1  # paper, Section IV.A
DEVELOPMENT_SHARE = 0.1  # ours: choices need data that the report has not seen


def split_of(folder: Path, recordings: Sequence[str]) -> tuple[dict[str, str], str]:
    """The split of each recording, and one sentence on where it comes from.

    The folder's `settings.json` says it under "split" where there is such a file. Otherwise, in order of
    recording: the last tenth is for validation, the tenth before for development, at least one each
    when there are three recordings; of two, the last is for validation; a single one is for training.

    Raises:
        ValueError: settings.json is malformed, or its split names a recording twice or leaves one out.
    """
    path = folder / SETTINGS
    if path.is_file():
        stated = _stated(path)
        if stated is not None:
            return _from_settings(path, stated, recordings), f'from "split" in {SETTINGS}'
    count = len(recordings)
    validation = max(1, round(VALIDATION_SHARE * count)) if count > 1 else 0
    development = max(1, round(DEVELOPMENT_SHARE * count)) if count > 2 else 0
    train = count - development - validation
    words = ["train"] * train + ["development"] * development + ["validation"] * validation
    return dict(zip(recordings, words, strict=True)), "by order of recording: the last tenth for validation"


def _stated(path: Path) -> Any:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{path}: not JSON: {error}") from None
    if not isinstance(content, dict):
        raise ValueError(f"{path}: wanted an object, not {type(content).__name__}")
    return content.get("split")


def _from_settings(path: Path, stated: Any, recordings: Sequence[str]) -> dict[str, str]:
    if not isinstance(stated, dict) or not set(stated) <= set(SPLITS):
        raise ValueError(f'{path}: "split" must be an object with {", ".join(SPLITS)}, not {stated!r}')
    numbers = {_key(recording): recording for recording in recordings}
    split: dict[str, str] = {}
    named: set[int | str] = set()
    for word, members in stated.items():
        if not isinstance(members, list):
            raise ValueError(f'{path}: "split": "{word}" must be a list of recordings, not {members!r}')
        for member in members:
            number = _number(path, word, member, recordings)
            if number in named:
                raise ValueError(f'{path}: "split" names recording {member} twice')
            named.add(number)
            if number in numbers:
                split[numbers[number]] = word
    for number, recording in numbers.items():
        if number not in named:
            raise ValueError(f'{path}: "split" leaves out recording {recording}')
    return split


def _key(recording: str) -> int | str:
    """What a recording is known by: its number, so that 7 is 07, or its name."""
    return int(recording) if recording.isdecimal() else recording


def _number(path: Path, word: str, member: Any, recordings: Sequence[str]) -> int | str:
    numbers = all(recording.isdecimal() for recording in recordings)
    wrong = isinstance(member, bool) or not isinstance(member, (int, str))
    if wrong or (not str(member).isdecimal() and (numbers or not isinstance(member, str))):
        raise ValueError(f'{path}: "split": "{word}" must hold recordings as "07", not {member!r}')
    return _key(str(member))
