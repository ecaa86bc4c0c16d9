"""Anchors of point clouds."""

import numpy as np
import pytest

from catalyst4d import anchors


def test_anchors_represent_their_members():
    points = np.random.default_rng(0).random((500, 3))
    found = anchors.build(points, num_lines=20_000)
    assert 50 < len(found) < 500
    for index in range(len(found)):
        members = found.members_of(index)
        assert (found.owners[members] == index).all()
        low, high = points[members].min(0), points[members].max(0)
        position = found.positions[index]
        assert (position >= low - 1e-9).all() and (position <= high + 1e-9).all()
    covered = (found.owners >= 0).sum()
    assert covered + found.num_ungrouped + found.num_unhit == len(points)
    again = anchors.build(points, num_lines=20_000)
    assert again.positions.tobytes() == found.positions.tobytes()
    other = anchors.build(points, num_lines=20_000, seed=1)
    assert other.lines.tobytes() != found.lines.tobytes()


def test_wrong_input_is_an_error():
    for points, options in [
        (np.empty((0, 3)), {}),
        (np.ones((3, 2)), {}),
        (np.full((3, 3), np.inf), {}),
        (np.ones((3, 3)), {"k": 65}),
        (np.ones((3, 3)), {"radius": "wide"}),
        (np.ones((3, 3)), {"grouping": "none"}),
    ]:
        with pytest.raises(ValueError):
            anchors.build(points, **options)
