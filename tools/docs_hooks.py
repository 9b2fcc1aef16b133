"""Hooks of mkdocs: what the pages in docs/ link to outside of it comes along, and each module gets an API page.

Pages keep the links that work in a checkout; here `../evaluation/x.md` becomes `evaluation/x.md`, as that folder stands beside
the pages in the site. API pages are read from the sources, nothing is imported.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("evaluation", "pipelines", "datasets")
PAGES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")
_LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s]+)(\))")
_SHIM = "https://unpkg.com/iframe-worker/shim"
_SECRET = re.compile(r"(^|/)(__|_)")


def on_files(files: Any, config: Any) -> Any:
    """Add the folders and pages of the checkout, the notebook as a page, and the API pages."""
    from mkdocs.structure.files import File

    for source in _beside():
        name = source.relative_to(ROOT).as_posix()
        if source.suffix == ".md":
            files.append(File.generated(config, _in_site(name), content=source.read_text(encoding="utf-8")))
        else:
            files.append(File.generated(config, name, abs_src_path=str(source)))
    for name in FOLDERS:
        if files.get_file_from_path(f"{name}/index.md") is None:
            files.append(File.generated(config, f"{name}/index.md", content=_listed(name)))
    notebook = ROOT / "docs" / "first_map.ipynb"
    files.append(File.generated(config, "first_map.md", content=notebook_text(notebook)))
    modules = sorted(_modules())
    for module in modules:
        text = f"# {module}\n\n::: {module}\n"
        files.append(File.generated(config, f"api/{module}.md", content=text))
    lines = [f"- [{module}]({module}.md)" for module in modules]
    files.append(File.generated(config, "api/index.md", content="\n".join(["# API", "", *lines, ""])))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:  # noqa: ARG001  # mkdocs passes all
    """Turn the links of a page into those of the site."""
    return linked(markdown, page.file.src_uri)


def on_post_page(output: str, page: Any, config: Any) -> str:  # noqa: ARG001  # mkdocs passes all
    """Take what the search of a site on disk needs from the site, not from the network."""
    return without_network(output, page.url)


def without_network(html: str, url: str) -> str:
    """Return a page with the theme's one script from elsewhere replaced by our copy of it."""
    return html.replace(_SHIM, "../" * url.count("/") + "js/iframe-worker.js")


def linked(markdown: str, page: str) -> str:
    """Return the text of a page (its place in the site) with links that hold there."""

    def turned(found: re.Match[str]) -> str:
        target, hash_, anchor = found[2].partition("#")
        if not target or re.match(r"[a-z]+:", target):
            return found[0]
        return f"{found[1]}{_turned(target, page)}{hash_}{anchor}{found[3]}"

    return _LINK.sub(turned, markdown)


def _turned(target: str, page: str) -> str:
    """Return a link, relative to the checkout's file of a page, relative to its place in the site."""
    in_checkout = Path(page) if page.split("/")[0] in FOLDERS else Path("docs") / page
    outside = {_in_site(name): name for name in PAGES}
    in_checkout = Path(outside.get(page, str(in_checkout)))
    found = Path(_normal((in_checkout.parent / target).as_posix()))
    if (ROOT / found).is_dir() and found.as_posix() != ".":
        found = found / "README.md" if (ROOT / found / "README.md").is_file() else found / "index.md"
    site = _in_site(found.as_posix().removeprefix("docs/"))
    return "../" * page.count("/") + site


def _in_site(name: str) -> str:
    """Return where a file of the checkout stands in the site: README.md of a folder is its index."""
    if name in PAGES:
        return name.lower().replace(".md", "_page.md")
    return re.sub(r"README\.md$", "index.md", name)


def _normal(path: str) -> str:
    parts: list[str] = []
    for part in path.split("/"):
        if part == "..":
            parts.pop()
        elif part != ".":
            parts.append(part)
    return "/".join(parts)


def _beside() -> Iterator[Path]:
    yield from (ROOT / name for name in (*PAGES, "LICENSE"))
    for folder in FOLDERS:
        yield from sorted(path for path in (ROOT / folder).rglob("*") if path.is_file())


def _listed(folder: str) -> str:
    names = sorted(
        path.relative_to(ROOT / folder).as_posix() for path in (ROOT / folder).rglob("*.*") if path.is_file()
    )
    return "\n".join([f"# {folder}/", "", *(f"- [{name}]({name})" for name in names if not name.endswith(".png")), ""])


def _modules() -> Iterator[str]:
    for path in (ROOT / "lhdmap").rglob("*.py"):
        name = path.relative_to(ROOT).with_suffix("").as_posix()
        if not _SECRET.search(name):
            yield name.replace("/", ".")


def notebook_text(path: Path) -> str:
    """Return a notebook as a page: its texts, its code, what that printed and drew."""
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] != "code":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {})
            if "image/png" in data:
                parts.append(f"![what the cell draws](data:image/png;base64,{data['image/png'].strip()})")
            else:
                parts.append(f"```text\n{''.join(output.get('text', data.get('text/plain', []))).rstrip()}\n```")
    return "\n\n".join(parts) + "\n"
