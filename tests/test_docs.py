"""The documentation site: it builds with strict links, has all it should, loads nothing, and its snippets run."""

import re
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from doc_pages import PAGES, ROOT, Links, check_commands, run_snippet, snippets
from test_scripts import script
from test_structure import ORDER

from lhpost6_pin.cli import app
from lhpost6_pin.control import load_controller
from lhpost6_pin.effects.registry import LAWS
from lhpost6_pin.machine.library import families
from lhpost6_pin.machine.machine import load_machine

pytestmark = pytest.mark.long
on_site = pytest.mark.slow  # takes a minute, and what `pip install .[docs]` brings

BY_HAND = sorted(PAGES.rglob("*.md"))
RUN = ("bash", "python")
WITH_SNIPPETS = [page for page in BY_HAND if any(s.language in RUN for s in snippets(page))]
SHOWN = ("text", "console")
"""Languages of snippets that are shown and not run."""


def name(page: Path) -> str:
    return page.relative_to(PAGES).as_posix()


# --------------------------------------------------------------------------------------------------------- the site
@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("docs") / "site"
    ended = script("build_docs.py", "--out", out)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert ended.stdout.strip() == f"wrote {out / 'index.html'}"
    assert [p.name for p in out.parent.iterdir()] == ["site"]  # nothing half-built is left beside it
    return out


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Links]:
    return {path: Links(path) for path in sorted(site.rglob("*.html"))}


@on_site
def test_no_page_loads_anything_from_elsewhere(site, pages):
    for path, page in pages.items():
        for source in page.loads:
            assert not urlsplit(source).netloc, f"{path.name} loads {source}"
    for style in site.rglob("*.css"):
        wanted = re.findall(r"(?:url\(|@import)\s*['\"]?([^'\")]+)", style.read_text(encoding="utf-8"))
        assert [w for w in wanted if urlsplit(w).netloc] == [], style
    assert "unpkg" not in "".join(path.read_text(encoding="utf-8") for path in pages)


@on_site
def test_every_link_and_anchor_leads_somewhere(site, pages):
    for path, page in pages.items():
        if path.name == "404.html":  # served at any address, so that its links are absolute
            continue
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.is_file() and target.is_relative_to(site.resolve()), f"{path.name}: {link}"
            anchor = unquote(parts.fragment)
            if anchor and target.suffix == ".html" and not anchor.startswith("__"):  # those are the theme's own
                assert anchor in pages[site / target.relative_to(site.resolve())].ids, f"{path.name}: {link}"


@on_site
def test_every_page_by_hand_is_there_and_frames_in_braces_are_not_taken_for_markup(site):
    for page in BY_HAND:
        assert (site / page.relative_to(PAGES)).with_suffix(".html").is_file()
    text = (site / "machine.html").read_text(encoding="utf-8")
    assert "<td>those of {s}</td>" in text and "<td>{n_i}</td>" in text


@on_site
def test_every_image_says_what_it_shows(site):
    for path in site.rglob("*.html"):
        for image in re.findall(r"<img [^>]*>", path.read_text(encoding="utf-8")):
            assert len(re.search(r'alt="([^"]*)"', image).group(1)) > 30, f"{path.name}: {image}"


@on_site
def test_every_command_has_its_section_and_options(site):
    text = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    for command in app.registered_commands:
        assert f'id="lhpost6-{command.name or command.callback.__name__}"' in text
    for option in ("--beyond-limits", "--hold-out", "--model, --override", "--errors, --no-errors"):
        assert f"<code>{option}</code>" in text
    assert "--no-locked" not in text  # flags with a name of their own have no opposite


@on_site
def test_every_family_has_its_section_with_its_numbers(site, pages):
    ids = pages[site / "reference" / "library.html"].ids
    text = (site / "reference" / "library.html").read_text(encoding="utf-8")
    for family in families().values():
        assert family.name in ids
        assert all(f"<code>{s.name}</code>" in text for s in family.shapes if not re.search(r"_\d+$", s.name))


