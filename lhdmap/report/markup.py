"""The frame of the HTML pages: one file, no network; all text is escaped here."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from importlib import resources

from lhdmap.names import shown


def document(title: str, body: str) -> str:
    """Return a whole page with the style in it; `body` is markup, `title` is text."""
    style = resources.files("lhdmap.report").joinpath("style.css").read_text(encoding="utf-8")
    title = html.escape(title)
    return shown(
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{body}</body>\n</html>\n"
    )


def section(title: str, body: str) -> str:
    """Return a section with a heading; nothing where the body is empty."""
    return f"<section>\n<h2>{title}</h2>\n{body}</section>\n" if body else ""


def cards(figures: Iterable[tuple[str, str, str]], more: str = "") -> str:
    """Return cards of name, value and meaning; `more` is markup after the last one."""
    return f"<div class=cards>\n{card_list(figures)}{more}</div>\n"


def card_list(figures: Iterable[tuple[str, str, str]]) -> str:
    """Return the cards of name, value and meaning without a frame around them."""
    return "".join(
        f"<div class=card><b>{html.escape(value)}</b><span>{html.escape(name)}</span>"
        f"<p>{html.escape(meaning)}</p></div>\n"
        for name, value, meaning in figures
    )


def terms(words: Iterable[tuple[str, str]]) -> str:
    """Return words and what they mean, folded away."""
    rows = "".join(f"<dt>{html.escape(word)}</dt><dd>{html.escape(meaning)}</dd>\n" for word, meaning in words)
    return f"<details><summary>What the words mean</summary><dl>\n{rows}</dl></details>\n" if rows else ""


def paragraph(words: str) -> str:
    """Return a paragraph of text."""
    return f"<p>{html.escape(words)}</p>\n"


def listed(items: Iterable[str], kind: str) -> str:
    """Return a list of texts of a kind (`warning`, `missing`)."""
    rows = "".join(f"<li>{html.escape(item)}</li>\n" for item in items)
    return f"<ul class={kind}>\n{rows}</ul>\n" if rows else ""


def table(
    head: Sequence[str], rows: Sequence[Sequence[object]], *, numbers_from: int = 99, numbers_to: int = 99
) -> str:
    """Return a table; columns from `numbers_from` to before `numbers_to` hold numbers and are set flush right."""

    def line(tag: str, cells: Sequence[object]) -> str:
        marked = (
            f"<{tag}{' class=number' if numbers_from <= i < numbers_to else ''}>{html.escape(str(cell))}</{tag}>"
            for i, cell in enumerate(cells)
        )
        return f"<tr>{''.join(marked)}</tr>\n"

    body = "".join(line("td", row) for row in rows)
    return f"<div class=table><table>\n{line('th', head) if any(head) else ''}{body}</table></div>\n"


def picture(uri: str, caption: str) -> str:
    """Return a picture with its caption, which is its text for those who cannot see it as well."""
    alt = html.escape(caption)
    return f'<figure><img src="{uri}" alt="{alt}"><figcaption>{alt}</figcaption></figure>\n'
