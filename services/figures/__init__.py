"""What is shown of nodes: their newest health, figures, a live table. For `zv up` and `zv top`."""