@on_site
def test_every_law_module_has_its_page_with_equation_code_use_and_tests(site):
    from docs import theory

    assert sorted(name for names in theory.PAGES.values() for name in names) == list(theory.law_modules())
    assert {law for page in theory.PAGES for law in theory.laws_on(page)} == set(LAWS)
    for name, modules in theory.PAGES.items():
        page = (site / "theory" / f"{name}.html").read_text(encoding="utf-8")
        for module in modules:
            assert f'id="lhpost6_pin.laws.{module}.' in page  # its kernels
        assert 'class="quote"' in page or 'class="mkdocstrings-source"' in page  # their source
        assert 'id="uses"' in page and "tests/test_law_battery.py" in page
        by_hand = (PAGES / "theory" / f"{name}.md").read_text(encoding="utf-8")
        assert re.search(r"\*\*Sign\.\*\*", by_hand) and re.search(r"\*\*In a record\.\*\*", by_hand)


@on_site
def test_the_pages_of_the_controller_have_its_settings_code_and_tests(site):
    from docs import controller

    settings = load_controller("lhpost6")
    named = {key.split(".")[1] for key in settings.stated}
    assert set(controller.SYMBOLS) == named - {"rate", "spool_limit"}  # which no equation has
    pages = {name: (site / "theory" / f"{name}.html").read_text() for name in ("control", "stability", "iteration")}
    for key in settings.stated:
        section, setting = key.split(".")
        assert f"<code>{setting}</code>" in pages["control"] or f"<code>{section}</code>" in pages["control"]
    for name, page in pages.items():
        assert 'id="code"' in page and 'id="tests"' in page and "<code>tests/test_" in page
        by_hand = (PAGES / "theory" / f"{name}.md").read_text()
        assert all(f"**{word}.**" in by_hand for word in ("Where it acts", "Sign", "In a record"))
    assert 'id="lhpost6_pin.control.loop.control_step"' in pages["control"]
    assert 'id="lhpost6_pin.control.filters.reference_generator"' in pages["control"]
    assert " dB at " in pages["stability"]


@on_site
def test_the_stored_audit_is_a_whole_one_that_found_nothing_amiss(site):
    stored = (ROOT / "scripts" / "docs" / "audit.md").read_text()
    assert "`python scripts/audit.py --seconds 60`" in stored
    assert stored.count("| the same |") == 2 and "DIFFERENT" not in stored
    titles = re.findall(r"^## (.+)$", stored, re.MULTILINE)
    page = (site / "results" / "audit.html").read_text()
    assert len(titles) == 3 and all(title in page for title in titles)


@on_site
def test_the_stored_wait_of_a_newcomer_is_within_what_is_wanted(site):
    stored = (ROOT / "scripts" / "docs" / "fresh.md").read_text()
    rows = re.findall(r"^\| .+ \| (\d+) \| (\d+) \|$", stored, re.MULTILINE)
    assert len(rows) == 4
    assert all(float(found) <= float(wanted) for found, wanted in rows[:3])  # seconds
    assert float(rows[3][0]) >= float(rows[3][1])  # frames a second
    assert "Time to the first result" in (site / "results" / "audit.html").read_text()


@on_site
def test_every_example_is_on_its_page_with_its_code(site):
    page = (site / "tutorials" / "examples.html").read_text()
    assert all(path.name in page for path in (ROOT / "scripts").glob("example_*.py"))
    assert page.count("find_missing_effect") >= 2 and "run_ensemble" in page


@on_site
def test_every_assumed_number_of_the_machine_is_on_its_page(site):
    text = (site / "assumptions.html").read_text(encoding="utf-8")
    for path, quantity in load_machine().parameters.items():
        if quantity.evidence in ("assumed", "drawn", "derived"):
            assert f"{path}</code>" in text


@on_site
def test_figures_are_the_same_however_often_they_are_drawn(tmp_path):
    from docs.figures import FIGURES, draw_all

    for folder in ("once", "again"):
        draw_all(tmp_path / folder)
    for figure in FIGURES:
        first, second = ((tmp_path / folder / f"{figure}.svg").read_bytes() for folder in ("once", "again"))
        assert first == second and b"<dc:date>" not in first


