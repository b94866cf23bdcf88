"""Plots as files: whole or not at all."""

import secrets

import numpy as np
import pytest
from matplotlib.figure import Figure

from omnisim.core.errors import OutputError
from omnisim.plots.style import FORMATS, write_plot


@pytest.mark.parametrize("suffix", FORMATS)
def test_full_disk_leaves_nothing(tmp_path, monkeypatch, suffix):
    monkeypatch.setattr(secrets, "token_hex", lambda size: "full")
    (tmp_path / ".omnisim-full.partial").symlink_to("/dev/full")
    figure = Figure()
    figure.subplots().imshow(np.random.default_rng(0).random((200, 200)))
    with pytest.raises(OutputError, match=r"cannot be written: No space left on device"):
        write_plot(tmp_path / f"a.{suffix}", figure)
    assert not list(tmp_path.iterdir())
