"""Spools that two threads deliver at the same time, as after two reloads in a row."""

from pathlib import Path

from monitor.outputs.spool import Spool


def test_lines_appended_after_another_delivery_are_kept(tmp_path: Path) -> None:
    """The later delivery has opened a file that the earlier one removes: it must not remove its successor."""
    spool = Spool(tmp_path / "spool.jsonl")
    spool.append(['{"a": 1}'])

    def meanwhile(_: list[str]) -> None:
        assert spool.deliver(lambda _: None, 10) == 1
        assert not spool.waiting
        spool.append(['{"b": 2}'])

    assert spool.deliver(meanwhile, 10) == 1
    found: list[str] = []
    spool.deliver(found.extend, 10)
    assert found == ['{"b": 2}']


def test_spool_removed_during_delivery_is_no_error(tmp_path: Path) -> None:
    spool = Spool(tmp_path / "spool.jsonl")
    spool.append(['{"a": 1}'])
    assert spool.deliver(lambda _: spool.path.unlink(), 10) == 1
