"""How the site is built: python -m sphinx -W --keep-going docs docs/_build

Every warning is an error: a link that leads nowhere, a page that no table of contents names, a public name without
documentation.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import tomllib
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util import logging

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import airhockey_env  # noqa: E402
from docs.play.page import write_page  # noqa: E402

with open(ROOT / "pyproject.toml", "rb") as file:
    REPOSITORY = tomllib.load(file)["project"]["urls"]["Repository"]

project = "airhockey-env"
author = "The airhockey-env authors"
copyright = author
version = release = airhockey_env.__version__
language = "en"

extensions = [
    "myst_parser",  # pages are in Markdown
    "sphinx.ext.autodoc",  # the API reference is made from the docstrings
    "sphinx.ext.napoleon",  # which have sections such as Args and Raises
    "sphinx_copybutton",
    "sphinx_design",  # cards and grids
]
exclude_patterns = ["_build"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4

default_role = "code"  # docstrings have single backticks around code, as in Markdown
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_inherit_docstrings = False
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("ArrayLike", "NDArray", "Player", "Policy", "Seat", "CameraLike")}
python_maximum_signature_line_length = 100
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_use_admonition_for_examples = False

html_theme = "pydata_sphinx_theme"
html_title = project
html_favicon = "_static/icon.svg"
html_context = {"default_mode": "auto"}  # light or dark, as the reader's system is
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {
        "text": project,
        "image_light": "_static/icon.svg",
        "image_dark": "_static/icon.svg",
        "alt_text": "A paddle and a puck",
    },
    "github_url": REPOSITORY,
    "navbar_align": "left",
    "header_links_before_dropdown": 6,
    "navbar_persistent": ["search-button"],
    "show_toc_level": 2,
    "show_nav_level": 1,
    "navigation_with_keys": False,
    "secondary_sidebar_items": {"**": ["page-toc"], "index": []},
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars = {"index": []}
if "SITE_VERSIONS" in os.environ:  # where it is published: the address of the list of all versions, for the menu
    html_theme_options["switcher"] = {
        "json_url": os.environ["SITE_VERSIONS"],
        "version_match": os.environ["SITE_VERSION"],
    }
    html_theme_options["check_switcher"] = False  # it may be the first one
    html_theme_options["navbar_end"] = ["version-switcher", "theme-switcher", "navbar-icon-links"]


def link_to_the_repository(app: Sphinx, name: str, source: list[str]) -> None:
    """Let links to files outside docs/, which work on GitHub as they are, lead to the repository."""
    source[0] = re.sub(r"\]\(\.\./([^)]*)\)", rf"]({REPOSITORY}/blob/main/\1)", source[0])


def as_rst(app: Sphinx, kind: str, name: str, thing: object, options: Any, lines: list[str]) -> None:
    """Docstrings are almost the same in Markdown and in reStructuredText. Treat the differences.

    Blocks of code between fences become indented ones. A docstring with headings is a page of its own
    (environments.md), so that its first section is enough here.
    """
    text = "\n".join(lines).strip()
    if text.startswith("## "):
        text = text.split("\n## ")[0].partition("\n")[2]
        text = re.sub(r" [^.]*:\n\n(\|.*\n)+", "\n", text)  # a table, with the sentence that leads to it
        text += "\n\nThe full specification is the page :doc:`environments`.\n"

    def indented(block: re.Match[str]) -> str:
        return f".. code-block:: {block[1]}\n\n" + re.sub(r"^", "    ", block[2], flags=re.MULTILINE)

    text = re.sub(r"^```(\w+)\n(.*?)^```$", indented, text, flags=re.MULTILINE | re.DOTALL)
    lines[:] = [*text.splitlines(), ""]
    if kind == "property":  # napoleon would take what stands before a colon in the first line for a type
        lines[:0] = ["..", ""]


def link_pictures(app: Sphinx, doctree: nodes.document) -> None:
    """Let every picture lead to its file, where a phone can enlarge it. Cards are links already."""
    for picture in doctree.findall(nodes.image):
        parent = picture.parent
        while parent is not None and "sd-card" not in parent.get("classes", []):
            parent = parent.parent
        if parent is None and "width" not in picture:
            picture["scale"] = 100  # Sphinx links the pictures that have a scale


def keep_hyphens(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document) -> None:
    """Do not break short code, such as the option `--steps` or `AirHockey-v0`, at its hyphens."""
    if "body" in context:
        short = r'<span class="pre">(?=[^<]*-)([^<]{1,30})</span>'
        context["body"] = re.sub(short, r'<span class="pre unbroken">\1</span>', context["body"])


def find_undocumented(app: Sphinx, env: Any) -> None:
    """Warn of public names that the API reference does not have."""
    documented = env.domains.python_domain.objects
    for name in airhockey_env.__all__:
        if f"airhockey_env.{name}" not in documented:
            logging.getLogger(__name__).warning("airhockey_env.%s is public, but docs/api.md does not have it", name)


def write_play(app: Sphinx, error: Exception | None) -> None:
    """Add the page on which one can play."""
    if error is None and app.builder.format == "html":
        write_page(Path(app.outdir) / "play")


def setup(app: Sphinx) -> None:
    """Connect the above."""
    app.connect("source-read", link_to_the_repository)
    app.connect("autodoc-process-docstring", as_rst, priority=100)  # before napoleon
    app.connect("doctree-read", link_pictures)
    app.connect("html-page-context", keep_hyphens)
    app.connect("env-check-consistency", find_undocumented)
    app.connect("build-finished", write_play)
