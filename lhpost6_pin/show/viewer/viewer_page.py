"""The page that shows a scene: meshcat's viewer, a caption, and a bar to play, pause, scrub and choose what to see."""

import base64
import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any

from ...core.files import write_whole

__all__ = ["Caption", "Picture", "render_page"]


@dataclass(frozen=True)
class Caption:
    """Text of a page, and the layers of its scene that can be switched off."""

    title: str
    note: str = ""
    legend: Mapping[str, str] | None = None  # words and colours such as #0072B2
    layers: Mapping[str, Sequence[str]] | None = None  # words and paths in the scene
    start: float = 0.0  # time of the first frame [s]
    step: float = 1.0 / 30.0  # of an arrow key [s]
    histories: Sequence[Mapping[str, Any]] = ()  # of `packed_histories`
    bare: bool = False  # the scene alone, within another page


@dataclass(frozen=True)
class Picture:
    """A page that plays off line: to be saved, or shown in a notebook."""

    page: str
    height: int = 560  # in a notebook [CSS px]

    def save(self, path: Path | str) -> None:
        """Write the page to one HTML file, whole or not at all."""
        with write_whole(path) as beside:
            beside.write_text(self.page, encoding="utf-8")

    def _repr_html_(self) -> str:
        """The page inside a notebook's own."""
        inside = html.escape(self.page, quote=True)
        return f'<iframe srcdoc="{inside}" style="width:100%;height:{self.height}px;border:0"></iframe>'


def render_page(caption: Caption, commands: Sequence[bytes] = (), *, live: bool = False) -> str:
    """Return a page that draws `commands` and loads nothing; a live one then connects to its own server."""
    import meshcat

    library = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"
    marks = (
        f'<span class="kind"><span class="mark" style="background:{html.escape(colour)}"></span>'
        f"{html.escape(word)}</span> "
        for word, colour in (caption.legend or {}).items()
    )
    boxes = (
        f'<label><input type="checkbox" checked data-paths="{html.escape(json.dumps(list(paths)))}">'
        f" {html.escape(word)}</label> "
        for word, paths in (caption.layers or {}).items()
    )
    return Template(_beside("page.html")).substitute(
        connect="'self'" if live else "'none'",
        title=html.escape(caption.title),
        note=html.escape(caption.note),
        legend="".join(marks),
        layers="".join(boxes),
        style=_beside("page.css"),
        library=library.read_text(encoding="utf-8").replace("</script", "<\\/script"),
        commands=json.dumps([base64.b64encode(command).decode("ascii") for command in commands]),
        settings=json.dumps({"start": caption.start, "step": caption.step, "live": live, "bare": caption.bare}),
        histories=json.dumps(caption.histories).replace("<", "\\u003c"),
        script=_beside("page.js") + _beside("histories.js"),
    )


def _beside(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")
