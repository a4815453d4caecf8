"""The summary of a report, taken from its page: as a page of its own, and as plain text."""

import re

from .page import Markup, plain_text

__all__ = ["summary_only", "summary_text"]


def summary_only(page: str) -> str:
    """The page of a report as text (`render_page`) cut after its summary, without navigation and script."""
    head, rest = page.split("<body>", 1)
    summary = rest[rest.index("<header>") : rest.index("</header>")]
    return f"{head}<body>\n<main>{summary}</header></main>\n</body></html>\n"


def summary_text(page: str) -> str:
    """The summary of a report (`render_page`) as plain text: lines for kind and title, verdict, and each key figure."""
    summary = page[page.index("<header>") : page.index("</header>")]

    def parts(pattern: str) -> list[tuple[str, ...]]:
        found = (match.groups() for match in re.finditer(pattern, summary, re.DOTALL))
        return [tuple(plain_text(Markup(part)) for part in groups) for groups in found]

    kinds = parts(r'<p class="kind">(.*?)</p><h1>(.*?)</h1>')
    verdicts = parts(r'<p class="verdict [^>]*><span[^>]*>[^<]*</span><span>(.*?)</span></p>')
    tiles = parts(r'<dt>(.*?)</dt><dd><span class="value">(.*?)</span><span class="note">(.*?)</span></dd>')
    figures = [f"- {label}: {value}" + (f" ({note})" if note else "") for label, value, note in tiles]
    return "\n".join([*(f"{kind}: {title}" for kind, title in kinds), *(v for (v,) in verdicts), *figures])
