"""The docs site: links that hold in a checkout hold there, settings that pages name exist, and mkdocs takes it strictly."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from lhdmap.config import Settings, settings_table
from tools.docs_hooks import linked, notebook_text, without_network

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("page", "link", "wanted"),
    [
        ("odometry.md", "../evaluation/odometry.md#cpu", "evaluation/odometry.md#cpu"),
        ("odometry.md", "smoother.md", "smoother.md"),
        ("odometry.md", "../evaluation", "evaluation/index.md"),
        ("mines.md", "../pipelines/mines/README.md", "pipelines/mines/index.md"),
        ("notes/topology.md", "../topology.md", "../topology.md"),
        ("evaluation/odometry.md", "../docs/odometry.md", "../odometry.md"),
        ("evaluation/odometry.md", "img/csail.png", "../evaluation/img/csail.png"),
        ("readme_page.md", "docs/img/cloud.png", "img/cloud.png"),
        ("start_contributor.md", "../CONTRIBUTING.md", "contributing_page.md"),
        ("index.md", "https://example.org/x.md", "https://example.org/x.md"),
        ("first_map.md", "data:image/png;base64,AAAA", "data:image/png;base64,AAAA"),
    ],
)
def test_links_lead_to_the_same_file_in_the_site(page: str, link: str, wanted: str) -> None:
    assert linked(f"see [a]({link}).", page) == f"see [a]({wanted})."


def test_the_notebook_is_a_page_with_its_pictures() -> None:
    text = notebook_text(ROOT / "docs" / "first_map.ipynb")
    assert text.startswith("# A first map")
    assert "lhdmap.build_map" in text
    assert "](data:image/png;base64," in text


def test_the_search_of_a_site_on_disk_needs_no_network() -> None:
    html = without_network('<script src="https://unpkg.com/iframe-worker/shim"></script>', "api/lhdmap.html")
    assert html == '<script src="../js/iframe-worker.js"></script>'
    assert (ROOT / "docs" / "js" / "iframe-worker.js").is_file()


def test_the_settings_that_pages_name_exist() -> None:
    table = settings_table(Settings())
    text = (ROOT / "docs" / "symptoms.md").read_text(encoding="utf-8")
    named = re.findall(r"`([a-z_]+)\.([a-z_]+)(?:=\w+)?`", text)
    named = [(section, key) for section, key in named if key not in ("toml", "json", "html", "value")]
    assert len(named) > 15
    for section, key in named:
        assert key in table[section], f"{section}.{key}"


def test_mkdocs_takes_it_strictly(tmp_path: Path) -> None:
    mkdocs = shutil.which("mkdocs", path=str(ROOT / ".venv-docs" / "bin"))
    if mkdocs is None:
        pytest.skip("the docs' environment is not there: make docs")
    command = [mkdocs, "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    assert 'src="http' not in (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
