"""What a map may be called: files are named by it."""

from __future__ import annotations

import re
from typing import Any

NAME = re.compile(r"\w[\w.+-]*")


def check_name(value: Any) -> str:
    """A map's name.

    Raises:
        ValueError: it cannot name a file.
    """
    if not isinstance(value, str) or not NAME.fullmatch(value):
        raise ValueError(
            f'"name" must be one word of letters, digits, "_", "-", "+" and ".", as it names files, not {value!r}'
        )
    return value
