"""SQLite files of ROS 2 bags: `log` reads them, `salvage` what is left of broken ones, `pages` knows the bytes."""