@on_site
def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    ended = script("build_docs.py", "--out", tmp_path)
    assert ended.returncode == 1 and "holds something else" in ended.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_the_folders_on_their_page_are_those_of_the_package_in_the_order_of_imports():
    text = (PAGES / "develop" / "where.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)/` \|", text, re.MULTILINE) == ORDER


@pytest.mark.parametrize("page", BY_HAND, ids=name)
def test_files_and_modules_that_pages_name_exist_with_the_names_given_in_them(page):
    text, package = page.read_text(encoding="utf-8"), ROOT / "lhpost6_pin"
    folders = "|".join(ORDER)
    for path, names in re.findall(rf"`(?:lhpost6_pin/)?((?:{folders})/[\w./]*)`(?:: ((?:`\w+`(?:, )?)+))?", text):
        assert (package / path).exists(), path
        for given in re.findall(r"\w+", names):
            assert re.search(rf"\b{given}\b", (package / path).read_text(encoding="utf-8")), f"{path}: {given}"
    for path in re.findall(r"`((?:models|scripts|tests)/[\w./]+)`", text):
        assert (ROOT / path).exists(), path
    for module in re.findall(rf"`(?:lhpost6_pin\.)?((?:{folders})\.[\w.]+)`", text):
        folder = package.joinpath(*module.split(".")[:-1])
        assert folder.is_dir() or folder.with_suffix(".py").is_file(), module


def test_modules_whose_functions_a_page_lists_are_in_the_reference():
    """The site takes links to them from there; it is built by the slow tests alone."""
    every = "\n".join(page.read_text(encoding="utf-8") for page in BY_HAND)
    listed, known = (
        {module for names in re.findall(rf"<!-- insert: {what} (.*?) -->", every) for module in names.split()}
        for what in ("functions", "api")
    )
    assert listed and listed <= known


def test_identifiers_of_the_glossary_are_in_use():
    sources = [*(ROOT / "lhpost6_pin").rglob("*.py"), *(ROOT / "models").rglob("*.toml")]
    words = set(re.findall(r"\w+", "".join(path.read_text(encoding="utf-8") for path in sources)))
    text = (PAGES / "glossary.md").read_text(encoding="utf-8")
    given = {x for line in text.splitlines() if line.startswith("| ") for x in re.findall(r"`(\w+)`", line)}
    assert len(given) > 90 and given <= words, given - words


# --------------------------------------------------------------------------------------------------------- snippets


@pytest.mark.parametrize("page", BY_HAND, ids=name)
def test_every_snippet_says_what_it_is_and_what_is_typed_into_a_console_installs_and_no_more(page):
    for snippet in snippets(page):
        assert snippet.language in (*RUN, *SHOWN, "{"), f"{page.name}: {snippet.language}"
        lines = snippet.text.splitlines() if snippet.language == "console" else []
        assert all(re.match(r"\$ .*pip install ", line) for line in lines)


def run_page(page: Path, folder: Path, *, slow: bool) -> None:
    """Run a page's snippets in order in one folder; those that take minutes only if asked."""
    for number, snippet in enumerate(s for s in snippets(page) if s.language in RUN):
        if snippet.slow and not slow:
            continue
        ended = run_snippet(snippet, folder)
        said = f"{name(page)}, snippet {number + 1}:\n{snippet.text}\n{ended.stdout}\n{ended.stderr}"
        assert ended.returncode == 0, said


@pytest.mark.parametrize("page", WITH_SNIPPETS, ids=name)
def test_commands_on_a_page_have_options_that_exist(page):
    check_commands("".join(s.text for s in snippets(page) if s.language == "bash"))


@pytest.mark.slow  # commands of the README, each in a process
def test_the_snippets_of_the_first_page_run_in_order(tmp_path):
    run_page(PAGES / "start.md", tmp_path, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_SNIPPETS, ids=name)
def test_the_snippets_of_a_page_run_in_order(page, tmp_path):
    run_page(page, tmp_path, slow=True)
