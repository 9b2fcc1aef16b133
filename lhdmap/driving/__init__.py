"""What guidance, executor and navigation share: the machine as they see it, its motion, its bodies, setpoints for it."""
