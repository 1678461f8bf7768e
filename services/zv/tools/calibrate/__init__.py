"""``zv calibrate``: find a camera's lens, and the plane that it looks at."""
