"""Finds the events of tracks: arithmetic on tracks, stamps and shapes, without network or clock.

`TrackEvents` turns the tracks of each frame into events: a track started, was confirmed, lost,
ended; entered or left a zone or stayed in it; crossed a line. docs/events.md defines each event
and its stamp.
"""
