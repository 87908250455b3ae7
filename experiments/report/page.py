"""The report as one HTML page with its pictures inside."""

from __future__ import annotations

import re
from pathlib import Path

import markdown

STYLE = """
:root { color-scheme: light dark; --ink: #1d1d1b; --page: #fff; --line: #ddd; --quiet: #f3f3f0; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e6e2; --page: #1b1b1a; --line: #444; --quiet: #2b2b29; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--page); max-width: 76rem;
  margin: 2rem auto; padding: 0 1rem; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.5rem; } p { max-width: 46rem; }
table { border-collapse: collapse; margin: 1rem 0; display: block; overflow-x: auto; font-size: 14px; }
th, td { border-bottom: 1px solid var(--line); padding: .3rem 1rem .3rem 0; text-align: left; vertical-align: top;
  white-space: nowrap; }
th { border-bottom: 2px solid #888; vertical-align: bottom; }
td:first-child { position: sticky; left: 0; background: var(--page); white-space: normal; min-width: 11rem; }
code { background: var(--quiet); padding: 0 .2rem; font-size: .9em; }
td code { padding: 0; background: none; }
pre { background: var(--quiet); padding: .7rem; overflow-x: auto; font-size: 13px; line-height: 1.4; }
pre code { padding: 0; background: none; font-size: inherit; }
figure { margin: 1rem 0; } svg { max-width: 100%; height: auto; background: #fff; }
"""


def page(text: str, folder: Path, title: str = "report") -> str:
    """The report as an HTML page that needs no other file; pictures are taken from the folder.

    Raises:
        OSError: a picture cannot be read.
    """
    body = markdown.markdown(text, extensions=["tables", "fenced_code"])

    def picture(found: re.Match[str]) -> str:
        file = folder / found[2]
        svg = file.read_text(encoding="utf-8")
        own = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{file.stem}-", svg[svg.index("<svg") :])  # not another figure's
        return f'<figure role="img" aria-label="{found[1]}">{own}</figure>'

    body = re.sub(r'<p><img alt="([^"]*)" src="([^"]*)" /></p>', picture, body)
    return (
        f'<!doctype html>\n<html lang="en">\n<head><meta charset="utf-8"><title>intersection_env: {title}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n'
        f"<body>\n{body}\n</body></html>\n"
    )
