"""Mounts from the transforms of a log: trees as robots have them, and what is wrong in some."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lhdmap.geometry import se3
from lhdmap.logs.frames import FrameTree
from lhdmap.messages import FloatArray, Mount

T_A = se3.from_rpy(0.1, -0.2, 0.3, (1.0, 2.0, 0.5))
T_B = se3.from_rpy(np.pi, 0.05, -1.0, (-0.3, 0.4, 1.5))


def _tree(*edges: tuple[str, str, FloatArray]) -> FrameTree:
    tree = FrameTree()
    for parent, child, T in edges:
        tree.add(Mount(0, parent, child, T))
    return tree


def _mount(tree: FrameTree, frame: str = "laser") -> tuple[str, FloatArray]:
    found = tree.mount(frame)
    assert found is not None
    return found.parent_frame, found.T_parent_child


def _at(mount: tuple[str, FloatArray], parent: str, T: FloatArray) -> bool:
    return mount[0] == parent and np.allclose(mount[1], T, atol=1e-12)


def test_through_the_common_ancestor() -> None:
    parent, T = _mount(_tree(("base_footprint", "base_link", T_A), ("base_footprint", "laser", T_B)))
    assert parent == "base_link"
    assert pytest.approx(np.linalg.inv(T_A) @ T_B) == T


def test_a_published_inverse() -> None:
    parent, T = _mount(_tree(("laser", "base_link", T_A)))
    assert parent == "base_link"
    assert pytest.approx(np.linalg.inv(T_A)) == T


@pytest.mark.parametrize("frame", ["robot1/laser", "laser"])
def test_one_prefix_is_taken_off_with_a_remark(frame: str) -> None:
    tree = _tree(("robot1/base_link", "robot1/laser", T_A))
    assert _at(_mount(tree, frame), "base_link", T_A)
    assert tree.remarks == ["the frames of the log carry the prefix 'robot1/': it is taken off"]


def test_a_scan_with_a_prefix_that_the_transforms_lack() -> None:
    assert _at(_mount(_tree(("base_link", "laser", T_A)), "robot1/laser"), "base_link", T_A)


def test_of_two_machines_each_scanner_sits_on_its_own() -> None:
    tree = _tree(("a/base_link", "a/laser", T_A), ("b/base_link", "b/laser", T_B))
    assert _at(_mount(tree, "a/laser"), "base_link", T_A)
    assert _at(_mount(tree, "b/laser"), "base_link", T_B)
    assert tree.mount("laser") is None  # whose?


def test_base_footprint_stands_for_a_base_link_that_is_not_there() -> None:
    assert _at(_mount(_tree(("base_footprint", "laser", T_A))), "base_link", T_A)


def test_the_nearer_body_is_the_one_that_carries_the_sensor() -> None:
    tree = _tree(("base_link", "rear_link", T_A), ("rear_link", "laser", T_B))
    assert _at(_mount(tree), "rear_link", T_B)


@pytest.mark.parametrize("T", [np.eye(4), np.full((4, 4), np.nan)])
def test_a_transform_of_a_frame_to_itself_leaves_the_mount(T: FloatArray) -> None:
    tree = _tree(("base_link", "laser", T_A), ("laser", "laser", T))
    assert _at(_mount(tree), "base_link", T_A)


def test_a_constant_transform_on_tf_counts_and_one_that_moves_does_not() -> None:
    tree = FrameTree()
    for k in range(5):
        tree.add(Mount(0, "base_link", "laser", T_A), static=False)
        tree.add(Mount(0, "odom", "base_link", se3.from_rpy(0.0, 0.0, 0.1 * k)), static=False)
        tree.add(Mount(0, "base_link", "boom", se3.from_rpy(0.0, 0.1 * k, 0.0)), static=False)
    assert _at(_mount(tree), "base_link", T_A)
    assert tree.mount("boom") is None
    assert [mount.child_frame for mount in tree.transforms()] == ["laser"]


def test_the_last_of_two_mounts_holds_with_a_remark() -> None:
    tree = _tree(("base_link", "laser", T_A), ("base_link", "laser", T_B))
    assert _at(_mount(tree), "base_link", T_B)
    assert "more than once" in tree.remarks[0]


@given(st.permutations(range(4)), st.lists(st.booleans(), min_size=4, max_size=4))
def test_neither_order_nor_direction_of_the_transforms_matters(order: list[int], turned: list[bool]) -> None:
    chain = ["base_link", "plate", "mast", "head", "laser"]
    steps = [se3.from_rpy(0.1 * k, 0.2, -0.1 * k, (k, 0.5, 0.1)) for k in range(4)]
    wanted = np.linalg.multi_dot(steps)
    edges = [
        (chain[k + 1], chain[k], se3.inverse(steps[k])) if turned[k] else (chain[k], chain[k + 1], steps[k])
        for k in order
    ]
    children = [child for _, child, _ in edges]
    if len(set(children)) == len(children):  # a frame has one parent
        assert _mount(_tree(*edges))[1] == pytest.approx(wanted)
