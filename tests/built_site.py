"""Does the built site need a network? ``python -m tests.built_site out/site`` fails where a page loads from elsewhere.

Links that a reader follows may lead anywhere. What a page loads by itself lies on the site.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Final

LOADED: Final = {
    **dict.fromkeys(("script", "img", "iframe", "source", "video", "audio", "embed", "input"), ("src", "srcset")),
    "link": ("href",),
    "object": ("data",),
}
"""Attributes of tags whose addresses a browser loads."""

NOT_LOADED: Final = {"canonical", "prev", "next", "alternate"}
"""Relations of a ``link`` that a browser does not load."""


class LoadedAddresses(HTMLParser):
    """The addresses that a page loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the addresses of a tag."""
        attributes = dict(attrs)
        if tag == "link" and attributes.get("rel") in NOT_LOADED:
            return
        self.addresses += [attributes[name] or "" for name in LOADED.get(tag, ()) if name in attributes]


def loaded_from_elsewhere(text: str) -> list[str]:
    """Return the addresses on other hosts that a page loads."""
    parser = LoadedAddresses()
    parser.feed(text)
    return [address for address in parser.addresses if address.startswith(("http:", "https:", "//"))]


def main(site: Path) -> None:
    """Read every page and style of the site."""
    pages = sorted(site.rglob("*.html"))
    if not pages:
        raise SystemExit(f"Expected pages below {site}, got none; build them with `make site`")
    elsewhere = {page: loaded_from_elsewhere(page.read_text(encoding="utf-8")) for page in pages}
    elsewhere |= {
        style: ["an address in url()"]
        for style in site.rglob("*.css")
        if "url(http" in style.read_text(encoding="utf-8").replace('"', "").replace("'", "")
    }
    wrong = [f"{page}: {', '.join(addresses)}" for page, addresses in elsewhere.items() if addresses]
    if wrong:
        raise SystemExit("Expected a site that loads nothing from other hosts, got:\n" + "\n".join(wrong))
    print(f"{len(pages)} pages in {site}, which load nothing from other hosts")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
