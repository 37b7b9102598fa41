"""Labels of axes can be read: no two lie on each other."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import liemech as lm

pytest.importorskip("matplotlib", reason="needs the extra plot")


@pytest.mark.sample(1)
@pytest.mark.parametrize("count", [4, 5, 6, 7, 8, 11])
def test_labels_of_steps_do_not_overlap(count: int) -> None:
    steps = 2.0 ** -np.arange(1.0, count + 1)
    figure = lm.plots.orders(steps, {"two": steps**2}).figure
    figure.set_size_inches(4.5, 4.0)
    figure.draw_without_rendering()
    ticks = figure.axes[0].xaxis
    labels = [*ticks.get_majorticklabels(), *ticks.get_minorticklabels()]
    seen = [label.get_window_extent() for label in labels if label.get_text()]
    low, high = figure.axes[0].bbox.intervalx
    inside = sorted((b.x0, b.x1) for b in seen if low <= (b.x0 + b.x1) / 2 <= high)
    assert len(inside) > 1
    assert all(left[1] < right[0] for left, right in pairwise(inside))
