"""Pages of the documentation: each is in the navigation of the site, and every link leads to something."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import fedora_qa
from fedora_qa.cli.generated_files import cause_pages, layout_page
from fedora_qa.cli.site_pages import anchors, is_external, linked_path, links, page_paths, site_text
from tests.built_site import loaded_from_elsewhere

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PATHS = page_paths(ROOT)
ON_GITHUB_ALONE = ("README.md", "CONTRIBUTING.md")
PAGES = [*ON_GITHUB_ALONE, *(path for path in PATHS if path.endswith(".md"))]


def navigated(entry: Any) -> Iterator[str]:
    """The pages of a part of the navigation."""
    match entry:
        case str():
            yield entry
        case list():
            for part in entry:
                yield from navigated(part)
        case dict():
            for part in entry.values():
                yield from navigated(part)


def broken_links(page: str, text: str) -> list[str]:
    """The links of a page that lead to no file, or to no heading of a page."""
    broken = []
    for target in links(text):
        if is_external(target):
            continue
        path = ROOT / linked_path(page, target)
        anchor = target.partition("#")[2]
        is_heading = path.suffix == ".md" and anchor
        if not path.exists() or (is_heading and anchor not in anchors(path.read_text(encoding="utf-8"))):
            broken.append(target)
    return broken


def test_every_page_is_in_the_navigation() -> None:
    """Once. The navigation names no page that is not there; the sample report is made with the site."""
    nav = list(navigated(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]))
    pages = [place for path, place in PATHS.items() if path.endswith(".md")]
    assert sorted(nav) == sorted([*pages, "sample-report.html"])


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    """To a file of the repository, and where they name a heading, to one that is there."""
    assert not broken_links(page, (ROOT / page).read_text(encoding="utf-8"))


def test_a_broken_link_is_found() -> None:
    """The test above can fail; code in a block is no link."""
    text = "[a](gate.md#a-policy) [b](gate.md#nothing) [c](nothing.md)\n```\n[d](nothing.md)\n```\n[e\nf](../none.py)"
    assert broken_links("docs/ci.md", text) == ["gate.md#nothing", "nothing.md", "../none.py"]


def test_links_hold_on_the_site() -> None:
    """Links follow pages to their place; files that are no pages lie in the repository, or are text alone."""
    text = "[words](../GLOSSARY.md#events), [code](../fedora_qa/causes.py), [page](gate.md), [here](#x), [out](https://a.b)"
    moved = "[words](glossary.md#events), {}, [page](gate.md), [here](#x), [out](https://a.b)"
    assert site_text(text, "docs/ci.md", PATHS, "") == moved.format("code")
    linked = "[code](https://host/name/blob/main/fedora_qa/causes.py)"
    assert site_text(text, "docs/ci.md", PATHS, "https://host/name") == moved.format(linked)
    assert site_text("[a](docs/ci.md)", "CHANGELOG.md", PATHS, "") == "[a](ci.md)"


def test_what_a_page_loads_from_elsewhere_is_found() -> None:
    """Scripts, styles and images of other hosts; not what a reader may follow, nor what lies on the site."""
    page = '<a href="https://a"></a><script src="x.js"></script><link rel="canonical" href="https://b">'
    assert not loaded_from_elsewhere(page)
    page += '<script src="https://c/s.js"></script><link rel="stylesheet" href="//d/s.css"><img src="http://e/i.png">'
    assert loaded_from_elsewhere(page) == ["https://c/s.js", "//d/s.css", "http://e/i.png"]


@pytest.mark.parametrize("name", sorted(cause_pages()))
def test_causes_have_the_texts_of_the_code(name: str) -> None:
    """The pages are as ``make docs`` writes them."""
    assert (DOCS / "causes" / name).read_text(encoding="utf-8") == cause_pages()[name], "run `make docs`"


def test_no_page_of_a_cause_is_left_over() -> None:
    """A cause that is gone takes its page with it."""
    assert {path.name for path in (DOCS / "causes").iterdir()} == set(cause_pages())


def test_datasets_are_those_of_the_layout() -> None:
    """The page is as ``make docs`` writes it."""
    assert (DOCS / "datasets.md").read_text(encoding="utf-8") == layout_page(), "run `make docs`"


def test_the_reference_has_every_public_name() -> None:
    """What ``fedora_qa`` exports stands on the page of the API."""
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    assert [name for name in fedora_qa.__all__ if name != "__version__" and f".{name}\n" not in page] == []


def test_all_files_state_the_same_version() -> None:
    """Package, citation, the newest section of the changelog, and every version that an example pins agree."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["version"] == fedora_qa.__version__
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == fedora_qa.__version__
    for name in ("ci.md", "examples/gate.yml", "examples/pre-commit-config.yaml"):
        pinned = re.findall(r"\bv\d+\.\d+\.\d+", (DOCS / name).read_text(encoding="utf-8"))
        assert set(pinned) == {f"v{fedora_qa.__version__}"}, name
    sections = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sections[0] == fedora_qa.__version__
