"""Predicts the positions of objects from their earlier ones, as answers to queries."""
