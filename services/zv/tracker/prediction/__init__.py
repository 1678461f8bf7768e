"""Where an object will be: answers to queries, from where it has been."""
