"""From setpoints to the machine's commands: queue, limits, braking along the path; watchdog, guard and modes beside it."""
