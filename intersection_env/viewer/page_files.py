"""The files of the page: as they are served, and as one that needs no server.

They are plain HTML, CSS and JavaScript modules in `page/`; nothing is built.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parent / "page"
KINDS = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
}
IMPORT = re.compile(r"^import \{[^}]*\} from \"\./(\w+)\.js\";\n", re.MULTILINE)
STYLE = '<link rel="stylesheet" href="style.css">'
SCRIPT = '<script type="module" src="main.js"></script>'


def page_files() -> dict[str, bytes]:
    """The content of every file of the page, by its name."""
    found = {entry.name: entry.read_bytes() for entry in PAGE.iterdir() if entry.suffix[1:] in KINDS}
    return dict(sorted(found.items()))


def one_page(data: dict[str, Any]) -> str:
    """The page with everything in it: style, script and what it shows, under a policy that lets nothing else in."""
    page = {name: content.decode("utf-8") for name, content in page_files().items()}
    style, script = page["style.css"], joined({name: text for name, text in page.items() if name.endswith(".js")})
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    shown = f'<script type="application/json" id="shown">{text}</script>\n'
    policy = f"default-src 'none'; style-src '{_hash(style)}'; script-src '{_hash(script)}'; img-src data:"
    html = page["index.html"]
    for tag, content in (
        ("<head>", f'<head>\n<meta http-equiv="Content-Security-Policy" content="{policy}">'),
        (STYLE, f"<style>{style}</style>"),
        (SCRIPT, f'{shown}<script type="module">{script}</script>'),
    ):
        before, found, behind = html.partition(tag)
        assert found, f"index.html has no {tag}"
        html = before + content + behind
    return html


def joined(modules: dict[str, str]) -> str:
    """Modules as one script, each behind those that it imports; they share one scope, so names at the top differ."""
    done: dict[str, str] = {}

    def add(name: str) -> None:
        if name not in done:
            done[name] = ""  # a circle ends here
            for other in IMPORT.findall(modules[name]):
                add(f"{other}.js")
            body = re.sub(r"^export ", "", IMPORT.sub("", modules[name]), flags=re.MULTILINE)
            done[name] = done.pop(name) + f"// {name}\n{body}"

    add("main.js")
    return "\n".join(done.values())


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
