"""Peers measured in the same run: KISS-ICP on flat clouds, and a plain point-to-line ICP against key scans."""

from __future__ import annotations

import numpy as np
from lhdmap.geometry import se2
from lhdmap.messages import FloatArray, LaserScan
from scipy.spatial import cKDTree

_KEY_M, _KEY_RAD = 1.0, 0.2


def hits(scan: LaserScan) -> FloatArray:
    """Return the scan's hits (N, 2)."""
    r = scan.ranges_m.astype(float)
    a = scan.angle_min_rad + scan.angle_increment_rad * np.arange(r.size)
    good = np.isfinite(r) & (r >= scan.range_min_m) & (r <= scan.range_max_m)
    return np.column_stack([r[good] * np.cos(a[good]), r[good] * np.sin(a[good])])


def kiss_icp(scans: list[LaserScan]) -> FloatArray:
    """Return poses (N, 3) by KISS-ICP 1.3 on the scans as clouds at z = 0 (its own constant velocity; voxels of 0.3 m)."""
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP

    config = load_config(None)
    config.data.max_range, config.data.min_range, config.data.deskew = 80.0, 0.1, False
    config.mapping.voxel_size = 0.3
    config.registration.max_num_threads = 1
    peer = KissICP(config)
    poses = []
    for scan in scans:
        flat = hits(scan)
        peer.register_frame(np.column_stack([flat, np.zeros(len(flat))]), np.zeros(0))
        T = peer.last_pose
        poses.append([T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])])
    return _unwrapped(poses)


def point_to_line(scans: list[LaserScan]) -> FloatArray:
    """Return poses (N, 3) by point-to-line ICP (Censi, ICRA 2008) against a key scan renewed each metre, constant velocity."""
    key, key_pose = _Key(hits(scans[0])), np.zeros(3)
    poses = [np.zeros(3), np.zeros(3)]
    for scan in scans[1:]:
        guess = se2.compose(poses[-1], se2.between(poses[-2], poses[-1]))
        points = hits(scan)
        pose = se2.compose(key_pose, key.align(points, se2.between(key_pose, guess)))
        poses.append(pose)
        step = se2.between(key_pose, pose)
        if np.hypot(step[0], step[1]) > _KEY_M or abs(step[2]) > _KEY_RAD:
            key, key_pose = _Key(points), pose
    return _unwrapped(poses[1:])


class _Key:
    """A key scan: a tree of its hits, normals from the neighbours in the sweep."""

    def __init__(self, points: FloatArray) -> None:
        self._points, self._tree = points, cKDTree(points)
        along = np.roll(points, -2, axis=0) - np.roll(points, 2, axis=0)
        self._normals = np.column_stack([-along[:, 1], along[:, 0]]) / (np.linalg.norm(along, axis=1)[:, None] + 1e-12)
        self._wall = np.linalg.norm(along, axis=1) < 0.6

    def align(self, points: FloatArray, pose: FloatArray, rounds: int = 12) -> FloatArray:
        for k in range(rounds):
            c, s = np.cos(pose[2]), np.sin(pose[2])
            turned = points @ np.array([[c, s], [-s, c]])
            moved = turned + pose[:2]
            distance, index = self._tree.query(moved, distance_upper_bound=0.5)
            near = np.isfinite(distance)
            near[near] &= self._wall[index[near]]
            n, p = self._normals[index[near]], self._points[index[near]]
            e = np.einsum("ij,ij->i", n, moved[near] - p)
            keep = np.abs(e) < max(0.03, 3.0 * float(np.median(np.abs(e)))) if len(e) else np.zeros(0, dtype=bool)
            if keep.sum() < 10:
                return pose
            n, e, t = n[keep], e[keep], turned[near][keep]
            J = np.column_stack([n, n[:, 1] * t[:, 0] - n[:, 0] * t[:, 1]])
            step = np.linalg.lstsq(J, -e, rcond=None)[0]
            pose = pose + step
            if k > 2 and np.abs(step).sum() < 1e-5:
                break
        return pose


def _unwrapped(poses: list[FloatArray] | list[list[float]]) -> FloatArray:
    table = np.array(poses)
    table[:, 2] = np.unwrap(table[:, 2])
    return table
