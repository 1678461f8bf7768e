"""The recorder: a node that records what is on the network, all the time or around events."""
