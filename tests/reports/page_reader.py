"""Read a report as a browser would: its elements, their order, and the text between them."""

import base64
import hashlib
from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = {"meta", "link", "img", "br", "hr", "input", "wbr"}
SELF_CLOSED_IN_SVG = {"path", "rect", "line", "circle", "use"}


@dataclass
class Element:
    """One element with its attributes, the tags around it, and the text inside it."""

    tag: str
    attributes: dict[str, str | None]
    around: tuple["Element", ...]
    text: str = ""
    inside: list["Element"] = field(default_factory=list)

    def within(self, tag: str) -> "Element | None":
        """The nearest element of this tag around it."""
        return next((one for one in reversed(self.around) if one.tag == tag), None)


class PageReader(HTMLParser):
    """Collects all elements; raises where one is closed that is not open, or left open."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[Element] = []
        self._open: list[Element] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        if len(names) != len(set(names)):
            raise ValueError(f"Expected each attribute once, got <{tag} {names}>")
        element = Element(tag, dict(attrs), tuple(self._open))
        self.elements.append(element)
        for one in self._open:
            one.inside.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in SELF_CLOSED_IN_SVG:
            raise ValueError(f"Expected <{tag}/> only in drawings")
        self.handle_starttag(tag, attrs)
        self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open[-1].tag != tag:
            raise ValueError(f"Expected </{self._open[-1].tag if self._open else 'nothing'}>, got </{tag}>")
        self._open.pop()

    def handle_data(self, data: str) -> None:
        for one in self._open:
            one.text += data

    def close(self) -> None:
        super().close()
        if self._open:
            raise ValueError(f"Expected all elements to be closed, got <{self._open[-1].tag}> open")


@dataclass(frozen=True)
class ReadPage:
    """The elements of a report in their order."""

    elements: tuple[Element, ...]

    def all(self, tag: str, **attributes: str) -> list[Element]:
        """Elements of a tag; ``kind`` selects by one of their classes."""
        kind = attributes.get("kind")
        return [
            one
            for one in self.elements
            if one.tag == tag and (kind is None or kind in (one.attributes.get("class") or "").split())
        ]

    @property
    def text(self) -> str:
        """All text, with single spaces; style sheets are no text."""
        (body,) = self.all("body")
        return " ".join(body.text.split())


def read_page(html: str) -> ReadPage:
    """Read a report, and raise where it is not well formed."""
    reader = PageReader()
    reader.feed(html)
    reader.close()
    return ReadPage(tuple(reader.elements))


def complaints_about(page: ReadPage) -> list[str]:
    """Everything that no report may have: dangling links, double ids, pictures without words, requests."""
    ids = [one.attributes["id"] for one in page.elements if "id" in one.attributes]
    told = [f"id {name} occurs twice" for name in set(ids) if ids.count(name) > 1]
    told += _scripts(page)
    for one in page.elements:
        told += _addresses(one, set(ids))
        told += [f"script: {name}" for name in one.attributes if name.startswith("on")]
        if one.tag == "img":
            figure = one.within("figure")
            if not one.attributes.get("alt"):
                told.append("a picture without words")
            if figure is None or not any(part.tag == "figcaption" and part.text.strip() for part in figure.inside):
                told.append("a picture without caption")
    return told


def _scripts(page: ReadPage) -> list[str]:
    """Every script that the page's own policy does not name by its digest."""
    policies = [one.attributes.get("content") or "" for one in page.all("meta")]
    told = []
    for one in page.all("script"):
        digest = base64.b64encode(hashlib.sha256(one.text.encode()).digest()).decode()
        if set(one.attributes) or not any(f"script-src 'sha256-{digest}';" in policy for policy in policies):
            told.append("script")
    return told


def _addresses(one: Element, ids: set[str | None]) -> list[str]:
    told = []
    for name in ("href", "src", "srcset", "action", "data", "poster", "xlink:href"):
        address = one.attributes.get(name)
        if address is None or address.startswith("data:"):
            continue
        if not address.startswith("#"):
            told.append(f"request: {address}")
        elif address[1:] not in ids:
            told.append(f"no place {address}")
    return told
