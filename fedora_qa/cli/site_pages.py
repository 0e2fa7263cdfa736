"""The pages of the documentation site: those of ``docs`` and of the root, with links that hold on the site.

``python -m fedora_qa.cli.site_pages FOLDER [REPOSITORY]`` writes them. Links to files that are no pages lead to the
repository's web address; without an address they become plain text.
"""

import posixpath
import re
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from fedora_qa.cli.markdown import heading_anchor
from fedora_qa.record.atomic import write_text

ROOT_PAGES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "GLOSSARY.md": "glossary.md",
        "CHANGELOG.md": "changelog.md",
        "SECURITY.md": "security.md",
        "CODE_OF_CONDUCT.md": "code-of-conduct.md",
    }
)
"""Pages outside of ``docs``: where each stands on the site."""

_FENCED: Final = re.compile(r"(^```.*?^```$)", flags=re.MULTILINE | re.DOTALL)
_LINK: Final = re.compile(r"(?P<image>!?)\[(?P<label>[^\]]*)\]\((?P<target>[^()\s]+)\)")
_HEADING: Final = re.compile(r"^#{1,6} +(.+?) *$", flags=re.MULTILINE)


def page_paths(root: Path) -> Mapping[str, str]:
    """Return where each page and each asset stands on the site, by its path in the repository."""
    files = sorted(path for path in (root / "docs").rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    paths = {path.relative_to(root).as_posix(): path.relative_to(root / "docs").as_posix() for path in files}
    return paths | {path: name for path, name in ROOT_PAGES.items() if (root / path).is_file()}


def outside_fences(text: str, alter: Callable[[str], str]) -> str:
    """Return Markdown of which everything but fenced code is altered."""
    parts = _FENCED.split(text)
    return "".join(part if number % 2 else alter(part) for number, part in enumerate(parts))


def links(text: str) -> list[str]:
    """Return the targets of all links and images of a page, in order."""
    targets: list[str] = []

    def collect(part: str) -> str:
        targets.extend(link["target"] for link in _LINK.finditer(part))
        return part

    outside_fences(text, collect)
    return targets


def anchors(text: str) -> set[str]:
    """Return the anchors of the headings of a page, as GitHub and the site name them."""
    headings: list[str] = []

    def collect(part: str) -> str:
        headings.extend(_HEADING.findall(part))
        return part

    outside_fences(text, collect)
    # A link in a heading counts with its label alone.
    plain = (_LINK.sub(lambda link: link["label"], heading) for heading in headings)
    return {heading_anchor(heading) for heading in plain}


def is_external(target: str) -> bool:
    """Whether a link leads out of the repository."""
    return re.match(r"[a-z]+:", target) is not None


def linked_path(page: str, target: str) -> str:
    """Return the path in the repository to which a link of a page leads."""
    path = target.partition("#")[0]
    return posixpath.normpath(posixpath.join(posixpath.dirname(page), path)) if path else page


def site_text(text: str, page: str, paths: Mapping[str, str], repository: str) -> str:
    """Return a page as the site has it.

    Parameters
    ----------
    text
        The page, Markdown.
    paths
        Where each page and asset stands on the site, by its path in the repository.
    repository
        Web address of the repository; empty: links to other files become plain text.
    """

    def site_link(link: re.Match[str]) -> str:
        target = link["target"]
        if is_external(target) or target.startswith("#"):
            return link[0]
        path = linked_path(page, target)
        if path in paths:
            anchor = "#" + target.partition("#")[2] if "#" in target else ""
            place = posixpath.relpath(paths[path], posixpath.dirname(paths[page]) or ".")
            return f"{link['image']}[{link['label']}]({place}{anchor})"
        return f"[{link['label']}]({repository}/blob/main/{path})" if repository else link["label"]

    return outside_fences(text, lambda part: _LINK.sub(site_link, part))


def write_site_pages(root: Path, folder: Path, repository: str) -> None:
    """Write every page, and copy every asset, of a repository into an empty folder."""
    paths = page_paths(root)
    for path, place in paths.items():
        target = folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.endswith(".md"):
            text = (root / path).read_text(encoding="utf-8")
            write_text(target, site_text(text, path, paths, repository))
        else:
            shutil.copyfile(root / path, target)


if __name__ == "__main__":
    write_site_pages(Path(), Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "")
