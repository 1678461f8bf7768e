"""The programs that the comparison starts: publishers, subscribers, a loop in one process.

They import nothing of this repository but ``measuring``, so that the system's own Python, which has
ROS, can run them; those of this system use the library as any service does.
"""
