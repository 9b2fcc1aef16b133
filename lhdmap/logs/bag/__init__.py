"""ROS 1 bags (`log`, `scan`, `records`) and folders of ROS 2 bags (`folder`, `metadata`)."""
