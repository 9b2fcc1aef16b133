"""Which topic plays which role: the contract's names, else types without doubt, else an error that lists candidates."""

from __future__ import annotations

import pytest
from lhdmap.errors import InputError, UsageError
from lhdmap.logs.base import TopicInfo
from lhdmap.logs.topics import assign_topics, is_ground_truth, missing_scanner, roles_and_doubt
from lhdmap.roles import ROLES

SCAN, ODOMETRY, IMU = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu"


def _log(**types: str) -> dict[str, TopicInfo]:
    return {f"/{name}": TopicInfo(f"/{name}", kind, 10) for name, kind in types.items()}


def test_the_names_of_the_contract() -> None:
    topics = {role.topic: TopicInfo(role.topic, role.type_name, 5) for role in ROLES.values()}
    assert assign_topics(topics) == {name: role.topic for name, role in ROLES.items()}


def test_a_contract_name_with_another_type_is_not_taken() -> None:
    topics = {"/lidar/front/scan": TopicInfo("/lidar/front/scan", IMU, 5), **_log(scan=SCAN)}
    assert assign_topics(topics)["front"] == "/scan"


@pytest.mark.parametrize(
    ("names", "front", "rear"),
    [
        (["scan"], "/scan", None),
        (["front_scan", "rear_scan"], "/front_scan", "/rear_scan"),
        (["base_scan", "scan_back"], "/base_scan", "/scan_back"),
        (["FLASER", "RLASER"], "/FLASER", "/RLASER"),
        (["sick_tim_fwd/scan", "sick_tim_aft/scan"], "/sick_tim_fwd/scan", "/sick_tim_aft/scan"),
        (["laser/fore", "draft_scan"], "/laser/fore", None),
        (["rear_scan"], "/rear_scan", None),  # the only one is the front scanner, whatever it is called
    ],
)
def test_scanners_by_type_and_name(names: list[str], front: str, rear: str | None) -> None:
    roles = assign_topics(_log(**dict.fromkeys(names, SCAN)))
    assert (roles["front"], roles.get("rear")) == (front, rear)


def test_doubt_is_an_error_that_lists_candidates_and_option() -> None:
    with pytest.raises(InputError, match=r"/left_scan, /right_scan.*--topic front=/left_scan"):
        assign_topics(_log(left_scan=SCAN, right_scan=SCAN))
    assert assign_topics(_log(left_scan=SCAN, right_scan=SCAN), {"front": "/right_scan"})["front"] == "/right_scan"


def test_doubt_about_the_scanner_leaves_the_other_roles_known() -> None:
    roles, doubt = roles_and_doubt(_log(left_scan=SCAN, right_scan=SCAN, imu=IMU))
    assert roles == {"inclinometer": "/imu"}
    assert "/left_scan, /right_scan" in doubt


def test_a_rear_scanner_alone_is_told_how_to_drive_by() -> None:
    topics = {"/lidar/rear/scan": TopicInfo("/lidar/rear/scan", SCAN, 9)}
    roles, doubt = roles_and_doubt(topics)
    assert (roles, doubt) == ({"rear": "/lidar/rear/scan"}, "")
    assert "--topic front=/lidar/rear/scan" in str(missing_scanner(topics, roles["rear"]))


def test_empty_scanner_topics_raise_no_doubt() -> None:
    topics = {**_log(scan=SCAN), "/unused": TopicInfo("/unused", SCAN, 0)}
    assert assign_topics(topics)["front"] == "/scan"


def test_other_roles_by_type() -> None:
    roles = assign_topics(_log(scan=SCAN, imu=IMU, wheel=ODOMETRY))
    assert (roles["inclinometer"], roles["wheel_odometry"]) == ("/imu", "/wheel")
    assert "wheel_odometry" not in assign_topics(_log(scan=SCAN, odom_a=ODOMETRY, odom_b=ODOMETRY))


@pytest.mark.parametrize(
    "name", ["/ground_truth/odometry", "/groundtruth", "/robot/Ground_Truth/pose", "/truth", "TRUEPOS"]
)
def test_ground_truth_is_never_an_input(name: str) -> None:
    assert is_ground_truth(name)
    topics = {**_log(scan=SCAN), name: TopicInfo(name, ODOMETRY, 10)}
    roles = assign_topics(topics)
    assert roles["ground_truth"] == name
    assert "wheel_odometry" not in roles


def test_overrides_must_name_what_is_there() -> None:
    with pytest.raises(InputError, match=r"no such topic; did you mean '/scan'"):
        assign_topics(_log(scan=SCAN), {"front": "/scans"})
    with pytest.raises(UsageError, match=r"unknown role 'frnt'; did you mean 'front'"):
        assign_topics(_log(scan=SCAN), {"frnt": "/scan"})


def test_an_option_that_names_a_topic_of_another_type_is_refused() -> None:
    with pytest.raises(InputError, match="LaserScan was wanted"):
        assign_topics(_log(scan=SCAN, imu=IMU), {"front": "/imu"})
