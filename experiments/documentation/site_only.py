"""What a page holds for the site alone: Markdown within a comment, which GitHub does not show.

    <!-- site
    ...
    -->

Lists of pages, directives and frames stand so, since on GitHub they would be code.
"""

from __future__ import annotations

import re

HIDDEN = re.compile(r"^<!-- site\n(.*?)^-->$", re.DOTALL | re.MULTILINE)


def uncovered(text: str) -> str:
    """A page's text as the site has it."""
    return HIDDEN.sub(r"\1", text)
