"""The documentation as a site: `make docs`.

The pages are those that GitHub shows, in their places, so that their links lead to the same files; what the site alone
has stands in comments on them (`experiments/documentation/site_only.py`). Notebooks are executed, and the viewer's
pages exported, each time the site is built. Nothing is loaded from elsewhere.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

import intersection_env  # noqa: E402
from experiments.documentation.docstrings import as_rst, signature_as_written  # noqa: E402
from experiments.documentation.site_only import uncovered  # noqa: E402
from intersection_env.__main__ import main as command  # noqa: E402

ELSEWHERE = (
    r"(np|gymnasium|pd|_core)\..*|NDArray|ArrayLike|InitVar|Path|Any|Iterable|Iterator|Sequence|Mapping.*|Literal|Self"
    r"|Figure|Axes|Box|AECEnv|AutoresetMode"
)
"""Names in signatures whose documentation is elsewhere, where nothing here leads to."""
INSIDE = (
    r"Array|Autoreset|Bodies|Conflict|EmptyRoad|Forecaster|Gates|Masked|Patience|PolicyFile|Priorities|SharedLane|Steps"
)
"""Names in signatures of ours that the API page does not hold: what they stand for is said beside them."""

project = "intersection_env"
version = release = intersection_env.__version__
copyright = "the authors, Apache-2.0"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]

root_doc = "docs/index"
include_patterns = [
    "docs/**.md",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "experiments/README.md",
    "experiments/results/report.md",
]
exclude_patterns = [".*", "build", "dist", "out", "runs", "data", "tests", "agents", "imitation", "intersection_env"]

html_theme = "furo"
html_title = "intersection_env"
html_static_path = ["site"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
pygments_style = "friendly"

myst_enable_extensions = ["html_image"]
myst_heading_anchors = 4  # as GitHub names headings
kernels = ROOT / "out" / "ipython"  # notebooks run with this configuration, whatever their reader's own is
os.environ["IPYTHONDIR"] = str(kernels)
(kernels / "profile_default").mkdir(parents=True, exist_ok=True)
(kernels / "profile_default" / "ipython_kernel_config.py").write_text('c.IPKernelApp.log_level = "ERROR"\n')
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # [s] a cell, on a machine that does other things too
nb_execution_in_temp = False
nb_merge_streams = True

autodoc_default_options = {"member-order": "bysource"}
autodoc_typehints = "none"  # signatures come as they are written
maximum_signature_line_length = 72
nitpicky = True
nitpick_ignore_regex = [("py:(class|exc|data|obj)", f"{ELSEWHERE}|{INSIDE}")]


UNSEARCHED = ("experiments/results/report", "CHANGELOG")
"""Pages that hold nearly every word, and would stand before those that answer."""
COMMON_WORDS = ("env", "forecast")
"""Public names that in code on a page mostly stand for something else."""


class ViewerPage(SphinxDirective):
    """A page of the viewer within this one, made by `python -m intersection_env view` with these arguments."""

    required_arguments = 1  # the file's name
    has_content = True

    def run(self) -> list[nodes.Node]:
        """The frame, once the page is made."""
        name = f"{self.arguments[0]}.html"
        folder = Path(self.env.app.outdir) / "viewer"
        folder.mkdir(parents=True, exist_ok=True)
        if command(["view", *" ".join(self.content).split(), "--export", str(folder / name)]):
            raise self.error(f"the viewer's page {name} was not made")
        up = "../" * self.env.docname.count("/")
        address = f"{up}viewer/{name}"
        frame = f'<div class="viewer"><iframe src="{address}" title="The viewer" loading="lazy"></iframe></div>'
        alone = f'<p><a href="{address}">In a window of its own</a></p>'
        return [nodes.raw("", frame + alone, format="html")]


def public_name(name: str) -> str | None:
    """The full name under which the API page has what a name stands for, as `Traffic.of`."""
    name = name.removesuffix("()")
    head, *rest = name.removeprefix("intersection_env.").split(".")
    if head not in intersection_env.__all__ or head.startswith("_"):
        return None
    thing: Any = getattr(intersection_env, head)
    for part in rest:
        thing = getattr(thing, part, None)
    return None if thing is None else ".".join(["intersection_env", head, *rest])


def setup(app: Sphinx) -> None:
    """What the site has and a page has not."""
    app.add_directive("viewer", ViewerPage)
    app.connect("source-read", _uncover)
    app.connect("autodoc-process-docstring", _to_rst)
    app.connect("autodoc-process-signature", _as_written)
    app.connect("missing-reference", _public)
    app.connect("doctree-read", _link_names)
    app.connect("doctree-read", _leave_out_of_search)
    app.connect("build-finished", _write_entrance)


def _uncover(app: Sphinx, docname: str, source: list[str]) -> None:
    source[0] = uncovered(source[0])


def _to_rst(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    lines[:] = as_rst(lines, public_name) if lines else []


def _as_written(
    app: Sphinx, what: str, name: str, thing: Any, options: object, arguments: str | None, returned: str | None
) -> tuple[str, str] | None:
    return signature_as_written(thing) if arguments else None


def _public(app: Sphinx, env: Any, node: Any, contnode: nodes.Element) -> nodes.Element | None:
    """An annotation names a class by the file that it is defined in; the API page has it by its public name."""
    public = public_name(node.get("reftarget", "").rpartition(".")[2])
    if node.get("refdomain") != "py" or public is None:
        return None
    domain = env.get_domain("py")
    return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", public, node, contnode)


def _link_names(app: Sphinx, doctree: nodes.document) -> None:
    """A public name in the text leads to its place on the API page."""
    for literal in list(doctree.findall(nodes.literal)):
        name, parent = literal.astext(), literal.parent
        full = public_name(name) if name not in COMMON_WORDS else None
        if full is None or isinstance(parent, nodes.reference | nodes.title | addnodes.pending_xref):
            continue
        where = {"refdomain": "py", "reftype": "obj", "reftarget": full, "refdoc": app.env.docname, "refexplicit": True}
        link = addnodes.pending_xref("", literal.deepcopy(), refwarn=True, **where)
        parent.replace(literal, link)


def _leave_out_of_search(app: Sphinx, doctree: nodes.document) -> None:
    if app.env.docname in UNSEARCHED:
        app.env.metadata[app.env.docname]["nosearch"] = "true"


def _write_entrance(app: Sphinx, exception: Exception | None) -> None:
    """The first page lies in docs/, as on GitHub; whoever opens the folder is sent there."""
    if exception is None:
        entrance = '<!doctype html><meta http-equiv="refresh" content="0; url=docs/index.html"><title>docs</title>\n'
        (Path(app.outdir) / "index.html").write_text(entrance, encoding="utf-8")
