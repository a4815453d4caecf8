"""Reading the pages that reports write: elements, words, figures and verdict."""

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np

NO_NUMBER = re.compile(r"\b(nan|inf|none)\b", re.IGNORECASE)


class Reader(HTMLParser):
    """Elements of a page, its words, its scripts, and the data of its figures."""

    def __init__(self, page: str | Path) -> None:
        super().__init__()
        self.page = page.read_text(encoding="utf-8") if isinstance(page, Path) else page
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.figures: dict[str, dict] = {}
        self.scripts: list[str] = []
        self.texts: list[str] = []
        self.feed(self.page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        tag, attributes = self.tags[-1] if self.tags else ("", {})
        if tag == "script" and "data-for" in attributes:
            assert attributes["data-for"] not in self.figures
            self.figures[str(attributes["data-for"])] = json.loads(data)
        elif tag == "script":
            self.scripts.append(data)
        elif tag != "style":
            self.texts.append(data)

    @property
    def words(self) -> str:
        """All text, one blank between words; blanks that hold a line together stay."""
        return re.sub(r"[ \n\t]+", " ", " ".join(self.texts))

    @property
    def verdict(self) -> tuple[str, str]:
        """Level and words of the verdict."""
        found = re.search(r'<p class="verdict (\w+)">.*?<span>(.*?)</span></p>', self.page)
        assert found
        return found[1], found[2]

    def attributes(self, name: str) -> list[str]:
        """Values of an attribute over all elements."""
        return [str(attributes[name]) for _, attributes in self.tags if name in attributes]


def numbers(packed: dict[str, str]) -> np.ndarray:
    """Numbers of a drawn curve, as the page's script unpacks them."""
    return np.frombuffer(base64.b64decode(packed["bdata"]), dtype=f"<{packed['dtype']}")
