"""An audit that was changed is found: in the middle, at the end with its head kept elsewhere, torn."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from lhdmap.cli.main import main
from lhdmap.console.audit import NOTHING, Audit, check, kept_in
from lhdmap.errors import EvaluationShortfall, InputError


@pytest.fixture
def whole(tmp_path: Path) -> tuple[Path, list[str]]:
    audit = Audit(tmp_path / "audit.jsonl")
    heads = [audit.write(float(k), "anna", "command", kind="answer", number=k) for k in range(5)]
    audit.close()
    return audit.path, heads


def test_each_line_has_the_hash_of_the_one_before(whole: tuple[Path, list[str]]) -> None:
    path, heads = whole
    lines = path.read_bytes().splitlines()
    assert [json.loads(line)["before"] for line in lines] == [NOTHING, *heads[:-1]]
    assert [hashlib.sha256(line).hexdigest() for line in lines] == heads
    assert check(path, heads) == (5, heads[-1])
    assert path.stat().st_mode & 0o077 == 0


def test_the_chain_goes_on_where_it_ended(whole: tuple[Path, list[str]]) -> None:
    path, heads = whole
    audit = Audit(path)
    assert audit.head == heads[-1]
    audit.write(9.0, "bert", "logs in")
    audit.close()
    assert check(path, heads).lines == 6


@pytest.mark.parametrize("number", [0, 2, 3])
def test_a_changed_line_is_found_at_the_next_one(whole: tuple[Path, list[str]], number: int) -> None:
    path, _ = whole
    lines = path.read_bytes().splitlines(keepends=True)
    lines[number] = lines[number].replace(b"anna", b"bert")
    path.write_bytes(b"".join(lines))
    with pytest.raises(EvaluationShortfall, match=f"line {number + 2} does not follow"):
        check(path)
    with pytest.raises(EvaluationShortfall):
        Audit(path)


@pytest.mark.parametrize("gone", [[1], [0], [2, 3]])
def test_lines_that_were_taken_out_are_found(whole: tuple[Path, list[str]], gone: list[int]) -> None:
    path, _ = whole
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(line for k, line in enumerate(lines) if k not in gone))
    with pytest.raises(EvaluationShortfall, match="does not follow"):
        check(path)


def test_a_last_line_that_was_cut_is_found_by_its_kept_hash_alone(
    whole: tuple[Path, list[str]], tmp_path: Path
) -> None:
    path, heads = whole
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-1]))
    assert check(path).lines == 4
    journal = tmp_path / "journal.jsonl"
    rows = [{"values": {"audit": heads[1]}}, {"values": {}}, {"values": {"audit": heads[4]}}]
    journal.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert kept_in(journal) == [heads[1], heads[4]]
    with pytest.raises(EvaluationShortfall, match=heads[4]):
        check(path, kept_in(journal))
    assert main(["console", "--check-audit", str(path), "--quiet"]) == 0
    assert main(["console", "--check-audit", str(path), "--kept", str(journal), "--quiet"]) == 1


def test_a_torn_line_is_found(whole: tuple[Path, list[str]]) -> None:
    path, _ = whole
    path.write_bytes(path.read_bytes()[:-7])
    with pytest.raises(EvaluationShortfall, match="torn"):
        Audit(path)


def test_what_is_no_audit_or_journal_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        check(tmp_path / "none")
    (tmp_path / "journal.jsonl").write_text("[1]\n")
    with pytest.raises(InputError, match="journal"):
        kept_in(tmp_path / "journal.jsonl")
