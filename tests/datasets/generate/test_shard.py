"""Summaries of shards."""

import pytest

from omnisim.datasets.generate.shard import find_shard


@pytest.mark.parametrize("text", ["[" * 100_000, "[]", '{"shard": 1e999}', "\x00"])
def test_a_damaged_summary_is_none(tmp_path, text):
    (tmp_path / "shard-000000.tar").write_bytes(b"")
    (tmp_path / "shard-000000.json").write_text(text)
    assert find_shard(tmp_path, 0) is None
