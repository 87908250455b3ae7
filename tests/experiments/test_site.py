"""The documentation's site: every page is in it, notebooks are Python, the API page has every public name.

`make docs` builds it, with warnings as errors; here is what can be known without Sphinx, and soon.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from pathlib import Path

import pytest

import intersection_env
from experiments.documentation.docstrings import as_rst, signature_as_written
from experiments.documentation.site_only import uncovered
from tests.support.paths import ROOT

DOCS = ROOT / "docs"
INDEX, API = DOCS / "index.md", DOCS / "api.md"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.md"))
WIDTH = 90  # characters of code, beside which the site has no room
OUTSIDE = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "experiments/README.md", "experiments/results/report.md")
"""Pages of the site that lie elsewhere."""
TREE = re.compile(r"^```\{toctree\}\n(?::.*\n)*\n(.*?)^```$", re.DOTALL | re.MULTILINE)
TITLED, SAME = re.compile(r"^.* <(.*)>$"), r"\1"
"""An entry with a title of its own, `Title <page>`, and its page."""
CELL = re.compile(r"^```\{code-cell\} ipython3\n(.*?)^```$", re.DOTALL | re.MULTILINE)
DOCUMENTED = re.compile(r"^\.\. auto(?:class|function|data):: (\S+)$", re.MULTILINE)
IMPORTED_FROM = ("intersection_env", "experiments")


def pages_in(section: str) -> list[Path]:
    """The pages that a section of the index lists for the site, in order."""
    trees = [entry for tree in TREE.findall(uncovered(section)) for entry in tree.split("\n") if entry]
    return [(DOCS / f"{TITLED.sub(SAME, entry)}.md").resolve() for entry in trees]


def test_every_page_is_in_the_site_once_and_in_the_section_that_links_to_it() -> None:
    listed = []
    for section in INDEX.read_text().split("\n## ")[1:]:
        links = re.findall(r"\]\(([^)#]+\.md)\)", re.sub(r"<!--.*?-->", "", section, flags=re.DOTALL))
        assert [(DOCS / link).resolve() for link in links] == pages_in(section)
        listed += pages_in(section)
    assert sorted(listed) == sorted([*set(DOCS.rglob("*.md")) - {INDEX}, *(ROOT / one for one in OUTSIDE)])


def test_pages_outside_of_the_folder_are_those_that_sphinx_reads() -> None:
    (patterns,) = (
        ast.literal_eval(node.value)
        for node in ast.parse((DOCS / "conf.py").read_text()).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "include_patterns"
    )
    assert set(patterns) == {"docs/**.md", *OUTSIDE}


def cells(path: Path) -> ast.Module:
    """A notebook's code, without the commands of IPython."""
    code = "\n".join(CELL.findall(path.read_text()))
    return ast.parse(re.sub(r"^%.*$", "", code, flags=re.MULTILINE), path.name)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_python_and_what_it_imports_of_ours_is_there(path: Path) -> None:
    assert path.read_text().startswith("---\njupytext:\n")
    code = cells(path)
    assert len(code.body) > 10
    for node in ast.walk(code):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in IMPORTED_FROM:
            module = importlib.import_module(node.module or "")
            assert [one.name for one in node.names if not hasattr(module, one.name)] == []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_line_of_a_notebook_fits_the_sites_width(path: Path) -> None:
    assert [line for cell in CELL.findall(path.read_text()) for line in cell.split("\n") if len(line) > WIDTH] == []


def test_the_api_page_holds_every_public_name_and_no_other_but_those_in_modules() -> None:
    public, in_modules = API.read_text().split("\n## In modules\n")
    names = [name.removeprefix("intersection_env.") for name in DOCUMENTED.findall(uncovered(public))]
    assert sorted(names) == sorted(name for name in intersection_env.__all__ if name != "__version__")
    visible = re.sub(r"<!--.*?-->", "", public, flags=re.DOTALL)
    assert [name for name in names if f"`{name}`" not in visible] == []
    for name in DOCUMENTED.findall(uncovered(in_modules)):
        module, _, last = name.rpartition(".")
        assert hasattr(importlib.import_module(module), last), name


def test_what_is_for_the_site_alone_is_uncovered_and_other_comments_stay() -> None:
    text = "a\n<!-- begin x -->\n<!-- site\n```{toctree}\nb\n```\n-->\nc\n"
    assert uncovered(text) == "a\n<!-- begin x -->\n```{toctree}\nb\n```\n\nc\n"


def nowhere(name: str) -> str | None:
    return None


def test_a_docstrings_sections_and_fields_become_lists() -> None:
    text = """What it does with `this`.

position: (time,) [m],
    more of it.
speed, length: (time,) [m/s].

Args:
    first: of all,
        and on.

Raises:
    ValueError: no."""
    assert [line for line in as_rst(text.split("\n"), nowhere) if line] == [
        "What it does with ``this``.",
        "- ``position``: (time,) [m],",
        "  more of it.",
        "- ``speed, length``: (time,) [m/s].",
        "**Args**",
        "- ``first``: of all,",
        "  and on.",
        "**Raises**",
        "- ``ValueError``: no.",
    ]


def test_names_in_a_docstring_lead_where_the_site_has_them() -> None:
    lines = as_rst(["As `Traffic.of`, `x` and ``y``."], {"Traffic.of": "intersection_env.Traffic.of"}.get)
    assert lines[0] == "As :py:obj:`Traffic.of <intersection_env.Traffic.of>`, ``x`` and ``y``."


def test_an_environments_manual_is_not_repeated() -> None:
    lines = as_rst((inspect.getdoc(intersection_env.ClosedLoop) or "").split("\n"), nowhere)
    assert "\n".join(lines).count("\n") < 5
    assert ":doc:`environments`" in lines[2]


def test_a_signature_stands_as_it_is_written() -> None:
    arguments, returned = signature_as_written(intersection_env.Scenes.at)
    assert (arguments, returned) == ("(scene: Scene | int | str, time: float)", "Traffic")
    assert signature_as_written(intersection_env.Noise)[1] == ""
