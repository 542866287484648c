"""The site: it builds without a warning, every page is in its navigation, and everybody can read its pictures."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import airhockey_env
from tests.helpers import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
README = ROOT / "README.md"


def children(page: Path) -> list[Path]:
    """The pages that the tables of contents of a page name."""
    found = []
    for block in re.findall(r"^```\{toctree\}\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.M | re.S):
        found += [DOCS / f"{line}.md" for line in block.splitlines() if re.fullmatch(r"\w+", line)]
    return found


def pictures(page: Path) -> list[tuple[str, str]]:
    """The pictures of a page: the file, and the text for those who do not see it."""
    text = page.read_text(encoding="utf-8")
    found = [(path, alt) for alt, path in re.findall(r"!\[([^\]]*)\]\(([^)\s]+)", text)]
    for path, options in re.findall(r"^```\{(?:image|figure)\} (\S+)\n(.*?)^```$", text, flags=re.M | re.S):
        found.append((path, "".join(re.findall(r"^:alt: (.*)$", options, flags=re.M))))
    for tag in re.findall(r"<img\s[^>]*>", text):
        found.append((tag, "".join(re.findall(r'\balt="([^"]*)"', tag))))
    return found


def test_every_page_is_in_the_navigation_once() -> None:
    reached, waiting = [DOCS / "index.md"], [DOCS / "index.md"]
    while waiting:
        found = children(waiting.pop())
        reached += found
        waiting += found
    assert sorted(reached) == PAGES, "a new page gets one line in a toctree: see CONTRIBUTING.md"


@pytest.mark.parametrize("page", [README, *PAGES], ids=lambda page: page.name)
def test_pictures_have_alternative_text(page: Path) -> None:
    for path, alt in pictures(page):
        assert len(alt.split()) > 1, f"{path} needs a text that says what is to be seen"


def test_pictures_are_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        '![](a.png)\n```{image} b.png\n:width: 9\n```\n<img src="c.png">\n![d e](d.png)\n', encoding="utf-8"
    )
    assert [alt for _, alt in pictures(page)] == ["", "d e", "", ""]


@pytest.mark.parametrize("name", airhockey_env.__all__)
def test_the_api_reference_has_every_public_name(name: str) -> None:
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    assert re.search(rf"^\.\. (autoclass|data):: {name}$", page, flags=re.M)
    thing = getattr(airhockey_env, name)
    if isinstance(thing, type):
        assert vars(thing).get("__doc__")


def test_it_builds_without_a_warning(tmp_path: Path) -> None:
    for module in ("sphinx", "myst_parser", "pydata_sphinx_theme", "sphinx_design", "sphinx_copybutton"):
        pytest.importorskip(module)
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for page in PAGES:
        assert (tmp_path / "site" / f"{page.stem}.html").exists()
    baseline, training = (
        (tmp_path / "site" / f"{page}.html").read_text(encoding="utf-8") for page in ("baseline", "training")
    )
    assert re.search(r'<a [^>]*href="_images/learning\.png">', baseline), "a phone shows it too small to read"
    assert '<span class="pre unbroken">--resume</span>' in training
    front = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert 'href="play/index.html"' in front and (tmp_path / "site" / "play" / "index.html").exists()
