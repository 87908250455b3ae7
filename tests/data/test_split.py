"""Which recordings train, develop and validate."""

from __future__ import annotations

from pathlib import Path

import pytest

from data.pipeline.split import split_of


@pytest.mark.parametrize(
    ("count", "expected"), [(1, "t"), (2, "tv"), (3, "tdv"), (10, "ttttttttdv"), (20, "t" * 16 + "ddvv")]
)
def test_split_without_settings_goes_by_recording(tmp_path: Path, count: int, expected: str) -> None:
    split, origin = split_of(tmp_path, [f"{number:02d}" for number in range(count)])
    assert "".join(word[0] for word in split.values()) == expected
    assert "order of recording" in origin


def test_split_of_settings_is_kept(tmp_path: Path) -> None:
    text = '{"seed": 1, "split": {"train": ["02"], "development": [0], "validation": ["01", "03"]}}'
    (tmp_path / "settings.json").write_text(text)
    split, origin = split_of(tmp_path, ["00", "01", "02"])
    assert split == {"00": "development", "01": "validation", "02": "train"}
    assert "settings.json" in origin


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "wanted an object, not list"),
        ('{"split": {"test": ["00"]}}', "must be an object with train, development, validation"),
        ('{"split": {"train": "00"}}', "must be a list of recordings"),
        ('{"split": {"train": ["00", "00"]}}', "names recording 00 twice"),
        ('{"split": {"train": ["00"], "validation": ["00"]}}', "names recording 00 twice"),
        ('{"split": {"train": ["one"]}}', "must hold recordings as"),
        ('{"split": {"train": ["01"]}}', "leaves out recording 00"),
    ],
)
def test_malformed_settings_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "settings.json").write_text(text)
    with pytest.raises(ValueError, match=message):
        split_of(tmp_path, ["00"])
