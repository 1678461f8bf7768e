"""The process and its machine: signals, health file, video devices, end with the parent process."""
