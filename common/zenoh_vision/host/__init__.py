"""The process and its machine: signals, health file, CPU limits, video devices, parent process."""
